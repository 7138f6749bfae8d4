"""The rule: a neural picture is never worse than the filled one that goes into its network.

Counted over views, by each judge for itself; the worst view is kept as pictures, to be looked at.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from torch import Tensor

from model.evaluation.figures import Figures
from model.evaluation.labelled import labelled_row, picture_bytes

JUDGES = {"psnr": "PSNR", "ssim": "SSIM", "distance": "distance", "flip": "FLIP"}
"""Field of Figures -> its name in tables."""
LEAST_ERROR = 1e-4
"""Of errors that are divided by each other: below it a picture is the truth by every judge, and ratios say nothing."""


def errors(figures: Figures) -> dict[str, float]:
    """What each judge finds wrong, 0 where nothing is: root of the mean square error, 1 - SSIM, distance, FLIP.  NaN where a
    judge is not there."""
    return {"psnr": 10.0 ** (-figures.psnr / 20.0), "ssim": 1.0 - figures.ssim, "distance": figures.distance,
            "flip": figures.flip}


def error_ratio(neural: Figures, filled: Figures) -> float:
    """Geometric mean over the judges of the neural picture's error divided by the filled one's; above 1: worse."""
    made, base = errors(neural), errors(filled)
    logs = [math.log(max(made[judge], LEAST_ERROR) / max(base[judge], LEAST_ERROR)) for judge in JUDGES
            if not math.isnan(made[judge] + base[judge])]
    return math.exp(float(np.mean(logs)))


@dataclass(frozen=True)
class Case:
    """One network's picture of one view.  view, method, exposure: names.  filled: the figures of what went into it."""

    scene: str
    view: str
    method: str
    density: float
    exposure: str
    neural: Figures
    filled: Figures

    @property
    def ratio(self) -> float:
        """:func:`error_ratio`."""
        return error_ratio(self.neural, self.filled)

    @property
    def label(self) -> str:
        """Which picture it is, in a line."""
        return f"{self.scene}, {self.view}, {100 * self.density:.4g} % of the points, {self.exposure}, {self.method}"


def summary(cases: Sequence[Case]) -> dict:
    """JSON-able count of the views that are worse than filled, of one network, density and exposure.

    ``worse``: by judge, None where it is not there.  ``views``: of how many.  ``ratio``: geometric mean of the views'
    :func:`error_ratio`.  ``worst_view`` and ``worst_ratio``: of the view where it is largest.
    """
    worse: dict[str, int | None] = {}
    for judge in JUDGES:
        pairs = [(errors(case.neural)[judge], errors(case.filled)[judge]) for case in cases]
        known = not any(math.isnan(a + b) for a, b in pairs)
        worse[judge] = sum(a > b for a, b in pairs) if known else None
    worst = max(cases, key=lambda case: case.ratio)
    return {"worse": worse, "views": len(cases), "ratio": math.exp(float(np.mean([math.log(c.ratio) for c in cases]))),
            "worst_view": worst.view, "worst_ratio": worst.ratio}


def said(found: dict) -> str:
    """A summary in words: "worse than filled: PSNR 0, SSIM 1, distance -, FLIP 2 of 12"."""
    counts = ", ".join(f"{JUDGES[judge]} {'-' if count is None else count}" for judge, count in found["worse"].items())
    return f"worse than filled: {counts} of {found['views']}"


@dataclass
class Worst:
    """Keeps the pictures of the case with the largest error ratio of all it was shown.

    case: None before the first.  pictures: filled, neural and truth, (H, W, 3) uint8.
    """

    case: Case | None = None
    pictures: list[np.ndarray] = field(default_factory=list)

    def look(self, case: Case, filled: Tensor, neural: Tensor, truth: Tensor) -> None:
        """filled, neural, truth: (3, H, W) in 0..1."""
        if self.case is None or case.ratio > self.case.ratio:
            self.case, self.pictures = case, [picture_bytes(picture) for picture in (filled, neural, truth)]

    def sheet(self) -> np.ndarray:
        """(H, W, 3) uint8: the three pictures side by side, with what each judge finds."""
        assert self.case is not None
        case = self.case
        words = [_figures("filled", case.filled), _figures("neural", case.neural), "truth"]
        return labelled_row(self.pictures, words, f"{case.label}: error ratio {case.ratio:.2f}")


def _figures(name: str, figures: Figures) -> str:
    given = [("PSNR", figures.psnr, ".2f"), ("SSIM", figures.ssim, ".3f"), ("distance", figures.distance, ".3f"),
             ("FLIP", figures.flip, ".3f")]
    return f"{name}: " + ", ".join(f"{word} {value:{form}}" for word, value, form in given if not math.isnan(value))


def ratio_of_room(result: dict) -> float:
    """How a room stands among others: the largest mean error ratio of its networks; where none was compared, less than any
    (by the PSNR of the best picture, the lowest first)."""
    ratios = [row["against_filled"]["ratio"] for row in result["rows"] if row.get("against_filled")]
    if ratios:
        return max(ratios)
    return -max((row["psnr"] for row in result["rows"] if math.isfinite(row["psnr"])), default=math.inf)

