"""What a command does before its first neural picture."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..picture.settings import Settings


def check_weights(settings: "Settings") -> None:
    """For the neural view: refuses weights that do not fit before the scan is read, and sets the process up for the network."""
    if settings.view == "neural":
        from ...model.common.process.torch_process import prepare_inference

        prepare_inference()  # before torch is imported
        from ...model.network.reconstruct import fitting_weights

        own = Path(settings.weights) if settings.weights else None
        fitting_weights(settings.quality, filtered=settings.filter != "off", weights=own)
