"""Compiled loops of connected regions: points in cubes, cubes beside each other, and the growth from cube to cube.

A cube has a key of 21 bits an axis; occupied cubes are kept in ascending order of their keys.  Frame: relative to the lowest
corner of the cubes, file units.
"""

import numpy as np

from ....model.common.jit import compiled
from ..places.pick_kernels import place_in_cell
from ..point_moments import add_point

BITS = 21
LAST = (1 << BITS) - 1


@compiled(nogil=True)
def cube_keys(points, offsets, coords, size, shift, side, keys, base, first, last):
    """(N,) int64 ``keys`` of the points' cubes; those that are -1 stay.  shift: (3,) from the lowest corner to the grid's
    origin.  side: of a cube.  Runs as in select_kernels."""
    cells, step = coords.shape[0], size / 65536.0
    for run in range(base + first, base + last):
        cell = run % cells
        x0, y0, z0 = coords[cell, 0] * size + shift[0], coords[cell, 1] * size + shift[1], coords[cell, 2] * size + shift[2]
        for i in range(offsets[run], offsets[run + 1]):
            if keys[i] < 0:
                continue
            x, y, z = place_in_cell(points, i, step)
            a, b, c = np.int64((x0 + x) / side), np.int64((y0 + y) / side), np.int64((z0 + z) / side)
            keys[i] = (a << 2 * BITS) | (b << BITS) | c


@compiled(inline="always")
def _row_of(keys, key):
    """Row of a key in ascending ``keys``, -1 where it is not there."""
    low, high = 0, len(keys)
    while low < high:
        middle = (low + high) >> 1
        if keys[middle] < key:
            low = middle + 1
        else:
            high = middle
    return low if low < len(keys) and keys[low] == key else -1


@compiled(inline="always")
def _neighbour(keys, key, number):
    """Row of the cube beside another one.  number: 0 to 26, of the direction; 13: the cube itself."""
    a = (key >> 2 * BITS) + number // 9 - 1
    b = (key >> BITS & LAST) + number // 3 % 3 - 1
    c = (key & LAST) + number % 3 - 1
    if a < 0 or b < 0 or c < 0 or a > LAST or b > LAST or c > LAST:
        return -1
    return _row_of(keys, (a << 2 * BITS) | (b << BITS) | c)


@compiled(nogil=True)
def grown(keys, start, normals, flat, least):
    """(M,) bool: the cubes that are joined to cube ``start``.  normals: (M, 3) unit vectors and flat: (M,) bool, of surfaces
    that go on only with a cosine of at least ``least`` from cube to cube; (0, 3): whatever is beside is joined."""
    found = np.zeros(len(keys), np.bool_)
    queue = np.empty(len(keys), np.int64)
    queue[0], found[start], at, end = start, True, 0, 1
    while at < end:
        row = queue[at]
        at += 1
        for number in range(27):
            other = _neighbour(keys, keys[row], number)
            if other < 0 or found[other]:
                continue
            if len(normals) > 0:
                cosine = abs(normals[row, 0] * normals[other, 0] + normals[row, 1] * normals[other, 1]
                             + normals[row, 2] * normals[other, 2])
                if not (flat[other] and cosine >= least):
                    continue
            found[other], queue[end] = True, other
            end += 1
    return found


@compiled(nogil=True)
def add_moments(points, offsets, coords, size, shift, side, rows, moments, first, last):
    """Adds to (M, 10) float64 ``moments`` of cubes, relative to each cube's lowest corner (viewer.work.point_moments).
    rows: (N,) int64, cube of each point, -1: none.  Of the runs ``first`` to ``last``."""
    cells, step = coords.shape[0], size / 65536.0
    for run in range(first, last):
        cell = run % cells
        x0, y0, z0 = coords[cell, 0] * size + shift[0], coords[cell, 1] * size + shift[1], coords[cell, 2] * size + shift[2]
        for i in range(offsets[run], offsets[run + 1]):
            if rows[i] < 0:
                continue
            x, y, z = place_in_cell(points, i, step)
            x, y, z = (x0 + x) % side, (y0 + y) % side, (z0 + z) % side
            add_point(moments[rows[i]], x, y, z)


@compiled(nogil=True)
def around(keys, moments, side, out, first, last):
    """(M, 10) ``out``: the moments of each cube and its neighbours together, relative to the cube's lowest corner."""
    for row in range(first, last):
        for number in range(27):
            other = _neighbour(keys, keys[row], number)
            if other < 0:
                continue
            n, x, y, z = moments[other, 0], moments[other, 1], moments[other, 2], moments[other, 3]
            dx, dy, dz = (number // 9 - 1) * side, (number // 3 % 3 - 1) * side, (number % 3 - 1) * side
            out[row, 0] += n
            out[row, 1] += x + n * dx
            out[row, 2] += y + n * dy
            out[row, 3] += z + n * dz
            out[row, 4] += moments[other, 4] + 2 * dx * x + n * dx * dx
            out[row, 5] += moments[other, 5] + dx * y + dy * x + n * dx * dy
            out[row, 6] += moments[other, 6] + dx * z + dz * x + n * dx * dz
            out[row, 7] += moments[other, 7] + 2 * dy * y + n * dy * dy
            out[row, 8] += moments[other, 8] + dy * z + dz * y + n * dy * dz
            out[row, 9] += moments[other, 9] + 2 * dz * z + n * dz * dz


@compiled(nogil=True)
def widened(keys, nearest):
    """(M,) int64: ``nearest``, the row of the cube whose plane each cube shares, -1: none, for one more ring of cubes."""
    made = nearest.copy()
    for row in range(len(keys)):
        if nearest[row] >= 0:
            continue
        for number in (4, 10, 12, 14, 16, 22, 0, 1, 2, 3, 5, 6, 7, 8, 9, 11, 15, 17, 18, 19, 20, 21, 23, 24, 25, 26):
            other = _neighbour(keys, keys[row], number)
            if other >= 0 and nearest[other] >= 0:
                made[row] = nearest[other]
                break
    return made


@compiled(nogil=True)
def near_planes(points, offsets, coords, size, shift, rows, nearest, middles, normals, reach, hits, first, last):
    """Marks the points of cubes with a plane that lie near it.  nearest: (M,).  middles, normals: (M, 3).  reach: (M,).
    Of the runs ``first`` to ``last``."""
    cells, step = coords.shape[0], size / 65536.0
    for run in range(first, last):
        cell = run % cells
        x0, y0, z0 = coords[cell, 0] * size + shift[0], coords[cell, 1] * size + shift[1], coords[cell, 2] * size + shift[2]
        for i in range(offsets[run], offsets[run + 1]):
            if rows[i] < 0 or nearest[rows[i]] < 0:
                continue
            k = nearest[rows[i]]
            x, y, z = place_in_cell(points, i, step)
            away = ((x0 + x - middles[k, 0]) * normals[k, 0] + (y0 + y - middles[k, 1]) * normals[k, 1]
                    + (z0 + z - middles[k, 2]) * normals[k, 2])
            hits[i] = abs(away) <= reach[k]
