"""Compiled loops of model.appearance.scan_runs: voxels of points, and the gains of blocks by alternating least squares."""

import numpy as np

from ..common.jit import compiled

HUBER_LIMIT = 0.1
"""Difference of log values beyond which a point counts as an outlier of its voxel, an edge or a mixed pixel.  With half the
runs of the same scans are not found, with twice they are, with the same error of the gains within 0.03 %."""
PRIOR_POINTS = 4.0
"""Weight, in points, of the prior that holds a block's gain at 1.  With half the error of the gains of the same scans is the
same, with twice the runs of one are not found."""
SETTLE_ITERATIONS = 3
"""Iterations before gains change.  One or six change the error of the gains of the same scans by at most 0.01 %."""
_AXIS_BITS = 21
"""Bits of a voxel's coordinate.  A scan wider than 2**21 voxels wraps around, which only merges distant voxels."""


def voxel_keys(xyz: np.ndarray, edge: float) -> np.ndarray:
    """(N,) int64: a number for the voxel of each point of xyz (N, 3) float64, the same for points of one voxel."""
    keys = np.empty(len(xyz), np.int64)
    low = np.array([xyz[:, axis].min() for axis in range(3)]) if len(xyz) else np.zeros(3)
    _fill_keys(np.asarray(xyz, np.float64), low, float(edge), keys)
    return keys


def numbered(keys: np.ndarray) -> np.ndarray:
    """(N,) int64 numbers from 0, equal where the keys (N,) int64 are, in the order in which these appear.  It does not sort, as
    np.unique does."""
    numbers = np.empty(len(keys), np.int64)
    _fill_numbers(keys, np.full(2 << max(len(keys), 1).bit_length(), -1, np.int64), numbers)
    return numbers


@compiled(nogil=True)
def _fill_keys(xyz, low, edge, keys):
    """keys: (n,) int64, receives the voxel of each point; ``low`` (3,) is the corner of voxel 0."""
    mask, largest = (1 << _AXIS_BITS) - 1, float(1 << 52)
    for i in range(xyz.shape[0]):
        key = np.int64(0)
        for axis in range(3):
            steps = np.floor((xyz[i, axis] - low[axis]) / edge)
            step = np.int64(steps) & mask if steps < largest else np.int64(np.fmod(steps, float(1 << _AXIS_BITS)))
            key = (key << _AXIS_BITS) | step
        keys[i] = key


@compiled(nogil=True)
def _fill_numbers(keys, table, numbers):
    """table: (2**k,) int64 of -1, more than twice as long as keys: receives where each different key was first seen."""
    mask, used = np.uint64(table.shape[0] - 1), 0
    for i in range(keys.shape[0]):
        slot = (np.uint64(keys[i]) * np.uint64(0x9E3779B97F4A7C15) >> np.uint64(20)) & mask
        while table[slot] >= 0 and keys[table[slot]] != keys[i]:
            slot = (slot + np.uint64(1)) & mask
        if table[slot] < 0:
            table[slot], numbers[i] = i, used
            used += 1
        else:
            numbers[i] = numbers[table[slot]]


@compiled(nogil=True)
def alternate(log, voxel, block, voxels, gains, iterations):
    """Alternates between the means of voxels and the log gains (K, 3) of blocks, which are written to ``gains``.

    log: (N, 3) float32.  voxel, block: (N,) int64 numbers; there are ``voxels`` voxels.
    Returns the variance before and after: with Huber weights, over the voxels that several blocks share.
    """
    blocks = len(gains)
    first, shared = np.full(voxels, -1, np.int64), np.full(voxels, -1, np.int64)
    found = 0
    for i in range(len(voxel)):
        v = voxel[i]
        if first[v] < 0:
            first[v] = block[i]
        elif first[v] != block[i] and shared[v] < 0:
            shared[v] = found
            found += 1
    # points of other voxels contribute nothing: the loops below are over those that remain
    count = 0
    for i in range(len(voxel)):
        count += shared[voxel[i]] >= 0
    values, voxel_of, block_of = np.empty((count, 3), np.float32), np.empty(count, np.int32), np.empty(count, np.int32)
    n = 0
    for i in range(len(voxel)):
        if shared[voxel[i]] >= 0:
            values[n, 0], values[n, 1], values[n, 2] = log[i, 0], log[i, 1], log[i, 2]
            voxel_of[n], block_of[n] = shared[voxel[i]], block[i]
            n += 1
    weight = np.ones(count, np.float32)
    means, change = np.zeros((found, 4)), np.zeros((blocks, 4))  # sums of three channels, and of weights: in one cache line
    rest = np.zeros(3)
    before = after = 0.0
    for iteration in range(-SETTLE_ITERATIONS, iterations + 1):  # means and weights settle first, or gains would get the credit
        means[:], change[:], after = 0.0, 0.0, 0.0
        for i in range(count):
            v, b = voxel_of[i], block_of[i]
            means[v, 3] += weight[i]
            for c in range(3):
                means[v, c] += weight[i] * (values[i, c] - gains[b, c])
        for v in range(found):
            for c in range(3):
                means[v, c] /= means[v, 3]
        for i in range(count):
            v, b = voxel_of[i], block_of[i]
            absolute = square = 0.0
            for c in range(3):
                rest[c] = values[i, c] - gains[b, c] - means[v, c]
                absolute += abs(rest[c]) / 3
                square += rest[c] * rest[c]
            weight[i] = min(HUBER_LIMIT / max(absolute, 1e-9), 1.0)
            after += weight[i] * square
            change[b, 3] += weight[i]
            for c in range(3):
                change[b, c] += weight[i] * rest[c]
        if iteration == 0:
            before = after
        if 0 <= iteration < iterations:
            for b in range(blocks):
                for c in range(3):
                    gains[b, c] += change[b, c] / (change[b, 3] + PRIOR_POINTS)
    return before, after
