"""Evaluation of pictures at withheld points (:mod:`model.data.heldout`), for any scan, without photographs.

Three metrics of each picture, at the visible withheld points:

* PSNR over points and channels; the mean over views has equal weights.
* The same in gaps: at pixels without a point that the depth filter keeps.
* Slope: the regression of true on shown local contrast, that is colour minus the Gaussian mean of the withheld points
  around it.  1: contrast is right; below: the picture has too much of it (noise of its input); above: the picture is blurred.
  The noise of the withheld points does not bias the slope, as it is independent of the picture.

That noise limits PSNR: even a perfect picture does not exceed it.  Compare pictures of one scan with these metrics, not scans.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import torch
from scipy.ndimage import gaussian_filter
from torch import Tensor

from ..appearance.noise import NoiseModel
from ..data.dataset import MergedScan, TruePicture
from ..data.heldout import HELD_OUT, Targets, targets
from ..data.surfaces.projected import Projected, project_scan
from ..network.unet import LUMA
from .labelled import picture_bytes
from .methods import OURS, Method, ViewPoints, soft_z, view_points

HIGH_PASS = 4.0
"""Standard deviation, pixels, of the Gaussian mean subtracted for the slope: it removes shading and keeps texture and noise:
0.4 of the amplitude at a period of 2 pi deviations, 25 pixels, and more of shorter ones."""
MOST_JUDGED = 200_000
"""Largest number of withheld points per view; more do not change the second decimal of any metric (measured)."""
LEAST_IN_GAPS = 100
"""Least number of withheld points in gaps for a view to count in the metrics of gaps: the RMS of so many errors has a
standard error of 1 / sqrt(200), 7 %, or 0.6 dB of PSNR."""
NOISE_LEVELS = 3
"""Number of equal parts into which the withheld points are split by noise level: low, middle and high."""


def high_pass(values: np.ndarray, index: np.ndarray, shape: tuple[int, int], sigma: float = HIGH_PASS) -> np.ndarray:
    """(K, C) values minus their Gaussian mean around each pixel.  index: (K,) row-major pixels of the values.  sigma:
    pixels."""

    def blurred(weights: np.ndarray | None) -> np.ndarray:
        sums = np.bincount(index, weights, shape[0] * shape[1]).reshape(shape)
        return gaussian_filter(sums.astype(np.float32), sigma, mode="constant", truncate=3.0).ravel()[index]

    count = np.maximum(blurred(None), 1e-12)  # above 0 except for rounding, as each value counts itself
    return values - np.stack([blurred(values[:, c]) / count for c in range(values.shape[1])], 1)


@dataclass(frozen=True)
class PointErrors:
    """Errors of one picture at the K withheld points of one view, (K,) each.

    square: squared error, mean over channels.  product: of true and shown local contrast, power: square of the shown one, both
    summed over channels.  gap: bool.  noise: standard deviation, None if unknown.
    """

    square: np.ndarray
    product: np.ndarray
    power: np.ndarray
    gap: np.ndarray
    noise: np.ndarray | None = None

    def chosen(self, keep: np.ndarray) -> "PointErrors":
        """The errors at the points ``keep`` (K,) bool."""
        noise = None if self.noise is None else self.noise[keep]
        return PointErrors(self.square[keep], self.product[keep], self.power[keep], self.gap[keep], noise)


def point_errors(picture: Tensor, wanted: Targets, gap: Tensor, noise: np.ndarray | None = None) -> PointErrors:
    """Errors of a picture (3, H, W) in 0..1.  gap: (H, W) bool, pixels without a measured colour.  noise: (K,) or None."""
    index, shape = wanted.index.numpy(), (picture.shape[1], picture.shape[2])
    shown = picture.reshape(3, -1)[:, wanted.index].T.numpy().astype(np.float64)
    true = wanted.rgb.numpy() / 255.0
    fine_true, fine_shown = high_pass(true, index, shape), high_pass(shown, index, shape)
    return PointErrors(np.square(shown - true).mean(1), (fine_true * fine_shown).sum(1), np.square(fine_shown).sum(1),
                       gap.flatten()[wanted.index].numpy(), noise)


def _psnr(errors: Sequence[PointErrors]) -> float:
    """Mean over views, dB; NaN without views."""
    values = [-10.0 * math.log10(max(float(e.square.mean()), 1e-12)) for e in errors if len(e.square)]
    return float(np.mean(values)) if values else math.nan


def _slope(errors: Sequence[PointErrors]) -> float:
    """Slope over views of equal weight; NaN if the picture has no local contrast."""
    means = [(float(e.product.mean()), float(e.power.mean())) for e in errors if len(e.square)]
    power = sum(p for _, p in means)
    return sum(p for p, _ in means) / power if power > 0 else math.nan


def figures(errors: Sequence[PointErrors]) -> dict:
    """Metrics of one method over views, for JSON.

    psnr, psnr_gaps: dB; slope; gaps: share of the points; points: number; noise: sigma, psnr and slope of each part of the
    points, the lowest noise first, or None if the noise is unknown.
    """
    inside = [e.chosen(e.gap) for e in errors if e.gap.sum() >= LEAST_IN_GAPS]
    count = sum(len(e.square) for e in errors)
    found = {"psnr": _psnr(errors), "psnr_gaps": _psnr(inside), "slope": _slope(errors), "points": count,
             "gaps": sum(int(e.gap.sum()) for e in errors) / max(count, 1), "noise": None}
    levels = [e.noise for e in errors if e.noise is not None]
    if levels and len(levels) == len(errors):
        edges = np.quantile(np.concatenate(levels), np.linspace(0, 1, NOISE_LEVELS + 1))[1:-1]
        found["noise"] = []
        for level in range(NOISE_LEVELS):
            parts = [e.chosen(np.digitize(sigma, edges) == level) for e, sigma in zip(errors, levels, strict=True)]
            sigmas = np.concatenate([part.noise for part in parts if part.noise is not None])
            if len(sigmas):
                found["noise"].append({"sigma": float(sigmas.mean()), "psnr": _psnr(parts), "slope": _slope(parts)})
    return found


@dataclass(frozen=True)
class Viewpoint:
    """A camera for the evaluation.  station: index of the station that is withheld; None: points are withheld at random."""

    name: str
    picture: TruePicture
    station: int | None = None


@dataclass(frozen=True)
class Judged:
    """What was made of a viewpoint: its withheld points; by method the pictures (3, H, W) of the first density; and the
    measured pixels of these, (H, W) bool."""

    wanted: Targets
    pictures: dict[str, Tensor]
    measured: Tensor


@dataclass
class Withheld:
    """Evaluates methods on a scan, view by view.

    spacing: point spacing of the whole scan, file units.  unlit: black points count as points without colour.  noise: noise
    model of the scan, an input of the network; None if unknown.  share: of the points, withheld at random.
    found: errors by (withheld points, method, density), one entry per view.
    """

    scan: MergedScan
    spacing: float
    methods: list[Method]
    densities: Sequence[float]
    seed: int = 11
    unlit: bool = False
    noise: NoiseModel | None = None
    share: float = HELD_OUT
    found: dict[tuple[str, str, float], list[PointErrors]] = field(default_factory=dict)

    def judge(self, viewpoint: Viewpoint) -> Judged:
        """Adds the errors of one viewpoint to ``found``."""
        seen = project_scan(self.scan, viewpoint.picture, self.seed)
        if viewpoint.station is None:
            what, held, left = "points", seen.rank >= 1.0 - self.share, 1.0 - self.share
        else:
            what, held = f"station {viewpoint.station + 1}", seen.station == viewpoint.station
            left = 1.0 - float((self.scan.station == viewpoint.station).mean())
        wanted = targets(seen, held, soft_z(self.spacing, unlit=self.unlit)).some(MOST_JUDGED, self.seed)
        noise = self._noise(wanted)
        shown: dict[str, Tensor] = {}
        measured = torch.zeros(0)
        for density in self.densities:
            view = self._sight(seen, held, left, density, random=viewpoint.station is None)
            gap = ~view.mask(OURS)
            if density == self.densities[0]:
                measured = ~gap
            for method in self.methods:
                picture = method.picture(view)
                if density == self.densities[0]:
                    shown[method.name] = picture
                if len(wanted.index):
                    errors = point_errors(picture, wanted, gap, noise)
                    self.found.setdefault((what, method.name, density), []).append(errors)
        return Judged(wanted, shown, measured)

    def _sight(self, seen: Projected, held: Tensor, left: float, density: float, *, random: bool) -> ViewPoints:
        """Input of the methods: a share ``density`` of the points that are not withheld, which are a share ``left`` of all.

        random: whether points are withheld by their rank.
        """
        most = density * left if random else density
        shown = seen.chosen(~held & (seen.rank < most))
        return view_points(shown, None, self.spacing / (left * density) ** 0.5, unlit=self.unlit, noise=self.noise)

    def _noise(self, wanted: Targets) -> np.ndarray | None:
        if self.noise is None:
            return None
        luma = wanted.rgb.numpy() / np.float32(255) @ np.array(LUMA, np.float32)
        return np.asarray(self.noise.at(self.scan.xyz[wanted.point.numpy()], luma), np.float64)

    def rows(self) -> list[dict]:
        """A row for each method, density and kind of withheld points: ``method``, ``density``, ``withheld``, ``views``,
        metrics."""
        return [{"method": method, "density": density, "withheld": what, "views": len(errors), **figures(errors)}
                for (what, method, density), errors in self.found.items()]


def nearer(filled: Tensor, neural: Tensor, wanted: Targets, sigma: float = HIGH_PASS) -> np.ndarray:
    """(H, W, 3) uint8: a map of which picture is closer to the withheld points, over the filled picture in grey.

    Blue: the neural picture; orange: the filled one; a stronger colour is a larger difference.  Grey: no withheld point is
    visible.  Squared errors are averaged with a Gaussian (sigma: pixels), as single points are noisy.
    """
    shape = (filled.shape[1], filled.shape[2])
    index, true = wanted.index.numpy(), wanted.rgb.numpy() / 255.0

    def around(picture: Tensor) -> np.ndarray:
        square = np.square(picture.reshape(3, -1)[:, wanted.index].T.numpy() - true).mean(1)
        sums = np.bincount(index, square, shape[0] * shape[1]).reshape(shape)
        return gaussian_filter(sums.astype(np.float32), sigma, mode="constant")

    count = gaussian_filter(np.bincount(index, minlength=shape[0] * shape[1]).reshape(shape).astype(np.float32), sigma,
                            mode="constant")
    one, other = around(filled), around(neural)
    gain = np.where(count > 1e-3 / sigma**2, (one - other) / np.maximum(one + other, 1e-12), 0.0)
    grey = np.repeat((picture_bytes(filled) @ np.array(LUMA) * 0.6 + 40.0)[..., None], 3, axis=2)
    tint = np.where(gain[..., None] > 0, (60.0, 130.0, 255.0), (255.0, 140.0, 30.0))
    strength = np.clip(2.0 * np.abs(gain), 0, 0.85)[..., None]
    return np.rint(grey * (1.0 - strength) + tint * strength).astype(np.uint8)

