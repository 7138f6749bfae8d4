"""Noise estimation: the standard deviation of one point's luma about the true surface's, separated from texture.

Complete small neighbourhoods are sampled, because randomly thinned points are farther apart and texture between them looks like
noise.  In each neighbourhood the luma of a point is compared with a plane fitted to its nearest neighbours (a difference-based
estimator: Hall, Kay and Titterington 1990) at two scales.  The growth of the residual from the near to the far scale is due to
texture and is extrapolated to distance zero, as for the nugget of a variogram.  Weakly textured neighbourhoods have the most
weight (Liu, Tanaka and Okutomi 2012).  Variances are robust, and with little evidence the estimate is too low rather than too
high, because too high an estimate washes out clean texture.

The laser's intensity is not used as a second witness of texture.  Among the coloured scans at hand studio, plant_room and
street_corner have none; within 40 neighbours it explains 9 % of the variance of luma in pumpA.e57 (median; 22 % weighted by
variance), nothing in sample_c.las and autzen_trim.laz, and 99.9 % in lion_takanawa.copc.laz, where it is made of the colours:
all noise would count as texture there.

Only points of one group (run or station) are compared; otherwise the disagreement of stations would be measured.  Where two
stations overlap, their points tell noise from texture finer than the spacing (model.appearance.station_pairs).  Luma is the
mean of sRGB values, 0 to 1, with the weights LUMA.  Frame and unit of length are those of the points.
"""

import numpy as np

from ..common.process.processors import in_rows
from .noise_model import KNOTS, MAX_VOXELS, NoiseModel, fit_model, no_noise

__all__ = ["BUDGET", "KNOTS", "LUMA", "MAX_VOXELS", "NoiseModel", "Sampler", "estimate_noise", "no_noise"]

LUMA = np.array([0.25, 0.6, 0.15])
"""Weights of red, green and blue; equal to model.network.unet.LUMA, which is not imported here because it needs torch."""
BOX_POINTS = 144
"""Points of a neighbourhood on a smooth surface, 12 x 12: enough for a variance within 12 %, few enough for a search without a
tree."""
BUDGET = 250_000
"""Points sampled, in some 2,000 neighbourhoods; chosen so that building plant_room.laz takes at most 5 % longer."""
_LEVELS = 6
"""The longest side of the bounds has 2**_LEVELS cells of the lattice at most, or one more."""
_MAX_IN_BOX = 512
"""Most points of one group in a neighbourhood; more (several surfaces, coinciding points) are cut off.  Half changes the
noise of four real scans by at most 4 %, twice changes nothing."""
_MIN_IN_BOX = 24
"""Fewest points of one group in a neighbourhood for an estimate.  Half or twice changes the noise at the points of the
same scans by at most 2 % (median of a scan)."""
_OUTER = 0.005
"""Share of the points outside the robust bounds, at each end of an axis.  Half or twice changes the noise of the same scans as
a whole by at most 11 %."""
_CUT = 3.0
"""Robust standard deviations at which residuals are clipped: heavy tails count, edges of texture count less.  Half, with its
own _CUT_VARIANCE (0.7785), lowers the noise of the same scans as a whole by 1 to 14 %; twice (1.0) raises it by 2 to 8 %."""
_CUT_VARIANCE = 0.9950
"""Variance of a standard normal distribution clipped at _CUT."""
_TEXTURE_RATIO = 1.45
"""r / (1 - r) for r = sqrt(NEAR / FAR): converts the growth of the variance from NEAR to FAR neighbours to the texture's
variance at NEAR, for texture whose variogram rises linearly.  A smoother texture adds less at NEAR, and noise is then
underestimated."""
_TEXTURED = 0.25
"""Relative growth of the variance from NEAR to FAR at which a neighbourhood has half weight.  Half or twice changes
the noise of the same scans as a whole by at most 10 %, but of a plant room, full of edges, by 25 and 34 %."""
_LEAST_SEGMENTS = 64
"""Neighbourhoods for which another thread is used, at least: 6 ms of a processor."""


def estimate_noise(xyz: np.ndarray, rgb: np.ndarray, group: np.ndarray | None = None, *, seed: int = 0) -> NoiseModel:
    """Estimates the noise of a scan's points.

    xyz: (N, 3) float64; non-finite points and outliers are ignored.  rgb: (N, 3) uint8 sRGB after exposure compensation; black
    points have no colour and are ignored.  group: (N,) ints, the run or station of each point; None where it is unknown: the
    difference of two exposures that are mixed point by point then counts as noise.  seed: of the sampling.
    """
    xyz = np.asarray(xyz, np.float64)
    stride = max(1, len(xyz) // 200_000)
    some = xyz[::stride]
    some = some[np.isfinite(some).all(axis=1)]
    if len(some) == 0:
        return no_noise()
    sampler = Sampler(some, np.full(len(some), float(stride)), seed)
    rows, boxes = sampler.pick(xyz)
    return sampler.noise(xyz[rows], rgb[rows], boxes, None if group is None else np.asarray(group)[rows])


class Sampler:
    """Chooses random neighbourhoods from the distribution of the points, then selects their points.

    places: (M, 3) float64, finite positions.  counts: (M,) number of points that each position represents.  apart: the
    positions are the centres of a grid's cells of this size, at multiples of it; 0: they are points.

    A lattice over the robust bounds is so coarse that its cells hold several neighbourhoods.  Each cell is divided into boxes
    of about BOX_POINTS points of a surface, and boxes are drawn at random until they hold about ``budget`` points.
    """

    def __init__(self, places: np.ndarray, counts: np.ndarray, seed: int = 0, budget: int = BUDGET, apart: float = 0.0):
        self.low, self.high = _robust_bounds(places, counts)
        self._salt = np.uint64(seed * 0x9E3779B97F4A7C15 % 2**64)
        extent = float((self.high - self.low).max())
        self.corner, self.cell = self.low, extent / 2**_LEVELS
        held = self._widened(places, counts, extent)
        if apart > 2 * self.cell:  # whole walls would lie in cells without a position: make them whole cells of the grid
            self.cell = apart * 2.0 ** max(0.0, np.ceil(np.log2(extent / 2**_LEVELS / apart)))
            held = self._widened(places, counts, extent, aligned=True)
        self._sides = np.where(held > 0, np.maximum(np.rint(np.sqrt(held / BOX_POINTS)), 1), 0).astype(np.int32)
        share = min(1.0, budget / max(float(held.sum()), 1.0))
        self._limit = min(int(share * 2.0**64), 2**64 - 1)
        self.most = 2 * budget
        """Number of selected points at which a caller should halve the boxes with :meth:`fewer`."""

    def _widened(self, places: np.ndarray, counts: np.ndarray, extent: float, aligned: bool = False) -> np.ndarray:
        """Doubles ``cell`` until cells hold several neighbourhoods.  aligned: they begin at multiples of their size.  Returns
        the points of each, (X, Y, Z)."""
        while True:
            if aligned:
                self.corner = np.floor(self.low / self.cell) * self.cell
            shape = np.maximum(np.ceil((self.high - self.corner) / self.cell - 1e-9), 1).astype(int)
            steps = np.floor((places - self.corner) / self.cell).astype(int)
            inside = ((steps >= 0) & (steps < shape)).all(axis=1)
            held = np.zeros(shape)
            np.add.at(held, tuple(steps[inside].T), counts[inside])
            occupied = np.sort(held[held > 0])
            if (occupied.size and np.average(occupied, weights=occupied) >= 4 * BOX_POINTS) or self.cell >= extent:
                return held
            self.cell *= 2

    def pick(self, xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (n,) of the points of xyz (N, 3) float64 that lie in sampled boxes, and the boxes' identifiers (n,) uint64."""
        from .noise_kernels import pick_points

        rows, boxes = np.empty(len(xyz), np.int64), np.empty(len(xyz), np.uint64)
        lattice = self.corner, 1 / self.cell, self._sides
        used = pick_points(np.ascontiguousarray(xyz), *lattice, self._salt, np.uint64(self._limit), rows, boxes)
        return rows[:used].copy(), boxes[:used].copy()

    def fewer(self) -> int:
        """Samples half of the boxes from now on; those still sampled have identifiers below the returned number."""
        self._limit //= 2
        return self._limit

    def noise(self, xyz: np.ndarray, rgb: np.ndarray, boxes: np.ndarray, group: np.ndarray | None) -> NoiseModel:
        """The noise of the selected points: xyz (n, 3), rgb (n, 3) uint8, boxes (n,) of :meth:`pick`, group (n,) or None."""
        found = _neighbourhoods(xyz, rgb, boxes, group)
        return fit_model(self.low, self.high, *found) if len(found[0]) else no_noise()


def _robust_bounds(places: np.ndarray, counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Corners (3,) of a box of positive size that holds all but a share _OUTER of the points at each end of each axis."""
    low, high = np.empty(3), np.empty(3)
    for axis in range(3):
        order = np.argsort(places[:, axis])
        along, share = places[order, axis], np.cumsum(counts[order])
        ends = np.searchsorted(share, (_OUTER * share[-1], (1 - _OUTER) * share[-1]))
        low[axis], high[axis] = along[np.minimum(ends, len(along) - 1)]
    extent = float((high - low).max())
    margin = 0.02 * extent if extent > 0 else max(1.0, float(np.abs(low).max())) * 1e-6
    return low - margin, high + margin


def _neighbourhoods(xyz, rgb, boxes, group):
    """Of each usable neighbourhood: centre (K, 3) float64, luma (K,), variance (K,) of a point's luma, and weight (K,)."""
    from .noise_kernels import STRIDE, residuals
    from .segment_order import order_within, stable_order
    from .station_pairs import pair_variances

    coloured = np.flatnonzero(rgb.any(axis=1))
    group = np.zeros(len(xyz), np.int64) if group is None else group
    order = coloured[stable_order(boxes[coloured], group[coloured])]
    boxes, group = boxes[order], group[order]
    new = np.ones(len(order), bool)
    new[1:] = (boxes[1:] != boxes[:-1]) | (group[1:] != group[:-1])
    starts = np.flatnonzero(new)
    number = np.cumsum(new) - 1
    order = order[order_within(xyz[order, 0], np.append(starts, len(order)))]  # by x; what tells segments apart stays as it is
    xyz, luma = xyz[order], ((rgb[order] @ LUMA) / 255).astype(np.float32)
    kept = np.arange(len(xyz)) - starts[number] < _MAX_IN_BOX  # the lowest in x: all of a smaller box
    sizes = np.bincount(number[kept], minlength=len(starts))
    kept &= (sizes >= _MIN_IN_BOX)[number]
    starts = np.append(0, np.cumsum(sizes[sizes >= _MIN_IN_BOX]))
    xyz, luma, first = xyz[kept], luma[kept], starts[:-1]
    if len(first) == 0:
        return np.zeros((0, 3)), np.zeros(0), np.zeros(0), np.zeros(0)
    sizes = np.diff(starts)
    centre = np.add.reduceat(xyz, first) / sizes[:, None]
    local = (xyz - np.repeat(centre, sizes, axis=0)).astype(np.float32)
    near, far, reach = np.zeros((3, len(xyz)), np.float32)
    in_rows(len(first), _LEAST_SEGMENTS, residuals, local, luma, starts, near, far, reach)
    looked = (np.arange(len(xyz)) - np.repeat(first, sizes)) % STRIDE == 0
    edges = np.append(0, np.cumsum(-(-sizes // STRIDE)))
    near, far = (_robust_variances(np.nan_to_num(r[looked]), edges) for r in (near, far))
    grows = np.maximum(far - near, 0)
    variance = np.maximum(near - _TEXTURE_RATIO * grows, 0)
    places = boxes[kept][first]
    origin = centre[np.searchsorted(places, places)]  # of the first segment of its box
    shared = (xyz - np.repeat(origin, sizes, axis=0)).astype(np.float32)
    variance = np.minimum(variance, pair_variances(shared, luma, starts, places, reach, near))
    weight = np.minimum(sizes / BOX_POINTS, 2.0) / (1 + (grows / np.maximum(_TEXTURED * near, 1e-12)) ** 2)
    return centre, np.add.reduceat(luma, first) / sizes, variance, weight


def _robust_variances(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """(S,) variances of the segments of values, with values clipped at _CUT robust standard deviations."""
    from .segment_order import sorted_within

    sizes = np.diff(starts)
    number = np.repeat(np.arange(len(sizes)), sizes)
    square = values.astype(np.float64) ** 2
    ranked = sorted_within(square, starts)
    middle = (ranked[starts[:-1] + (sizes - 1) // 2] + ranked[starts[:-1] + sizes // 2]) / 2
    limit = _CUT**2 * 1.4826**2 * middle
    return np.add.reduceat(np.minimum(square, limit[number]), starts[:-1]) / sizes / _CUT_VARIANCE
