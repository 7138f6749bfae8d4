"""Passes: a scanner goes over a place in runs, and a surface met by two runs should have one colour.

Many scans are merged from sweeps that were photographed apart - under another exposure, with a lamp's gloss seen from
another side - and nothing in the file says which point is whose.  Side by side in a wall they are salt and pepper.  But
points are still written in the order they were measured: a block of consecutive points belongs to one run, and points of
several blocks in one small voxel say how the blocks differ.  Every block gets a gain for each channel, found by alternating
least squares with Huber's weights over voxels and blocks, and between the middles of blocks gains are interpolated.

Blocks are as long as the runs allow, since short ones begin to follow what is printed on the walls: whole stations merged
without a name take thousands of points, single sweeps a few dozen.  Nothing is done where blocks explain little of what is
seen within voxels: a scan of one run, a file without order; nor where they differ in hue as exposures do not: a file
written material by material.
"""

from dataclasses import dataclass

import numpy as np

from model.common.jit import compiled
from model.data.spacing import median_spacing

BLOCKS = (8192, 2048, 512, 128, 32)  # points of the sample in a block, to choose from
FINER = 1.15  # shorter blocks are taken where each step leaves so much less of the variance
VOXEL_SPACINGS = 3.0  # edge of a voxel: what is not told apart is hardly larger than a point
LIFT = 8.0  # added to values before their logarithm: noise in the darks counts for little
TOLERANCE = 0.1  # of log values: beyond it a point is an outlier to its voxel, an edge or a mixed pixel
STAY = 4.0  # points that hold a block's gain at one
SETTLE, LOOK_ITERATIONS, ITERATIONS = 3, 5, 10
LOOK, LOOK_LEAST, LOOK_CELLS = 8, 100_000, 64
"""One region in LOOK is looked at first, regions LOOK_CELLS to the longest side; a sample below LOOK_LEAST wholly."""
WORTH = 0.7  # done where the variance within voxels falls to less than this: scans of one run end above 0.8
TINT = 0.35
"""Log of a channel's gain against the mean of the three, that 95 % of the blocks stay below where runs were photographed apart:
0.07 in a merged scan of a studio, 0.5 and more where leaves and bark, or squares of a colour chart, were written one by one."""
LEAST = 1000  # points that tell anything
_AXIS_BITS = 21  # of a voxel's number; a scan so wide against its spacing wraps around, which does no harm


@dataclass(frozen=True)
class Passes:
    """Gains of a scan's runs.  at (K,) float64: places in the file, rising.  factors (K, 3) float64: of lifted colours there.
    left: variance within voxels after, as a share of before; 1.0 where nothing could be told."""

    at: np.ndarray
    factors: np.ndarray
    left: float

    @property
    def worth(self) -> bool:
        """Whether the gains take away enough to be applied."""
        return self.left < WORTH

    def apply(self, rgb: np.ndarray, first: int) -> np.ndarray:
        """(n, 3) uint8: colours rgb (n, 3) uint8 of n consecutive points from place ``first`` on.  Black stays black."""
        changed = np.empty_like(rgb)
        _apply(np.ascontiguousarray(rgb), first, self.at, self.factors, changed)
        return changed


def solve_passes(xyz: np.ndarray, rgb: np.ndarray, at: np.ndarray) -> Passes:
    """Gains of a sample of coloured points.

    xyz: (N, 3) float64.  rgb: (N, 3) uint8, none black.  at: (N,) places in the file, in any order.
    """
    order = np.argsort(at, kind="stable")
    xyz, rgb, at = xyz[order], rgb[order], at[order].astype(np.float64)
    nothing = np.zeros(1), np.ones((1, 3))
    if len(at) < LEAST:
        return Passes(*nothing, 1.0)
    some = _regions(xyz)
    edge = VOXEL_SPACINGS * median_spacing(xyz[some])
    place = np.flatnonzero(some)
    look = _Sample(xyz[some], rgb[some], edge)
    left, _ = look.solve(place // BLOCKS[-1], LOOK_ITERATIONS)
    if left >= WORTH:  # no longer blocks explain more
        return Passes(*nothing, left)
    left = [look.solve(place // block, LOOK_ITERATIONS)[0] for block in BLOCKS[:-1]] + [left]
    block = BLOCKS[int(np.argmin(np.array(left) * FINER ** np.arange(len(BLOCKS))))]
    share, gains = _Sample(xyz, rgb, edge).solve(np.arange(len(at)) // block, ITERATIONS)
    if np.percentile(np.abs(gains - gains.mean(axis=1, keepdims=True)).max(axis=1), 95) > TINT:
        return Passes(*nothing, 1.0)
    starts = np.arange(0, len(at), block)
    return Passes(np.add.reduceat(at, starts) / np.diff(starts, append=len(at)), np.exp(-gains), share)


class _Sample:
    """Points with their voxels, to be explained by blocks of one length or another."""

    def __init__(self, xyz: np.ndarray, rgb: np.ndarray, edge: float):
        _, self._voxel = np.unique(_voxels(xyz, edge), return_inverse=True)
        self._log = np.log(rgb.astype(np.float32) + np.float32(LIFT))

    def solve(self, block: np.ndarray, iterations: int) -> tuple[float, np.ndarray]:
        """The variance left within voxels, as a share, and log gains (K, 3) of blocks (N,) numbered 0..K-1."""
        gains = np.zeros((int(block.max(initial=0)) + 1, 3))
        before, after = _alternate(self._log, self._voxel, block, int(self._voxel.max(initial=0)) + 1, gains, iterations)
        return float(after / before) if before > 0 else 1.0, gains


def _regions(xyz: np.ndarray) -> np.ndarray:
    """(N,) bool: the points of some regions, spread over the whole."""
    if len(xyz) < LOOK_LEAST:
        return np.ones(len(xyz), bool)
    mixed = _voxels(xyz, float(np.ptp(xyz, axis=0).max()) / LOOK_CELLS or 1.0).astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    some = (mixed >> np.uint64(40)) % np.uint64(LOOK) == 0
    return some if np.count_nonzero(some) * 4 * LOOK > len(xyz) else np.ones(len(xyz), bool)


def _voxels(xyz: np.ndarray, edge: float) -> np.ndarray:
    """(N,) int64: the number of each point's voxel."""
    key = np.zeros(len(xyz), np.int64)
    for axis in range(3):
        steps = np.floor((xyz[:, axis] - xyz[:, axis].min()) / edge)
        key = (key << _AXIS_BITS) | np.fmod(steps, 1 << _AXIS_BITS).astype(np.int64)
    return key


@compiled(nogil=True)
def _apply(rgb, first, at, factors, changed):
    k, last = 0, len(at) - 1
    for i in range(len(rgb)):
        place = first + i
        while k < last - 1 and at[k + 1] <= place:
            k += 1
        after = min(k + 1, last)
        gap = at[after] - at[k]
        t = min(max((place - at[k]) / gap, 0.0), 1.0) if gap > 0.0 else 0.0
        lit = rgb[i, 0] | rgb[i, 1] | rgb[i, 2]
        for c in range(3):
            factor = factors[k, c] + t * (factors[after, c] - factors[k, c])
            value = np.rint((rgb[i, c] + LIFT) * factor - LIFT)
            changed[i, c] = min(max(value, 1.0), 255.0) if lit else 0


@compiled(nogil=True)
def _alternate(log, voxel, block, voxels, gains, iterations):
    """Alternates between voxels' means and blocks' log gains (K, 3), which are written; the variance before and after.

    Only voxels that several blocks met count in the variance; it is Huber's: outliers weigh by their distance.
    """
    count, blocks = len(voxel), len(gains)
    weight = np.ones(count, np.float32)
    first, shared = np.full(voxels, -1, np.int64), np.zeros(voxels, np.bool_)
    for i in range(count):
        v = voxel[i]
        if first[v] < 0:
            first[v] = block[i]
        elif first[v] != block[i]:
            shared[v] = True
    means, sums = np.zeros((voxels, 3)), np.zeros(voxels)
    change, total = np.zeros((blocks, 3)), np.zeros(blocks)
    rest = np.zeros(3)
    before = after = 0.0
    for iteration in range(-SETTLE, iterations + 1):  # means and weights settle before gains move, or those have their credit
        means[:], sums[:], change[:], total[:], after = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(count):
            sums[voxel[i]] += weight[i]
            for c in range(3):
                means[voxel[i], c] += weight[i] * (log[i, c] - gains[block[i], c])
        for i in range(count):
            v, b = voxel[i], block[i]
            if not shared[v]:
                continue
            absolute = square = 0.0
            for c in range(3):
                rest[c] = log[i, c] - gains[b, c] - means[v, c] / sums[v]
                absolute += abs(rest[c]) / 3
                square += rest[c] * rest[c]
            weight[i] = min(TOLERANCE / max(absolute, 1e-9), 1.0)
            after += weight[i] * square
            total[b] += weight[i]
            for c in range(3):
                change[b, c] += weight[i] * rest[c]
        if iteration == 0:
            before = after
        if 0 <= iteration < iterations:
            for b in range(blocks):
                for c in range(3):
                    gains[b, c] += change[b, c] / (total[b] + STAY)
    return before, after
