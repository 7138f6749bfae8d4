"""Exposure compensation between scanner stations: gains that make the stations agree on the surfaces that they share.

Gains act on sRGB values: a factor in linear light is nearly a factor there too, because sRGB is nearly a power law, and dark
colours, where it is not, have little weight.  The true brightness is unknown, so the stations' mean gain is held at 1.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .spacing import median_spacing

DARKEST, BRIGHTEST = 20, 240
"""sRGB values between which neither noise nor clipping dominates.  On four real scans, each cut into two stations that
overlap and differ by 12 %, the largest error of the ratio is 0.3 %; with 10, 40, 225 or 255 it is 0.3 to 0.4 %."""
VOXEL_SPACINGS = 6.0
"""Side of a voxel in point spacings.  The same error is 0.2 % with half, and 0.8 % with twice as much."""
SHARED_VOXELS = 300
"""Fewest voxels shared by two stations for an estimate: the median of so many ratios has a standard error of at most
1.25 * LARGEST_SPREAD / sqrt(300), 2.5 %."""
_REACH = 1 << 17
"""Largest distance from the median position, in voxels.  Points beyond are outliers, and voxel numbers must fit 64 bits."""
LARGEST_GAIN = 1.6
"""Ratio beyond which two stations differ in more than exposure.  1.3 and 2.2 give the same gains of four real scans that were
divided into three stations with gains up to 17 % apart."""
LARGEST_SPREAD = 0.35
"""Largest standard deviation of a pair's log ratios (1.48 x median absolute deviation).  Half and twice give the same gains of
these scans."""
_MAX_PAIR_VOXELS = 20_000
"""Shared voxels beyond which a pair's weight grows no further.  Pairs of these scans share 800 to 6,700, so that half and twice
change nothing.  1,000 changes the largest error of a gain from 0.6 to 0.5 % in one and from 0.07 to 0.14 % in another."""
_DENSE = 256
"""Scans up to which all pairs are looked at and solved by a dense solver."""
_MIN_SPREAD = 0.01
"""Smallest standard deviation in a pair's weight: a guard of the division.  Half and twice give the same gains of these
scans."""


@dataclass(frozen=True)
class Exposures:
    """Solved gains.

    gains: (S, 3), factors of each scan's sRGB values.  shared: (S, S), number of voxels that two scans share.  matched: (S,)
    bool, False where a scan shares too little with the others or differs in more than exposure.
    """

    gains: np.ndarray
    shared: np.ndarray
    matched: np.ndarray


def solve_exposures(xyz: np.ndarray, rgb: np.ndarray, scan: np.ndarray, spacing: float) -> Exposures:
    """Gains that make the scans agree where they overlap, by least squares over all pairs.

    xyz: (N, 3) float64.  rgb: (N, 3) uint8.  scan: (N,) ints from 0.  spacing: point spacing of these points, same unit.  Each
    pair contributes the median log ratio of the mean colours in its shared voxels.  Scans without a usable pair keep gain 1.
    """
    scan = scan.astype(np.int64)
    count = int(scan.max(initial=-1)) + 1
    gains, shared = np.ones((count, 3)), np.zeros((count, count), np.int32)
    if len(xyz):
        near = (np.abs(xyz - np.median(xyz, axis=0)) <= _REACH * VOXEL_SPACINGS * spacing).all(axis=1)
        if not near.all():
            xyz, rgb, scan = xyz[near], rgb[near], scan[near]
    low = xyz.min(0) if len(xyz) else 0.0
    steps = np.floor((xyz - low) / (VOXEL_SPACINGS * spacing)).astype(np.int64)
    means, voxels, owners = _voxel_means(steps, rgb, scan, count)
    order = np.argsort(owners, kind="stable")  # voxels ascend within a scan
    own = [StationVoxels(voxels[mine], means[mine])
           for mine in np.split(order, np.searchsorted(owners[order], np.arange(1, count)))]
    pairs = _overlapping(voxels, owners, count)
    gains, matched, both = _solved(own, pairs)
    for (a, b), number in zip(pairs, both):
        shared[a, b] = shared[b, a] = number
    return Exposures(gains, shared, matched)


@dataclass(frozen=True, eq=False)
class StationVoxels:
    """What exposures are compared by.  voxels: (M,) int64 numbers of the voxels with points of one station, ascending, each
    once; the same number is the same voxel for all stations.  means: (M, 3) mean sRGB values in them."""

    voxels: np.ndarray
    means: np.ndarray


def solve_stations(stations: Sequence[StationVoxels]) -> tuple[np.ndarray, np.ndarray]:
    """Gains (S, 3) as of :func:`solve_exposures`, and which stations could be matched, (S,) bool.

    What a station contributes is in its own voxels: those of others may be kept, and the result is the same."""
    count = len(stations)
    voxels = np.concatenate([one.voxels for one in stations] or [np.zeros(0, np.int64)])
    owners = np.repeat(np.arange(count), [len(one.voxels) for one in stations])
    gains, matched, _ = _solved(stations, _sharing(voxels, owners, count))
    return gains, matched


def _solved(own: Sequence[StationVoxels], pairs: list[tuple[int, int]]) -> tuple[np.ndarray, np.ndarray, list[int]]:
    """Gains (S, 3), matched (S,) bool, and the number of usable voxels that each pair shares."""
    count = len(own)
    links, weights, ratios, both = [], [], [], []
    for a, b in pairs:
        ia, ib = _common(own[a].voxels, own[b].voxels)
        first, second = own[a].means[ia], own[b].means[ib]
        usable = np.minimum(first, second).min(1, initial=255) > DARKEST
        usable &= np.maximum(first, second).max(1, initial=0) < BRIGHTEST
        both.append(int(usable.sum()))
        if both[-1] < SHARED_VOXELS:
            continue
        log = np.log(second[usable] / first[usable])
        middle = np.median(log, 0)
        spread = 1.4826 * np.median(np.abs(log - middle), 0).max()
        if spread > LARGEST_SPREAD or np.abs(middle).max() > np.log(LARGEST_GAIN):
            continue
        links.append((a, b))
        ratios.append(middle)
        weights.append(np.sqrt(min(both[-1], _MAX_PAIR_VOXELS)) / max(spread, _MIN_SPREAD))
    gains, matched = np.ones((count, 3)), np.zeros(count, bool)
    if links:
        linked = np.array(links)
        solved = (_dense if count <= _DENSE else _sparse)(linked, np.array(ratios), np.array(weights)[:, None], count)
        matched[linked.reshape(-1)] = True
        gains[matched] = np.exp(solved[matched])
        for group in _groups(linked, matched):
            gains[group] *= np.mean(1 / gains[group], axis=0)  # the mean of the stations' own gains, 1 / gains, is then 1
    return gains, matched, both


def _common(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where two ascending arrays without repeats have the same values, in both."""
    if not len(a) or not len(b):
        return np.zeros(0, np.int64), np.zeros(0, np.int64)
    at = np.minimum(np.searchsorted(b, a), len(b) - 1)
    equal = b[at] == a
    return np.flatnonzero(equal), at[equal]


def _overlapping(voxels: np.ndarray, owners: np.ndarray, count: int) -> list[tuple[int, int]]:
    """The pairs a < b of scans that may share SHARED_VOXELS voxels: of few scans all; of many those that share so many."""
    if count <= _DENSE:
        return [(a, b) for a in range(count) for b in range(a + 1, count)]
    return _sharing(voxels, owners, count)


def _sharing(voxels: np.ndarray, owners: np.ndarray, count: int) -> list[tuple[int, int]]:
    """The pairs a < b of scans that share at least SHARED_VOXELS voxels."""
    from scipy.sparse import csr_matrix

    _, voxel = np.unique(voxels, return_inverse=True)
    held = csr_matrix((np.ones(len(owners), np.int32), (owners, voxel)), shape=(count, int(voxel.max(initial=-1)) + 1))
    both = (held @ held.T).tocoo()
    wanted = (both.row < both.col) & (both.data >= SHARED_VOXELS)
    return sorted(zip(both.row[wanted].tolist(), both.col[wanted].tolist()))


def _dense(pairs: np.ndarray, ratios: np.ndarray, weight: np.ndarray, count: int) -> np.ndarray:
    """(count, 3) log gains: log gain_a - log gain_b = log(colour_b / colour_a) in each of ``pairs`` (P, 2), ``ratios`` (P, 3).

    The minimum-norm solution of least squares with ``weight`` (P, 1) has mean zero in each linked group."""
    links = np.zeros((len(pairs), count))
    links[np.arange(len(pairs)), pairs[:, 0]], links[np.arange(len(pairs)), pairs[:, 1]] = 1.0, -1.0
    return np.linalg.lstsq(links * weight, ratios * weight, rcond=None)[0]


def _sparse(pairs: np.ndarray, ratios: np.ndarray, weight: np.ndarray, count: int) -> np.ndarray:
    """As :func:`_dense`, in memory and time in proportion to the pairs."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.linalg import lsqr

    rows = np.repeat(np.arange(len(pairs)), 2)
    links = csr_matrix(((np.tile([1.0, -1.0], len(pairs)) * np.repeat(weight[:, 0], 2)), (rows, pairs.reshape(-1))),
                       shape=(len(pairs), count))
    wanted = (ratios * weight).T
    return np.stack([lsqr(links, channel, atol=1e-12, btol=1e-12, iter_lim=20 * count)[0] for channel in wanted], axis=1)


def _groups(pairs: np.ndarray, matched: np.ndarray) -> list[np.ndarray]:
    """The connected sets of scans, as index arrays."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    count = len(matched)
    linked = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(count, count))
    _, label = connected_components(linked, directed=False)
    return [np.flatnonzero(label == k) for k in np.unique(label[matched])]


def _voxel_means(steps: np.ndarray, rgb: np.ndarray, scan: np.ndarray, count: int):
    """Mean colour of each scan in each voxel: means (M, 3), voxel numbers (M,), scans (M,)."""
    if not len(steps):
        return np.zeros((0, 3)), np.zeros(0, np.int64), np.zeros(0, int)
    spans = steps.max(0) + 1
    key = ((steps[:, 0] * spans[1] + steps[:, 1]) * spans[2] + steps[:, 2]) * count + scan
    unique, index, number = np.unique(key, return_inverse=True, return_counts=True)
    means = np.stack([np.bincount(index, rgb[:, c], len(unique)) for c in range(3)], 1) / number[:, None]
    return means, unique // count, unique % count


def match_exposures(xyz: np.ndarray, rgb: np.ndarray, scan: np.ndarray, sample: int = 2_000_000) -> np.ndarray:
    """(N, 3) uint8 colours with the gains of :func:`solve_exposures` applied; solved on a seeded sample of the points."""
    gains = exposures_of(xyz, rgb, scan, sample).gains
    return np.clip(np.rint(rgb * gains.astype(np.float32)[scan]), 0, 255).astype(np.uint8)


def exposures_of(xyz: np.ndarray, rgb: np.ndarray, scan: np.ndarray, sample: int = 2_000_000) -> Exposures:
    """:func:`solve_exposures` on a seeded sample of the points, with the sample's point spacing."""
    pick = np.random.default_rng(0).choice(len(xyz), min(len(xyz), sample), replace=False)
    some = xyz.take(pick, axis=0)  # a third of the time of xyz[pick]
    return solve_exposures(some, rgb.take(pick, axis=0), scan[pick], median_spacing(some))
