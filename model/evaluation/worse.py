"""Comparison of each neural picture with the filled picture, its network's input, which it should improve.

Counts the views that are worse, by each metric; keeps the pictures of the worst view for inspection.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from torch import Tensor

from .labelled import labelled_row, picture_bytes
from .metrics.figures import Figures

METRICS = {"psnr": "PSNR", "ssim": "SSIM", "distance": "distance", "flip": "FLIP"}
"""Field of :class:`.figures.Figures` -> name in tables."""
LEAST_ERROR = 1e-4
"""Lower limit of errors in a ratio, where a picture equals the truth: rounding to 8 bits alone makes an RMS error of
1 / (255 sqrt(12)), 11 times as much."""


def errors(figures: Figures) -> dict[str, float]:
    """Error by metric, 0 for the truth: root mean square error, 1 - SSIM, distance, FLIP; NaN if not available."""
    return {"psnr": 10.0 ** (-figures.psnr / 20.0), "ssim": 1.0 - figures.ssim, "distance": figures.distance,
            "flip": figures.flip}


def error_ratio(neural: Figures, filled: Figures) -> float:
    """Geometric mean over the metrics of neural error / filled error; above 1: the neural picture is worse."""
    made, base = errors(neural), errors(filled)
    logs = [math.log(max(made[metric], LEAST_ERROR) / max(base[metric], LEAST_ERROR)) for metric in METRICS
            if not math.isnan(made[metric] + base[metric])]
    return math.exp(float(np.mean(logs)))


@dataclass(frozen=True)
class Case:
    """Metrics of one network's picture of one view.

    view, method, exposure: names.  filled: metrics of the filled picture, the network's input.
    """

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
        """Title of the picture, one line."""
        return f"{self.scene}, {self.view}, {100 * self.density:.4g} % of the points, {self.exposure}, {self.method}"


def summary(cases: Sequence[Case]) -> dict:
    """Comparison of one network with the filled pictures, at one density and exposure, for JSON.

    worse: number of worse views by metric, None if not available.  views: number of views.  ratio: geometric mean of
    :func:`error_ratio` over views.  worst_view, worst_ratio: the view with the largest ratio.
    """
    worse: dict[str, int | None] = {}
    for metric in METRICS:
        pairs = [(errors(case.neural)[metric], errors(case.filled)[metric]) for case in cases]
        known = not any(math.isnan(a + b) for a, b in pairs)
        worse[metric] = sum(a > b for a, b in pairs) if known else None
    worst = max(cases, key=lambda case: case.ratio)
    return {"worse": worse, "views": len(cases), "ratio": math.exp(float(np.mean([math.log(c.ratio) for c in cases]))),
            "worst_view": worst.view, "worst_ratio": worst.ratio}


def format_summary(found: dict) -> str:
    """A summary as text: "worse than filled: PSNR 0, SSIM 1, distance -, FLIP 2 of 12"."""
    counts = ", ".join(f"{METRICS[metric]} {'-' if count is None else count}" for metric, count in found["worse"].items())
    return f"worse than filled: {counts} of {found['views']}"


@dataclass
class Worst:
    """Keeps the pictures of the case with the largest error ratio.

    case: None at first.  pictures: filled, neural and truth, (H, W, 3) uint8.
    """

    case: Case | None = None
    pictures: list[np.ndarray] = field(default_factory=list)

    def look(self, case: Case, filled: Tensor, neural: Tensor, truth: Tensor) -> None:
        """Adds a case.  filled, neural, truth: (3, H, W) in 0..1."""
        if self.case is None or case.ratio > self.case.ratio:
            self.case, self.pictures = case, [picture_bytes(picture) for picture in (filled, neural, truth)]

    def take(self, other: "Worst") -> None:
        """The worst case of another one, where it is worse."""
        if other.case is not None and (self.case is None or other.case.ratio > self.case.ratio):
            self.case, self.pictures = other.case, other.pictures

    def sheet(self) -> np.ndarray:
        """(H, W, 3) uint8: the three pictures side by side, each with its metrics."""
        assert self.case is not None
        case = self.case
        words = [_figures("filled", case.filled), _figures("neural", case.neural), "truth"]
        return labelled_row(self.pictures, words, f"{case.label}: error ratio {case.ratio:.2f}")


def _figures(name: str, figures: Figures) -> str:
    given = [("PSNR", figures.psnr, ".2f"), ("SSIM", figures.ssim, ".3f"), ("distance", figures.distance, ".3f"),
             ("FLIP", figures.flip, ".3f")]
    return f"{name}: " + ", ".join(f"{word} {value:{form}}" for word, value, form in given if not math.isnan(value))


def ratio_of_room(result: dict) -> float:
    """Sort key of a room's result, larger is worse: the largest error ratio of its networks.

    Without a network it is minus the best PSNR, which is below all ratios.
    """
    ratios = [row["against_filled"]["ratio"] for row in result["rows"] if row.get("against_filled")]
    if ratios:
        return max(ratios)
    return -max((row["psnr"] for row in result["rows"] if math.isfinite(row["psnr"])), default=math.inf)

