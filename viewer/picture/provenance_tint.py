"""The provenance tint: every pixel shows by its colour whether it was measured, repainted, filled or is background.

The reference of shaders/look_provenance.comp, which gives the same bytes, and the shares for the legend.
"""

from dataclasses import dataclass

import numpy as np

from .provenance import BACKGROUND, FILLED, MEASURED, MODELLED, PHOTOGRAPHED, REPAINTED, provenance

COLOURS: dict[int, tuple[int, int, int]] = {
    BACKGROUND: (60, 64, 72), MEASURED: (64, 190, 120), REPAINTED: (170, 90, 230), FILLED: (245, 160, 40),
    PHOTOGRAPHED: (60, 150, 240), MODELLED: (235, 235, 235),
}  # fmt: skip
"""sRGB; chosen to be told apart with any colour vision (green, violet, orange differ in lightness and hue)."""
NAMES: dict[int, str] = {
    MEASURED: "measured", REPAINTED: "measured, then repainted", FILLED: "filled", PHOTOGRAPHED: "from photographs",
    BACKGROUND: "background",
}  # fmt: skip
TINT = 160
"""Of 256: how much of a pixel is its tint; the rest is its brightness."""
FULLY_REPAINTED = 48
"""Levels of 255 by which the network changed a pixel that gets the full colour of REPAINTED; below, it leans to MEASURED."""


@dataclass(frozen=True)
class Shares:
    """percent: provenance -> share of the picture's pixels.  change: by how many sRGB levels of 255 the network changed
    measured pixels: the mean over pixels of the channel that changed most; None where there are none."""

    percent: dict[int, float]
    change: float | None


def repainted_by(image: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """(H, W) uint8: the largest difference of a channel between the picture and what was measured, both (H, W, 4) uint8."""
    return np.abs(image[..., :3].astype(np.int16) - measured[..., :3]).max(axis=-1).astype(np.uint8)


def shares(view: str, image: np.ndarray, mask: np.ndarray, measured: np.ndarray | None = None,
           photographs: np.ndarray | None = None) -> Shares:
    """The legend's numbers.  view, image, mask, photographs: as in :func:`provenance`.  measured: the filtered view of the same
    frame, needed for ``change`` of a neural picture."""
    found = provenance(view, image, mask, photographs)
    counts = np.bincount(found.ravel(), minlength=len(COLOURS))
    change = None
    if measured is not None and counts[REPAINTED]:
        change = float(repainted_by(image, measured)[found == REPAINTED].mean())
    return Shares({key: 100.0 * float(counts[key]) / found.size for key in COLOURS}, change)


def tinted(view: str, image: np.ndarray, mask: np.ndarray, measured: np.ndarray,
           photographs: np.ndarray | None = None) -> np.ndarray:
    """(H, W, 4) uint8, opaque: the picture's brightness in the colours of its provenance.  As in :func:`shares`."""
    found = provenance(view, image, mask, photographs)
    rgb = image[..., :3].astype(np.int64)
    grey = (54 * rgb[..., 0] + 183 * rgb[..., 1] + 19 * rgb[..., 2]) >> 8
    colour = np.array([COLOURS[key] for key in sorted(COLOURS)], np.int64)[found]
    amount = np.minimum(repainted_by(image, measured).astype(np.int64), FULLY_REPAINTED)[..., None]
    plain, changed = np.array(COLOURS[MEASURED]), np.array(COLOURS[REPAINTED])
    blend = (plain * (FULLY_REPAINTED - amount) + changed * amount + FULLY_REPAINTED // 2) // FULLY_REPAINTED
    colour = np.where((found == REPAINTED)[..., None], blend, colour)
    out = np.full(image.shape, 255, np.uint8)
    out[..., :3] = (grey[..., None] * (256 - TINT) + colour * TINT + 128) >> 8
    return out


def locked(neural: np.ndarray, filtered: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """The neural picture with measured pixels as they were measured.  (H, W, 4) uint8 each, mask (H, W) bool."""
    return np.where(mask[..., None], filtered, neural)
