"""LPIPS (Zhang et al. 2018), by the package ``lpips`` (``pip install 'pointglass[lpips]'``) or ``torchmetrics``, where one is
installed and its weights can be fetched."""

import logging
from dataclasses import dataclass
from pathlib import Path

import torch
from torch import Tensor, nn

from .perceptual import SqueezeDistance

_log = logging.getLogger(__name__)

INSTALL = "pip install 'pointglass[lpips]'"
"""Installs LPIPS."""


def _from_lpips(backbone: str) -> nn.Module:
    import lpips  # type: ignore[import-not-found]

    return lpips.LPIPS(net=backbone, verbose=False)


def _from_torchmetrics(backbone: str) -> nn.Module:
    from torchmetrics.functional.image.lpips import _LPIPS  # type: ignore[import-not-found]

    return _LPIPS(pretrained=True, net=backbone)


@dataclass(frozen=True)
class Distances:
    """LPIPS and the SqueezeNet distance; each is None if it or its weights are not available.  missing: the reasons for
    LPIPS."""

    lpips: nn.Module | None
    squeeze: nn.Module | None
    missing: str

    @staticmethod
    def open(path: Path | None, backbone: str, device: str) -> "Distances":
        """path: folder of the SqueezeNet distance's weights, or None.  backbone: of LPIPS (vgg, alex, squeeze)."""
        squeeze = None if path is None else SqueezeDistance(path).eval().to(device)
        reasons = []
        for make in (_from_lpips, _from_torchmetrics):
            try:
                return Distances(make(backbone).eval().to(device), squeeze, "")
            except (ImportError, OSError, RuntimeError) as error:  # not installed, or its weights cannot be fetched
                _log.info("LPIPS is not available: %s", error)
                reasons.append(str(error).splitlines()[0] if str(error) else type(error).__name__)
        return Distances(None, squeeze, "; ".join([*reasons, INSTALL]))

    @torch.inference_mode()
    def __call__(self, made: Tensor, truth: Tensor) -> dict[str, float]:
        """Distances by name.  made, truth: (3, H, W), 0..1."""
        a, b = made[None], truth[None]
        nan = float("nan")
        return {
            "lpips_published": nan if self.lpips is None else float(self.lpips(a, b, normalize=False).mean()),
            "lpips": nan if self.lpips is None else float(self.lpips(a, b, normalize=True).mean()),
            "squeeze": nan if self.squeeze is None else float(self.squeeze(a, b)),
        }
