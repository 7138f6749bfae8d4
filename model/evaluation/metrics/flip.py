"""FLIP (Andersson et al. 2020): the visible difference when two pictures alternate in one place.

No network of this project was trained with it.  Computed by the authors' package ``flip-evaluator`` at its default viewing
distance, 67 pixels per degree.
"""

from collections.abc import Callable

import numpy as np
from torch import Tensor

from ...common.errors import INSTALL_LAB

FlipTo = Callable[[Tensor, Tensor], float]
"""(truth, picture), both (3, H, W) sRGB in 0..1 -> mean FLIP, 0 (equal) to 1."""

ABSENT = f"flip-evaluator is not installed; `{INSTALL_LAB}`"
"""Message if the package is not installed."""


def flip_metric() -> FlipTo | None:
    """The metric; None if the package, which is imported here, is not installed."""
    try:
        import flip_evaluator  # type: ignore[import-not-found]
    except ImportError:
        return None

    def metric(truth: Tensor, made: Tensor) -> float:
        true, shown = (np.ascontiguousarray(picture.permute(1, 2, 0).float().numpy()) for picture in (truth, made))
        return float(flip_evaluator.evaluate(true, shown, "LDR", applyMagma=False)[1])

    return metric
