"""Provenance of a picture: for every pixel, whether what is seen there was measured, repainted or filled.

Values of the map, (H, W) uint8, as ``render --aux`` writes it into NAME.provenance.png and :mod:`pointglass` returns it.
"""

import numpy as np

from .views import VIEWS

BACKGROUND, MEASURED, REPAINTED, FILLED, PHOTOGRAPHED, MODELLED = range(6)
PROVENANCE: dict[int, str] = {
    BACKGROUND: "background: nothing is shown",
    MEASURED: "measured: points in this pixel, kept by the filter",
    REPAINTED: "measured, and repainted by the network",
    FILLED: "filled: no point in this pixel was kept; interpolated, and in the neural view repainted",
    PHOTOGRAPHED: "from a photograph, on a surface that is measured or filled between agreeing neighbours",
    MODELLED: "a mesh laid beside the scan, nearer than what the scan shows there",
}


def provenance(view: str, image: np.ndarray, mask: np.ndarray, photographs: np.ndarray | None = None) -> np.ndarray:
    """Where each pixel of a picture comes from: a key of PROVENANCE.

    view: the view of the picture (viewer.picture.views.VIEWS).  image: (H, W, 4) uint8, premultiplied, from ``Frame.image``.
    mask: (H, W) bool, kept by the filter, from ``Frame.mask``; in the raw view, where nothing is filtered or filled,
    it is not looked at.  photographs: (H, W) bool, from ``Frame.from_photographs``; None where none were used.
    Returns (H, W) uint8.

    A pixel of alpha 0 is background; one the hole test found partly open (0 < alpha < 255) counts as shown.  A point without
    a colour hides what is behind it and is not in the mask: its pixel is filled.  Where scanner positions are known, filled and
    neural views blend a measured pixel of low confidence with its neighbours; it still counts as measured.
    """
    passes = VIEWS[view].passes
    measured = REPAINTED if "network" in passes else MEASURED
    kept = mask if "filter" in passes else np.ones_like(mask, bool)
    found = np.where(kept, measured, FILLED)
    if photographs is not None and "fill" in passes:
        found = np.where(photographs, PHOTOGRAPHED, found)
    return np.where(image[..., 3] == 0, BACKGROUND, found).astype(np.uint8)


def views_with_mask(view: str) -> tuple[str, ...]:
    """The views to render for a picture of ``view`` whose mask is wanted: a mask needs the filter, which raw does not run."""
    return (view,) if "filter" in VIEWS[view].passes else (view, "filtered")
