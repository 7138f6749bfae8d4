"""The noise of a scan by position and brightness, and its fit to that of small neighbourhoods (model.appearance.noise): a
coarse lattice and a curve alternately, then the fine lattice."""

from dataclasses import dataclass

import numpy as np

KNOTS = 9
"""Brightnesses, evenly spaced from 0 to 1, at which the noise curve is estimated.  With 5 or 17 the noise at the points of four
real scans changes by at most 4 % (median of a scan)."""
MAX_VOXELS = 64
"""Voxels of the lattice along its longest side, a power of two: twice as many as the neighbourhoods of BUDGET allow."""
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


def no_noise() -> NoiseModel:
    """The model of a scan without enough points for an estimate: 0 everywhere."""
    return NoiseModel(np.zeros(3), 1.0, np.zeros((1, 1, 1), np.float32), np.ones(KNOTS, np.float32), 0.0)


def fit_model(
    low: np.ndarray, high: np.ndarray, centre: np.ndarray, luma: np.ndarray, variance: np.ndarray, weight: np.ndarray
) -> NoiseModel:
    """The model of neighbourhoods: centre (K, 3) float64, luma (K,), variance (K,) of a point's luma, weight (K,).  low, high:
    (3,) corners of the lattice."""
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
