"""Noise estimation: the standard deviation of one point's luma about the true surface's, separated from texture.

Complete small neighbourhoods are sampled, because randomly thinned points are farther apart and texture between them looks like
noise.  In each neighbourhood the luma of a point is compared with a plane fitted to its nearest neighbours (a difference-based
estimator: Hall, Kay and Titterington 1990) at two scales.  The growth of the residual from the near to the far scale is due to
texture and is extrapolated to distance zero, as for the nugget of a variogram.  Weakly textured neighbourhoods have the most
weight (Liu, Tanaka and Okutomi 2012).  Variances are robust, and with little evidence the estimate is too low rather than too
high, because too high an estimate washes out clean texture.

Only points of one group (run or station) are compared; otherwise the disagreement of stations would be measured.  Luma is the
mean of sRGB values, 0 to 1, with the weights LUMA.  Frame and unit of length are those of the points.
"""

from dataclasses import dataclass

import numpy as np

LUMA = np.array([0.25, 0.6, 0.15])
"""Weights of red, green and blue; equal to model.network.unet.LUMA, which is not imported here because it needs torch."""
KNOTS = 9
"""Brightnesses, evenly spaced from 0 to 1, at which the noise curve is estimated.  With 5 or 17 the noise at the points of four
real scans changes by at most 4 % (median of a scan)."""
MAX_VOXELS = 64
"""Voxels of the lattice along its longest side, a power of two: twice as many as the neighbourhoods of BUDGET allow."""
BOX_POINTS = 144
"""Points of a neighbourhood on a smooth surface, 12 x 12: enough for a variance within 12 %, few enough for a search without a
tree."""
BUDGET = 250_000
"""Points sampled, in some 2,000 neighbourhoods; chosen so that building plant_room.laz takes at most 5 % longer."""
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
_QUANTILE = 0.4
"""Quantile of the neighbourhoods of a voxel: below the median, so that texture biases it less.  0.3 and 0.5 change the noise of
the same scans by -13 to -7 % and 5 to 16 %."""
_PRIOR = 3.0
"""Weight, in neighbourhoods, of the coarser voxel's value in a voxel's estimate.  Half or twice changes the noise at the
points of the same scans by at most 8 % (median of a scan)."""
_CURVE_PRIOR = 30.0
"""Weight, in neighbourhoods, of the value 1 in the curve's estimate.  Half or twice changes the noise at the points of
the same scans by at most 2 %."""
_CURVE_RANGE = (0.25, 4.0)
"""Limits of the curve.  0.5 and 2 change the noise at the points of the same scans by at most 0.3 %, 0.125 and 8 do not."""
_CURVE_LEVEL, _BACKFITS = 2, 3
"""The curve is estimated within voxels of a quarter of the scan's longest side (2**-2), in three alternations with the lattice;
finer voxels would mostly have one brightness each."""
_MAX_SIGMA = 0.5
"""The largest standard deviation of values between 0 and 1."""


@dataclass(frozen=True, eq=False)
class NoiseModel:
    """Noise by position and brightness.

    origin: (3,) float64, corner of voxel (0, 0, 0), in the frame of the points it was estimated from.
    voxel: side of a voxel, in the unit of the points; at most MAX_VOXELS along the longest side of the robust bounds.
    sigma: (Z, Y, X) float32, standard deviation of one point's luma where the curve is 1; finite and smooth everywhere: a
        voxel with little evidence is drawn to the value of the coarser voxel around it, and without any to the scan's.
    curve: (KNOTS,) float32, factor by luma at 0, 1/8, ..., 1, linear in between; its mean over the evidence is 1.
    overall: the scan's standard deviation, the median over the voxels with evidence, weighted by evidence.
    neighbourhoods: number of neighbourhoods of the estimate; 0: there is none, and all values are 0.
    """

    origin: np.ndarray
    voxel: float
    sigma: np.ndarray
    curve: np.ndarray
    overall: float
    neighbourhoods: int = 0

    def at(self, xyz: np.ndarray, luma: np.ndarray) -> np.ndarray:
        """(N,) float32: the standard deviation at positions xyz (N, 3), of the nearest voxel, for points of luma (N,) 0..1."""
        shape = np.array(self.sigma.shape[::-1])
        with np.errstate(invalid="ignore"):
            steps = np.nan_to_num(np.clip((np.asarray(xyz, np.float64) - self.origin) / self.voxel, 0, shape - 1))
        x, y, z = steps.astype(np.int64).T
        factor = np.interp(luma, np.linspace(0, 1, KNOTS), self.curve)
        return (self.sigma[z, y, x] * factor).astype(np.float32)


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


def no_noise() -> NoiseModel:
    """The model of a scan without enough points for an estimate: 0 everywhere."""
    return NoiseModel(np.zeros(3), 1.0, np.zeros((1, 1, 1), np.float32), np.ones(KNOTS, np.float32), 0.0)


class Sampler:
    """Chooses random neighbourhoods from the distribution of the points, then selects their points.

    places: (M, 3) float64, finite positions.  counts: (M,) number of points that each position represents.

    A lattice over the robust bounds is so coarse that its cells hold several neighbourhoods.  Each cell is divided into boxes
    of about BOX_POINTS points of a surface, and boxes are drawn at random until they hold about ``budget`` points.
    """

    def __init__(self, places: np.ndarray, counts: np.ndarray, seed: int = 0, budget: int = BUDGET):
        self.low, self.high = _robust_bounds(places, counts)
        self._salt = np.uint64(seed * 0x9E3779B97F4A7C15 % 2**64)
        extent = float((self.high - self.low).max())
        held = np.zeros((1, 1, 1))
        for level in range(6, -1, -1):
            self.cell = extent / 2**level
            shape = np.maximum(np.ceil((self.high - self.low) / self.cell - 1e-9), 1).astype(int)
            steps = np.floor((places - self.low) / self.cell).astype(int)
            inside = ((steps >= 0) & (steps < shape)).all(axis=1)
            held = np.zeros(shape)
            np.add.at(held, tuple(steps[inside].T), counts[inside])
            occupied = np.sort(held[held > 0])
            if occupied.size and np.average(occupied, weights=occupied) >= 4 * BOX_POINTS:
                break
        self._sides = np.where(held > 0, np.maximum(np.rint(np.sqrt(held / BOX_POINTS)), 1), 0).astype(np.int32)
        share = min(1.0, budget / max(float(held.sum()), 1.0))
        self._limit = min(int(share * 2.0**64), 2**64 - 1)
        self.most = 2 * budget
        """Number of selected points at which a caller should halve the boxes with :meth:`fewer`."""

    def pick(self, xyz: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (n,) of the points of xyz (N, 3) float64 that lie in sampled boxes, and the boxes' identifiers (n,) uint64."""
        from .noise_kernels import pick_points

        rows, boxes = np.empty(len(xyz), np.int64), np.empty(len(xyz), np.uint64)
        used = pick_points(np.ascontiguousarray(xyz), self.low, 1 / self.cell, self._sides, self._salt, np.uint64(self._limit),
                           rows, boxes)  # fmt: skip
        return rows[:used].copy(), boxes[:used].copy()

    def fewer(self) -> int:
        """Samples half of the boxes from now on; those still sampled have identifiers below the returned number."""
        self._limit //= 2
        return self._limit

    def noise(self, xyz: np.ndarray, rgb: np.ndarray, boxes: np.ndarray, group: np.ndarray | None) -> NoiseModel:
        """The noise of the selected points: xyz (n, 3), rgb (n, 3) uint8, boxes (n,) of :meth:`pick`, group (n,) or None."""
        found = _neighbourhoods(xyz, rgb, boxes, group)
        return _model(self.low, self.high, *found) if len(found[0]) else no_noise()


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

    coloured = np.flatnonzero(rgb.any(axis=1))
    group = np.zeros(len(xyz), np.int64) if group is None else group
    order = coloured[np.lexsort((xyz[coloured, 0], group[coloured], boxes[coloured]))]
    xyz, boxes, group = xyz[order], boxes[order], group[order]
    luma = ((rgb[order] @ LUMA) / 255).astype(np.float32)
    new = np.ones(len(xyz), bool)
    new[1:] = (boxes[1:] != boxes[:-1]) | (group[1:] != group[:-1])
    starts = np.flatnonzero(new)
    number = np.cumsum(new) - 1
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
    near, far = np.zeros(len(xyz), np.float32), np.zeros(len(xyz), np.float32)
    residuals(local, luma, starts, near, far)
    looked = (np.arange(len(xyz)) - np.repeat(first, sizes)) % STRIDE == 0
    edges = np.append(0, np.cumsum(-(-sizes // STRIDE)))
    near, far = (_robust_variances(np.nan_to_num(r[looked]), edges) for r in (near, far))
    grows = np.maximum(far - near, 0)
    variance = np.maximum(near - _TEXTURE_RATIO * grows, 0)
    weight = np.minimum(sizes / BOX_POINTS, 2.0) / (1 + (grows / np.maximum(_TEXTURED * near, 1e-12)) ** 2)
    return centre, np.add.reduceat(luma, first) / sizes, variance, weight


def _robust_variances(values: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """(S,) variances of the segments of values, with values clipped at _CUT robust standard deviations."""
    sizes = np.diff(starts)
    number = np.repeat(np.arange(len(sizes)), sizes)
    square = values.astype(np.float64) ** 2
    ranked = square[np.lexsort((square, number))]
    middle = (ranked[starts[:-1] + (sizes - 1) // 2] + ranked[starts[:-1] + sizes // 2]) / 2
    limit = _CUT**2 * 1.4826**2 * middle
    return np.add.reduceat(np.minimum(square, limit[number]), starts[:-1]) / sizes / _CUT_VARIANCE


def _model(low, high, centre, luma, variance, weight) -> NoiseModel:
    """Fits lattice and curve to neighbourhoods: a coarse lattice and the curve alternately, then the fine lattice."""
    sigma, knots = np.sqrt(variance), np.linspace(0, 1, KNOTS)
    # as fine as the evidence allows: about four neighbourhoods per voxel of a surface
    finest = int(np.clip(np.ceil(np.log2(max(np.sqrt(len(sigma) / 4), 1))), 0, np.log2(MAX_VOXELS)))
    curve = np.ones(KNOTS)
    for _ in range(_BACKFITS):
        around = _Lattice(low, high, centre, sigma / np.interp(luma, knots, curve), weight, min(finest, _CURVE_LEVEL))
        curve = _curve(luma, sigma / np.maximum(around.values.reshape(-1)[around.voxels], 1e-9), weight)
    lattice = _Lattice(low, high, centre, sigma / np.interp(luma, knots, curve), weight, finest)
    known = lattice.evidence > 0
    overall = _quantile(lattice.values[known], lattice.evidence[known], 0.5)
    values = np.clip(_smoothed(lattice.values, lattice.evidence + 0.25), 0, _MAX_SIGMA)
    values = np.ascontiguousarray(values.transpose(2, 1, 0), np.float32)
    return NoiseModel(low, lattice.voxel, values, curve.astype(np.float32), overall, len(sigma))


class _Lattice:
    """Noise by position, estimated from coarse to fine: the coarser voxel's value is the prior of a finer one.

    finest: 2**finest voxels along the longest side.  values, evidence: (X, Y, Z), evidence in weighted neighbourhoods.
    voxels: (K,) voxel number of each neighbourhood.
    """

    def __init__(self, low, high, centre, sigma, weight, finest: int):
        extent = float((high - low).max())
        self.values = np.full((1, 1, 1), _quantile(sigma, weight))
        for level in range(finest + 1):
            self.voxel = extent / 2**level
            shape = np.maximum(np.ceil((high - low) / self.voxel - 1e-9), 1).astype(int)
            coarse = np.ix_(*(np.arange(side) // (2 if level else 1) for side in shape))
            values = self.values[coarse].reshape(-1)
            steps = np.clip(np.floor((centre - low) / self.voxel), 0, shape - 1).astype(int)
            self.voxels = np.asarray(np.ravel_multi_index(tuple(steps.T), tuple(shape)))
            here, estimate, found = _quantiles(self.voxels, sigma, weight)
            values[here] = (values[here] * _PRIOR + estimate * found) / (_PRIOR + found)
            evidence = np.zeros(len(values))
            evidence[here] = found
            self.values, self.evidence = values.reshape(shape), evidence.reshape(shape)


def _curve(luma, ratio, weight) -> np.ndarray:
    """(KNOTS,) noise factor by luma, mean 1.  luma, ratio: (K,) of the neighbourhoods; ratio: noise over that of their
    voxel."""
    place = np.clip(luma, 0, 1) * (KNOTS - 1)
    curve, evidence = np.ones(KNOTS), np.zeros(KNOTS)
    for knot in range(KNOTS):
        mine = weight * np.maximum(1 - np.abs(place - knot), 0)
        evidence[knot] = mine.sum()
        if evidence[knot] > 0:
            estimate = np.clip(_quantile(ratio, mine), *_CURVE_RANGE)
            curve[knot] = (estimate * evidence[knot] + _CURVE_PRIOR) / (evidence[knot] + _CURVE_PRIOR)
    sure = np.pad(evidence + 1e-6, 1)
    curve = np.convolve(np.pad(curve, 1) * sure, [0.25, 0.5, 0.25], "valid") / np.convolve(sure, [0.25, 0.5, 0.25], "valid")
    return np.clip(curve / np.average(curve, weights=evidence + 1e-9), *_CURVE_RANGE)


def _quantile(values: np.ndarray, weights: np.ndarray, share: float = _QUANTILE) -> float:
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order][min(np.searchsorted(total, share * total[-1]), len(values) - 1)])


def _quantiles(key: np.ndarray, values: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The distinct keys, the weighted _QUANTILE of each key's values, and the sum of its weights."""
    order = np.lexsort((values, key))
    key, values, weights = key[order], values[order], weights[order]
    here, first, number = np.unique(key, return_index=True, return_inverse=True)
    sums = np.add.reduceat(weights, first)
    total = np.cumsum(weights)
    before = (total[first] - weights[first])[number]
    reached = total - before >= _QUANTILE * sums[number] - 1e-12
    at = np.minimum.reduceat(np.where(reached, np.arange(len(key)), len(key) - 1), first)
    return here, values[at], sums


def _smoothed(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Values averaged over 3 x 3 x 3 voxels with a binomial kernel and weights."""
    sums, total = values * weights, weights
    for axis in range(3):
        sums, total = (_binomial(a, axis) for a in (sums, total))
    return sums / total


def _binomial(values: np.ndarray, axis: int) -> np.ndarray:
    """As scipy.ndimage.convolve1d with 1/4, 1/2, 1/4 and mode "nearest", to the bit; importing that takes 0.15 s."""
    padded = np.pad(values, [(1, 1) if k == axis else (0, 0) for k in range(values.ndim)], mode="edge")
    before, after = (np.take(padded, range(start, start + values.shape[axis]), axis) for start in (0, 2))
    return 0.5 * values + (before + after) * 0.25
