"""FLIP (Andersson et al. 2020), a judge that nothing here was trained on: the difference a person sees when two pictures
alternate in one place.  Computed by its authors' package, ``flip-evaluator``, at its own viewing distance (67 pixels a degree).
"""

from collections.abc import Callable

import numpy as np
from torch import Tensor

FlipTo = Callable[[Tensor, Tensor], float]
"""Two pictures (3, H, W) in 0..1 sRGB, the truth first -> mean FLIP, 0 (equal) to 1."""

ABSENT = "flip-evaluator is not installed; `pip install flip-evaluator`"


def flip_judge() -> FlipTo | None:
    """The judge, None where the package is not there (ABSENT says so).  Importing this module does not load it."""
    try:
        import flip_evaluator  # type: ignore[import-not-found]
    except ImportError:
        return None

    def judged(truth: Tensor, made: Tensor) -> float:
        true, shown = (np.ascontiguousarray(picture.permute(1, 2, 0).float().numpy()) for picture in (truth, made))
        return float(flip_evaluator.evaluate(true, shown, "LDR", applyMagma=False)[1])

    return judged
