"""Noise from pairs of points of two stations, as their distance goes to zero.

Within a station the smallest distance between points is their spacing, so texture finer than that looks like noise.  Points of
two stations lie anywhere between each other: the variance of their difference at distance zero (the nugget of a variogram:
Cressie 1993) has no texture in it.  It still holds what two stations see differently (registration, gloss), so it is an upper
bound of the noise as well, and the smaller of the two estimates is taken.

Few pairs are that near, so neighbourhoods of similar variance share them: the variance of the difference, relative to that of
their neighbourhood, is extrapolated from the two smallest distances that hold enough pairs.
"""

import numpy as np

from .noise_kernels import nearest_of_others

_EDGES = np.array([0.0, 0.02, 0.04, 0.08, 0.16, 0.32, 0.6])
"""Distances, in point spacings of the neighbourhood, between which pairs are counted together: in random places 0.1, 0.4, 1.5,
6, 22 and 39 % of the points have their nearest counterpart there."""
_ENOUGH = 60
"""Pairs for a variance within 18 %."""
_STRATUM = 40_000
"""Pairs that neighbourhoods of similar variance share: 0.5 % of them, 200, are below _EDGES[2]."""
_MOST_STRATA = 4
_LINEAR = 0.1
"""Spacings: where the nearest pairs are farther apart, the variance is taken to grow linearly with distance, which leaves more
to texture; where they are nearer, with its square, as that of any texture does at last."""
_CUT, _CUT_VARIANCE = 3.0, 0.9950  # as in model.appearance.noise


def pair_variances(
    local: np.ndarray, luma: np.ndarray, starts: np.ndarray, boxes: np.ndarray, reach: np.ndarray, variance: np.ndarray
) -> np.ndarray:
    """(S,) the variance of a point's luma in each segment by pairs of two stations; inf where it has no or too few of them.

    local: (n, 3) float32, relative to a place near the segment's box.  luma: (n,) float32.  starts: (S + 1,) of segments, the
    points of one station in one box, ascending in x; those of one box follow each other.  boxes: (S,) identifiers.  reach:
    (n,) float32, squared spacing around one point in STRIDE, else 0.  variance: (S,) within the station, from its nearest
    neighbours.
    """
    found = np.full(len(boxes), np.inf)
    change = np.flatnonzero(np.diff(boxes)) + 1
    begins, ends = np.append(0, change), np.append(change, len(boxes))
    if (ends - begins).max(initial=0) < 2:
        return found
    number = np.repeat(np.arange(len(begins)), ends - begins)
    distance, difference = np.full(len(local), np.inf, np.float32), np.zeros(len(local), np.float32)
    nearest_of_others(local, luma, starts, begins[number], ends[number], distance, difference)
    segment = np.repeat(np.arange(len(boxes)), np.diff(starts))
    sums = np.add.reduceat(reach.astype(np.float64), starts[:-1])
    counted = np.maximum(np.add.reduceat((reach > 0).astype(np.int64), starts[:-1]), 1)
    spacing = np.sqrt(sums / counted)
    apart = np.sqrt(distance) / np.maximum(spacing, 1e-30)[segment]
    copies = (distance == 0) & (difference == 0)  # a point that stands in two files says nothing
    usable = (apart < _EDGES[-1]) & ~copies & (variance > 0)[segment]
    rows = np.flatnonzero(usable)
    if len(rows) == 0:
        return found
    centred = difference[rows].astype(np.float64)
    centred -= _medians(segment[rows], centred, len(boxes))[segment[rows]]
    relative = centred**2 / 2 / variance[segment[rows]]
    held = np.bincount(segment[rows], minlength=len(boxes)) > 0
    order = np.flatnonzero(held)[np.argsort(variance[held], kind="stable")]
    strata = int(np.clip(len(rows) // _STRATUM, 1, _MOST_STRATA))
    stratum = np.full(len(boxes), -1)
    stratum[order] = np.arange(len(order)) * strata // len(order)
    for k in range(strata):
        mine = stratum[segment[rows]] == k
        share = _nugget(apart[rows][mine], relative[mine])
        found[stratum == k] = share * variance[stratum == k]
    return found


def _nugget(apart: np.ndarray, square: np.ndarray) -> float:
    """Mean of ``square`` (n,) as the distance ``apart`` (n,) goes to zero, at least 0; inf with too few pairs."""
    order = np.argsort(apart, kind="stable")
    apart, square = apart[order], square[order]
    limits = np.searchsorted(apart, _EDGES)
    at, level, begin = [], [], 0
    for end in limits[1:]:
        if end - begin >= _ENOUGH:
            at.append(slice(begin, end))
            level.append(_robust_mean(square[begin:end]))
            begin = end
        if len(at) == 2:
            break
    if len(at) < 2:
        return np.inf
    power = 1.0 if apart[at[0]].mean() > _LINEAR else 2.0
    near, far = ((apart[rows].astype(np.float64) ** power).mean() for rows in at)
    return max(level[0] - near * max(level[1] - level[0], 0.0) / (far - near), 0.0)


def _robust_mean(square: np.ndarray) -> float:
    """Of squares of normally distributed values, those beyond _CUT robust standard deviations clipped."""
    return float(np.minimum(square, _CUT**2 * 1.4826**2 * np.median(square)).mean()) / _CUT_VARIANCE


def _medians(key: np.ndarray, values: np.ndarray, count: int) -> np.ndarray:
    """(count,) the median of the values of each key, 0 where it has none.  key: (n,) ascending, below ``count``."""
    ranked = values[np.lexsort((values, key))]
    sizes = np.bincount(key, minlength=count)
    starts = np.cumsum(sizes) - sizes
    last = max(len(ranked) - 1, 0)
    low, high = (ranked[np.minimum(starts + at, last)] for at in (np.maximum(sizes - 1, 0) // 2, sizes // 2))
    return np.where(sizes > 0, (low + high) / 2, 0.0)
