"""Compiled: the plane through the points around a place, by principal components.

Frame: as viewer.work.comparing.point_cells.  Reference implementation: tests/unit/work/plain_distances.py, plane_of.
"""

import math

import numpy as np

from ....model.common.jit import compiled
from .cell_search import box_distance, end_cell, first_cell, key_of, place_of

FEWEST = 6
"""Points of a plane, at least: three are its parameters, and as many tell the scatter."""
_SWEEPS = 12
"""Of Jacobi's rotations at most; symmetric 3 x 3 matrices need 3 to 6 for all digits."""


@compiled(nogil=True)
def principal_axes(matrix, axes):
    """Diagonalises a symmetric (3, 3) matrix in place by Jacobi's rotations; axes: (3, 3), result, eigenvectors as columns."""
    for i in range(3):
        for j in range(3):
            axes[i, j] = 1.0 if i == j else 0.0
    for _ in range(_SWEEPS):
        off = matrix[0, 1] ** 2 + matrix[0, 2] ** 2 + matrix[1, 2] ** 2
        if off <= 1e-30 * (matrix[0, 0] ** 2 + matrix[1, 1] ** 2 + matrix[2, 2] ** 2):
            return
        for p in range(2):
            for q in range(p + 1, 3):
                if matrix[p, q] == 0.0:
                    continue
                ratio = (matrix[q, q] - matrix[p, p]) / (2.0 * matrix[p, q])
                t = math.copysign(1.0, ratio) / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
                c = 1.0 / math.sqrt(t * t + 1.0)
                s = t * c
                for k in range(3):
                    a, b = matrix[k, p], matrix[k, q]
                    matrix[k, p], matrix[k, q] = c * a - s * b, s * a + c * b
                for k in range(3):
                    a, b = matrix[p, k], matrix[q, k]
                    matrix[p, k], matrix[q, k] = c * a - s * b, s * a + c * b
                for k in range(3):
                    a, b = axes[k, p], axes[k, q]
                    axes[k, p], axes[k, q] = c * a - s * b, s * a + c * b


@compiled(nogil=True)
def plane_around(x, y, z, radius, plane, side, sizes, points, keys, first, table, blocks, block_first, block_table):
    """The plane through the points within ``radius`` of a place.  Returns how many there are.

    plane: (5, 3) float64, result where they are FEWEST or more: their middle; unit normal; the two axes in the plane; variances
    along normal and both axes, the first about the plane (n - 3 degrees of freedom), the others about the middle (n).
    side ... block_table: ``Cells.search``; blocks are not used.
    """
    count = 0
    sx = sy = sz = xx = xy = xz = yy = yz = zz = 0.0
    limit = radius * radius
    for ix in range(first_cell(x - radius, side), end_cell(x + radius, side, sizes[0])):
        for iy in range(first_cell(y - radius, side), end_cell(y + radius, side, sizes[1])):
            for iz in range(first_cell(z - radius, side), end_cell(z + radius, side, sizes[2])):
                if box_distance(x, y, z, ix * side, iy * side, iz * side, side) > limit:
                    continue
                cell = place_of(key_of(ix, iy, iz), keys, table)
                if cell < 0:
                    continue
                for i in range(first[cell], first[cell + 1]):
                    dx, dy, dz = points[i, 0] - x, points[i, 1] - y, points[i, 2] - z
                    if dx * dx + dy * dy + dz * dz <= limit:
                        count += 1
                        sx += dx
                        sy += dy
                        sz += dz
                        xx += dx * dx
                        xy += dx * dy
                        xz += dx * dz
                        yy += dy * dy
                        yz += dy * dz
                        zz += dz * dz
    if count < FEWEST:
        return count
    mx, my, mz = sx / count, sy / count, sz / count
    matrix, axes = np.empty((3, 3)), np.empty((3, 3))
    matrix[0, 0], matrix[1, 1], matrix[2, 2] = xx / count - mx * mx, yy / count - my * my, zz / count - mz * mz
    matrix[0, 1] = matrix[1, 0] = xy / count - mx * my
    matrix[0, 2] = matrix[2, 0] = xz / count - mx * mz
    matrix[1, 2] = matrix[2, 1] = yz / count - my * mz
    principal_axes(matrix, axes)
    least = 0
    for k in range(1, 3):
        if matrix[k, k] < matrix[least, least]:
            least = k
    plane[0, 0], plane[0, 1], plane[0, 2] = x + mx, y + my, z + mz
    plane[4, 0] = max(matrix[least, least], 0.0) * count / (count - 3)
    row = 2
    for k in range(3):
        if k == least:
            for axis in range(3):
                plane[1, axis] = axes[axis, k]
        else:
            for axis in range(3):
                plane[row, axis] = axes[axis, k]
            plane[4, row - 1] = max(matrix[k, k], 1e-300)
            row += 1
    return count
