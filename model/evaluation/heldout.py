"""Pictures judged by withheld points (:mod:`model.data.heldout`): any scan is judged, without photographs.

Three figures of each picture, at the withheld points that are visible:

* PSNR, over their channels; a view counts once, however many points it has.
* the same in gaps: at pixels where the picture had nothing measured that the filter keeps.
* slope of true on shown differences: both colours less their Gaussian mean over the withheld points around, the true ones
  regressed on the shown ones.  1: contrast is right; below: the picture shows more than there is (its input's noise); above: it
  has washed some out.  The noise of the withheld points does not bias it, for the picture knows nothing of that noise.

That noise bounds PSNR: a perfect picture of a noisy scan reaches no more than its noise.  So figures compare pictures of one
scan, and not scans.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.ndimage import gaussian_filter
from torch import Tensor

from model.data.dataset import Scan, TruePicture
from model.data.heldout import HELD_OUT, Targets, targets
from model.data.projected import Projected, project_scan
from model.evaluation.labelled import picture_bytes
from model.evaluation.methods import OURS, Method, Sight, sight, soft_z
from model.noise import NoiseModel
from model.unet import LUMA

HIGH_PASS = 4.0
"""Pixels, standard deviation of the mean that is taken off for the slope: texture and noise remain, shading goes."""
MOST_JUDGED = 200_000
"""Withheld points of a view that are judged; more change no figure's second decimal."""
LEAST_IN_GAPS = 100
"""Withheld points in gaps below which a view says nothing of gaps."""
NOISE_LEVELS = 3
"""Parts of equal size that the withheld points are split into by the noise level around them."""


def high_pass(values: np.ndarray, index: np.ndarray, shape: tuple[int, int], sigma: float = HIGH_PASS) -> np.ndarray:
    """(K, C) values less the Gaussian mean of all values around, each at its pixel.  index: (K,) row-major.  sigma: pixels."""

    def blurred(weights: np.ndarray | None) -> np.ndarray:
        sums = np.bincount(index, weights, shape[0] * shape[1]).reshape(shape)
        return gaussian_filter(sums.astype(np.float32), sigma, mode="constant", truncate=3.0).ravel()[index]

    count = np.maximum(blurred(None), 1e-12)  # every value counts itself: above 0 but for rounding
    return values - np.stack([blurred(values[:, c]) / count for c in range(values.shape[1])], 1)


@dataclass(frozen=True)
class PointErrors:
    """One picture at the withheld points of one view, (K,) each.  square: squared error, mean over channels.  product, power:
    of true and shown differences, of shown ones with themselves, summed over channels.  gap: bool.  noise: None if unknown."""

    square: np.ndarray
    product: np.ndarray
    power: np.ndarray
    gap: np.ndarray
    noise: np.ndarray | None = None

    def chosen(self, keep: np.ndarray) -> "PointErrors":
        """The points of ``keep`` (K,) bool."""
        noise = None if self.noise is None else self.noise[keep]
        return PointErrors(self.square[keep], self.product[keep], self.power[keep], self.gap[keep], noise)


def point_errors(picture: Tensor, wanted: Targets, gap: Tensor, noise: np.ndarray | None = None) -> PointErrors:
    """picture: (3, H, W) in 0..1.  gap: (H, W) bool, where nothing was measured."""
    index, shape = wanted.index.numpy(), (picture.shape[1], picture.shape[2])
    shown = picture.reshape(3, -1)[:, wanted.index].T.numpy().astype(np.float64)
    true = wanted.rgb.numpy() / 255.0
    fine_true, fine_shown = high_pass(true, index, shape), high_pass(shown, index, shape)
    return PointErrors(np.square(shown - true).mean(1), (fine_true * fine_shown).sum(1), np.square(fine_shown).sum(1),
                       gap.flatten()[wanted.index].numpy(), noise)


def _psnr(errors: Sequence[PointErrors]) -> float:
    """Mean over views, dB; NaN where there are none."""
    values = [-10.0 * math.log10(max(float(e.square.mean()), 1e-12)) for e in errors if len(e.square)]
    return float(np.mean(values)) if values else math.nan


def _slope(errors: Sequence[PointErrors]) -> float:
    """Over views, each of the same weight; NaN where the picture is even."""
    means = [(float(e.product.mean()), float(e.power.mean())) for e in errors if len(e.square)]
    power = sum(p for _, p in means)
    return sum(p for p, _ in means) / power if power > 0 else math.nan


def figures(errors: Sequence[PointErrors]) -> dict:
    """JSON-able figures of one method over views: psnr, psnr_gaps, slope, gaps (share of the points), points, and, where the
    noise is known, ``noise``: (sigma, psnr, slope) from the quietest part of the points to the noisiest."""
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
    """A camera to judge from.  station: the scanner that is left out for it, None: points are withheld at random."""

    name: str
    picture: TruePicture
    station: int | None = None


@dataclass
class Withheld:
    """Judges methods on a scan, view by view.

    spacing: of the whole scan, its units.  unlit: black points have no colour.  noise: of the scan, as the network is told it,
    None if not known.  share: of the points, withheld at random.
    """

    scan: Scan
    spacing: float
    methods: list[Method]
    densities: Sequence[float]
    seed: int = 11
    unlit: bool = False
    noise: NoiseModel | None = None
    share: float = HELD_OUT
    found: dict[tuple[str, str, float], list[PointErrors]] = field(default_factory=dict)

    def judge(self, viewpoint: Viewpoint) -> tuple[Targets, dict[str, Tensor]]:
        """Adds a viewpoint's figures to ``found``, by (what is withheld, method, density).

        Returns its withheld points and the pictures (3, H, W) of the first density by method, to be looked at.
        """
        seen = project_scan(self.scan, viewpoint.picture, self.seed)
        if viewpoint.station is None:
            what, held, left = "points", seen.rank >= 1.0 - self.share, 1.0 - self.share
        else:
            what, held = f"station {viewpoint.station + 1}", seen.station == viewpoint.station
            left = 1.0 - float((self.scan.station == viewpoint.station).mean())
        wanted = targets(seen, held, soft_z(self.spacing, unlit=self.unlit)).some(MOST_JUDGED, self.seed)
        noise = self._noise(wanted)
        shown: dict[str, Tensor] = {}
        for density in self.densities:
            view = self._sight(seen, held, left, density, random=viewpoint.station is None)
            gap = ~view.mask(OURS)
            for method in self.methods:
                picture = method.picture(view)
                if density == self.densities[0]:
                    shown[method.name] = picture
                if len(wanted.index):
                    errors = point_errors(picture, wanted, gap, noise)
                    self.found.setdefault((what, method.name, density), []).append(errors)
        return wanted, shown

    def _sight(self, seen: Projected, held: Tensor, left: float, density: float, *, random: bool) -> Sight:
        """What the methods see: a share ``density`` of the points that are not withheld, which are a share ``left`` of all.

        random: whether the rank of a point tells that it is withheld.
        """
        most = density * left if random else density
        return sight(seen.chosen(~held & (seen.rank < most)), None, self.spacing / (left * density) ** 0.5, unlit=self.unlit,
                     noise=self.noise)

    def _noise(self, wanted: Targets) -> np.ndarray | None:
        if self.noise is None:
            return None
        luma = wanted.rgb.numpy() / np.float32(255) @ np.array(LUMA, np.float32)
        return np.asarray(self.noise.at(self.scan.xyz[wanted.point.numpy()], luma), np.float64)

    def rows(self) -> list[dict]:
        """A row a method, density and what is withheld: ``method``, ``density``, ``withheld``, ``views`` and the figures."""
        return [{"method": method, "density": density, "withheld": what, "views": len(errors), **figures(errors)}
                for (what, method, density), errors in self.found.items()]


def nearer(filled: Tensor, neural: Tensor, wanted: Targets, sigma: float = HIGH_PASS) -> np.ndarray:
    """(H, W, 3) uint8: blue where the neural picture is nearer to the withheld points, orange where the filled one is, the
    stronger the more, over a grey filled picture; grey alone where no withheld point is visible.

    Squared errors are averaged over the points around (sigma: pixels): a single point's own noise says little.
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

