"""Compiled: M3C2 distances (Lague, Brodu and Leroux 2013) at core points.

Reference implementation: tests/unit/work/plain_distances.py, m3c2_distances.
"""

import math

import numpy as np

from ....model.common.jit import compiled
from .cell_search import cell_numbers, end_cell, first_cell, key_of, place_of
from .local_plane import FEWEST, plane_around

ENOUGH = 20
"""Points in a cylinder from which it is not widened (Lague et al. 2013: 20 and more for the level of detection)."""
LEAST = 5
"""Points in a cylinder, at least, where it is widest."""
WIDENINGS = 4
"""Widths that are tried, each twice the one before: 1, 2, 4 and 8 diameters.  A scanner's spacing grows with the range."""
LATERAL = 0.5
"""How far the middles of both clouds' points in a cylinder may lie apart across its axis, as a share of its radius.  At the
straight border of a surface they do by 0.42 (half a disc)."""
GAP = 4.0
"""Gap along the axis between two surfaces, in standard deviations; between 20 points of one normal surface a gap of 4 is met
once in 10,000 cylinders."""


@compiled(nogil=True)
def in_cylinder(x, y, z, nx, ny, nz, radius, depth, found, side, sizes, points, keys, first, table, blocks, block_first,
                block_table):  # fmt: skip
    """The points within ``radius`` of an axis and ``depth`` of its place.

    found: (m, 4) float64, filled with places along the axis and offsets across it.  Returns (found, count); ``found`` is
    another, longer array where they were too many.
    """
    count, wide = 0, 8 * side
    # half the extents of the cylinder along the file's axes
    hx = abs(nx) * depth + radius * math.sqrt(max(1.0 - nx * nx, 0.0))
    hy = abs(ny) * depth + radius * math.sqrt(max(1.0 - ny * ny, 0.0))
    hz = abs(nz) * depth + radius * math.sqrt(max(1.0 - nz * nz, 0.0))
    ball = radius + 0.8661 * side  # half the diagonal of a cell is sqrt(3) / 2 of its side
    ball_wide = radius + 0.8661 * wide
    for bx in range(first_cell(x - hx, wide), end_cell(x + hx, wide, (sizes[0] + 7) >> 3)):
        for by in range(first_cell(y - hy, wide), end_cell(y + hy, wide, (sizes[1] + 7) >> 3)):
            for bz in range(first_cell(z - hz, wide), end_cell(z + hz, wide, (sizes[2] + 7) >> 3)):
                dx, dy, dz = (bx + 0.5) * wide - x, (by + 0.5) * wide - y, (bz + 0.5) * wide - z
                along = dx * nx + dy * ny + dz * nz
                if dx * dx + dy * dy + dz * dz - along * along > ball_wide * ball_wide:
                    continue
                block = place_of(key_of(bx << 3, by << 3, bz << 3) >> 9, blocks, block_table)
                if block < 0:
                    continue
                for cell in range(block_first[block], block_first[block + 1]):
                    ix, iy, iz = cell_numbers(keys[cell])
                    dx, dy, dz = (ix + 0.5) * side - x, (iy + 0.5) * side - y, (iz + 0.5) * side - z
                    along = dx * nx + dy * ny + dz * nz
                    if dx * dx + dy * dy + dz * dz - along * along > ball * ball:
                        continue
                    for i in range(first[cell], first[cell + 1]):
                        dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
                        along = dx * nx + dy * ny + dz * nz
                        if abs(along) > depth:
                            continue
                        ux, uy, uz = dx - along * nx, dy - along * ny, dz - along * nz
                        if ux * ux + uy * uy + uz * uz > radius * radius:
                            continue
                        if count == found.shape[0]:
                            longer = np.empty((2 * count, 4))
                            longer[:count] = found
                            found = longer
                        found[count, 0], found[count, 1], found[count, 2], found[count, 3] = along, ux, uy, uz
                        count += 1
    return found, count


@compiled(nogil=True)
def run_around(along, begin, gap):
    """Ends of the run without gaps, among places (n,) that ascend, that holds the one nearest to ``begin``."""
    middle = 0
    for i in range(1, along.shape[0]):
        if abs(along[i] - begin) < abs(along[middle] - begin):
            middle = i
    low = high = middle
    while low > 0 and along[low] - along[low - 1] <= gap:
        low -= 1
    while high < along.shape[0] - 1 and along[high + 1] - along[high] <= gap:
        high += 1
    return along[low], along[high]


@compiled(nogil=True)
def between(found, count, low, high, result):
    """Of the points in a cylinder, found[:count], those from low to high along the axis.

    result: (6,) float64: number, mean along the axis, variance (n - 1), mean offset across it.
    """
    for k in range(6):
        result[k] = 0.0
    for i in range(count):
        if low <= found[i, 0] <= high:
            result[0] += 1
            result[1] += found[i, 0]
            for k in range(3):
                result[3 + k] += found[i, 1 + k]
    if result[0] == 0:
        return
    result[1] /= result[0]
    for k in range(3):
        result[3 + k] /= result[0]
    for i in range(count):
        if low <= found[i, 0] <= high:
            result[2] += (found[i, 0] - result[1]) ** 2
    result[2] = result[2] / (result[0] - 1) if result[0] > 1 else 0.0


@compiled(nogil=True)
def two_surfaces(found, count, beside, number, gap, one, other):
    """The surface of the cloud after at the core point, and its counterpart; ``other[0]`` is 0 where it has none.

    found[:count], beside[:number]: points of the clouds after and before in the cylinder.  one, other: results, as
    :func:`between`.  Where both clouds together have no gap between them, both surfaces are the points of that run, so that a
    rough surface is divided in both clouds alike.  Else the counterpart is the nearest run of the cloud before, unless that is
    nearer to another run of the cloud after.
    """
    after, before = np.sort(found[:count, 0]), np.sort(beside[:number, 0])
    nearest = after[np.argmin(np.abs(after))]
    low, high = run_around(np.sort(np.concatenate((after, before))), nearest, gap)
    between(found, count, low, high, one)
    between(beside, number, low, high, other)
    if other[0] >= LEAST:
        return
    low, high = run_around(before, one[1], gap)
    between(beside, number, low, high, other)
    low, high = run_around(after, other[1], gap)
    if (low > nearest or high < nearest) and np.sum((after >= low) & (after <= high)) >= LEAST:
        other[0] = 0.0


@compiled(nogil=True)
def quantile95(freedom):
    """Two-sided 95 % quantile of Student's t (expansion of Cornish and Fisher, right to 1 % from 3 degrees of freedom on)."""
    return 1.959964 + 2.372272 / freedom + 2.822499 / freedom**2 + 2.555850 / freedom**3


@compiled(nogil=True)
def m3c2_at(places, scale, diameter, depth, noise, after, before, distance, uncertainty, normals, counts, begin, end):
    """Results for the core points begin..end: distance along ``normals`` (n, 3), NaN without a counterpart; its level of
    detection at 95 % without a registration error; counts (n, 2) int32, points of both surfaces in the cylinder.

    places: (n, 3).  scale: diameter of the ball in which a normal is estimated.  diameter, depth: of the cylinder.
    noise: standard deviation, the larger one of both clouds.  after, before: ``Cells.search`` of both.
    """
    plane, one, other = np.empty((5, 3)), np.empty(6), np.empty(6)
    found, beside = np.empty((256, 4)), np.empty((256, 4))
    for i in range(begin, end):
        distance[i] = np.nan
        uncertainty[i] = np.nan
        counts[i, 0] = counts[i, 1] = 0
        for axis in range(3):
            normals[i, axis] = 0.0
        x, y, z = places[i, 0], places[i, 1], places[i, 2]
        count = 0
        for turn in range(WIDENINGS):
            count = plane_around(x, y, z, 0.5 * scale * 2**turn, plane, *after)
            if count >= ENOUGH:
                break
        if count < FEWEST:
            continue
        nx, ny, nz = plane[1, 0], plane[1, 1], plane[1, 2]
        normals[i, 0], normals[i, 1], normals[i, 2] = nx, ny, nz
        gap = GAP * max(noise, math.sqrt(plane[4, 0]))
        for turn in range(WIDENINGS):
            radius = 0.5 * diameter * 2**turn
            found, count = in_cylinder(x, y, z, nx, ny, nz, radius, depth, found, *after)
            if count < LEAST:
                continue
            beside, number = in_cylinder(x, y, z, nx, ny, nz, radius, depth, beside, *before)
            if number < LEAST:
                continue
            two_surfaces(found, count, beside, number, gap, one, other)
            few = min(one[0], other[0])
            if few < LEAST:
                continue
            apart = (one[3] - other[3]) ** 2 + (one[4] - other[4]) ** 2 + (one[5] - other[5]) ** 2
            if apart > (LATERAL * radius) ** 2:
                continue
            distance[i] = one[1] - other[1]
            a, b = one[2] / one[0], other[2] / other[0]
            freedom = few - 1.0
            if a + b > 0:
                freedom = (a + b) ** 2 / (a * a / (one[0] - 1) + b * b / (other[0] - 1))  # Welch and Satterthwaite
            uncertainty[i] = quantile95(freedom) * math.sqrt(a + b)
            counts[i, 0], counts[i, 1] = int(one[0]), int(other[0])
            if few >= ENOUGH:
                break
