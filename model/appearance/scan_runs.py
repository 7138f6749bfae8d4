"""Exposure compensation between the runs of a merged scan whose runs are not named in the file.

Many scans are merged from sweeps that were photographed separately, under different exposures or with gloss seen from another
side, and the file does not store which point belongs to which sweep.  Side by side on a wall they look like salt and pepper
noise.  Points are still written in the order of measurement, however: a block of consecutive points belongs to one run, and the
points of several blocks in a small voxel show how the blocks differ.  Each block gets a gain for each channel, solved by
alternating least squares with Huber weights over voxels and blocks; between the centres of blocks gains are interpolated.

Blocks are as long as the runs allow, because short blocks begin to fit the texture of the surfaces: stations merged without a
name take thousands of points, single sweeps a few dozen.  Nothing is changed where blocks explain little of the variance within
voxels (a scan of one run, a file without order), or where they differ in hue as exposures do not (a file written by material).
"""

from dataclasses import dataclass

import numpy as np

from ..common.jit import compiled
from .scan_run_kernels import alternate, numbered, voxel_keys
from .spacing import median_spacing

BLOCKS = (8192, 2048, 512, 128, 32)
"""Block lengths to choose from, in points of the sample."""
FINER_GAIN = 1.15
"""Factor by which each shorter block length must reduce the variance to be chosen.  Two real scans with runs of random gain,
which deviate by 10 %: with 1.3 no runs are found, with 1.08 the error of the gains in one rises from 1.6 to 1.8 %."""
VOXEL_SPACINGS = 3.0
"""Side of a voxel in point spacings: its points are at about the same place.  With half the error of the gains of the same
scans changes by at most 0.1 %, with twice the runs of one are not found."""
LOG_OFFSET = 8.0
"""Added to sRGB values before their logarithm, so that noise in dark colours has little influence.  Half or twice changes the
error of the gains of the same scans by at most 0.5 %."""
PREVIEW_ITERATIONS, ITERATIONS = 5, 10
"""Iterations of the preview that chooses a block length, and of the final solution.  With two of the preview the runs of one of
the same scans are not found, with ten the result is the same; half or twice of the final ones changes the error by at most
0.3 %."""
PREVIEW_SHARE, PREVIEW_ALL_BELOW, PREVIEW_CELLS = 8, 100_000, 64
"""The preview uses one region in PREVIEW_SHARE, with PREVIEW_CELLS regions along the longest side; samples of fewer than
PREVIEW_ALL_BELOW points are used completely."""
MAX_REMAINING = 0.7
"""Gains are applied where the variance within voxels falls below this share: scans of one run stay above 0.8."""
MAX_TINT = 0.35
"""Limit of the log of a channel's gain relative to the mean of the three, for 95 % of the blocks where runs differ in exposure:
0.07 in a merged scan of a studio, 0.5 and more where leaves and bark, or squares of a colour chart, were written separately."""
MIN_POINTS = 1000
"""Fewest points for an estimate: a standard deviation of so many has a standard error of 1 / sqrt(2000), 2 %."""


@dataclass(frozen=True)
class RunGains:
    """Gains of a scan's runs.

    at: (K,) float64, positions in the file (point numbers), ascending.  factors: (K, 3) float64, gains there, of colours plus
    LOG_OFFSET.  remaining: variance within voxels after compensation as a share of before; 1.0 without an estimate.
    """

    at: np.ndarray
    factors: np.ndarray
    remaining: float

    @property
    def worthwhile(self) -> bool:
        """Whether the gains reduce the variance enough to be applied."""
        return self.remaining < MAX_REMAINING

    def apply(self, rgb: np.ndarray, first: int) -> np.ndarray:
        """(n, 3) uint8: compensated colours of rgb (n, 3) uint8, n consecutive points from number ``first`` on.  Black stays
        black."""
        changed = np.empty_like(rgb)
        _apply(np.ascontiguousarray(rgb), first, self.at, self.factors, changed)
        return changed


def solve_run_gains(xyz: np.ndarray, rgb: np.ndarray, at: np.ndarray) -> RunGains:
    """Gains solved on a sample of coloured points.

    xyz: (N, 3) float64.  rgb: (N, 3) uint8, none black.  at: (N,) positions in the file, in any order.
    """
    order = np.argsort(at)  # all differ: any way of sorting gives the same order
    at = at[order].astype(np.float64)
    nothing = np.zeros(1), np.ones((1, 3))
    if len(at) < MIN_POINTS:
        return RunGains(*nothing, 1.0)
    place = np.flatnonzero(_regions(xyz)[order])
    some = order[place]
    edge = VOXEL_SPACINGS * median_spacing(near := xyz.take(some, axis=0))  # a third of the time of xyz[some]
    look = _Sample(near, rgb.take(some, axis=0), edge)
    left, _ = look.solve(place // BLOCKS[-1], PREVIEW_ITERATIONS)
    if left >= MAX_REMAINING:  # longer blocks explain no more
        return RunGains(*nothing, left)
    left = [look.solve(place // block, PREVIEW_ITERATIONS)[0] for block in BLOCKS[:-1]] + [left]
    block = BLOCKS[int(np.argmin(np.array(left) * FINER_GAIN ** np.arange(len(BLOCKS))))]
    share, gains = _Sample(xyz[order], rgb[order], edge).solve(np.arange(len(at)) // block, ITERATIONS)
    if np.percentile(np.abs(gains - gains.mean(axis=1, keepdims=True)).max(axis=1), 95) > MAX_TINT:
        return RunGains(*nothing, 1.0)
    starts = np.arange(0, len(at), block)
    return RunGains(np.add.reduceat(at, starts) / np.diff(starts, append=len(at)), np.exp(-gains), share)


class _Sample:
    """Points with their voxels, for solutions with different block lengths."""

    def __init__(self, xyz: np.ndarray, rgb: np.ndarray, edge: float):
        self._voxel = numbered(voxel_keys(xyz, edge))
        self._log = np.log(rgb.astype(np.float32) + np.float32(LOG_OFFSET))

    def solve(self, block: np.ndarray, iterations: int) -> tuple[float, np.ndarray]:
        """Share of the variance within voxels that remains, and log gains (K, 3).  block: (N,) block numbers 0..K-1."""
        gains = np.zeros((int(block.max(initial=0)) + 1, 3))
        before, after = alternate(self._log, self._voxel, block, int(self._voxel.max(initial=0)) + 1, gains, iterations)
        return float(after / before) if before > 0 else 1.0, gains


def _regions(xyz: np.ndarray) -> np.ndarray:
    """(N,) bool: the points of random regions of the scan, for the preview."""
    if len(xyz) < PREVIEW_ALL_BELOW:
        return np.ones(len(xyz), bool)
    edge = max(float(np.ptp(xyz[:, axis])) for axis in range(3)) / PREVIEW_CELLS or 1.0
    mixed = voxel_keys(xyz, edge).view(np.uint64) * np.uint64(0x9E3779B97F4A7C15)
    some = (mixed >> np.uint64(40)) % np.uint64(PREVIEW_SHARE) == 0
    return some if np.count_nonzero(some) * 4 * PREVIEW_SHARE > len(xyz) else np.ones(len(xyz), bool)


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
            value = np.rint((rgb[i, c] + LOG_OFFSET) * factor - LOG_OFFSET)
            changed[i, c] = min(max(value, 1.0), 255.0) if lit else 0
