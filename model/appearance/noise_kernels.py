"""Compiled loops of model.appearance.noise: sampling of neighbourhoods, and residuals of points from their neighbours."""

import numpy as np

from ..common.jit import compiled

NEAR, FAR = 7, 20
"""Neighbours that predict a point, at two scales: texture makes the far prediction worse, noise does not.  Chosen by hand."""
_RIDGE = 0.02
"""Regularisation, as a share of the neighbours' mean squared distance: no slope is fitted along a direction in which the
surface is thinner.  Half or twice changes the noise of four real scans as a whole by at most 4 %."""
_AGAIN = 1.3
"""Squared distance within which neighbours are searched first, by that of the FAR-th neighbour of the point before: 1.5 takes
the same time within 5 %, 2 a third more."""
_LANES = 32
"""Distances that one step of a compiled loop compares, a multiple of any vector's: lists are padded to a multiple of it."""
_ROWS = 64
"""Points whose boxes are computed at a time: their arrays take 5 KB, so that they stay in the first-level cache."""
_OUTSIDE = -(1 << 28)
"""In place of a coordinate outside the lattice, which has at most 64**3 cells: it makes the number of the cell negative."""
STRIDE = 2
"""One point in two is predicted; all points are neighbours."""


@compiled(nogil=True, inline="always")
def _mix(key):
    """Hash of a uint64: the finaliser of MurmurHash3 (Appleby 2011)."""
    key ^= key >> np.uint64(33)
    key *= np.uint64(0xFF51AFD7ED558CCD)
    key ^= key >> np.uint64(33)
    key *= np.uint64(0xC4CEB9FE1A85EC53)
    return key ^ (key >> np.uint64(33))


@compiled(nogil=True, inline="always")
def _next_in_x(xyz, x, before, after, low, high):
    """Searching outwards on both sides of ``x``: the point that is next in x, how far it is there (inf: none is left), and the
    next ones on either side.  before, after: the next ones until now, of points low to high, which ascend in x."""
    below = x - xyz[before, 0] if before >= low else np.float32(np.inf)
    above = xyz[after, 0] - x if after < high else np.float32(np.inf)
    if below <= above:
        return below, before, before - 1, after
    return above, after, before, after + 1


@compiled(nogil=True)
def pick_points(xyz, low, inverse, sides, salt, limit, rows, boxes):
    """Selects the points of sampled neighbourhoods: a lattice cell is divided into side**3 boxes, some of which are sampled.

    xyz: (n, 3) float64.  low: (3,) float64, the lattice's corner.  inverse: 1 / side of a lattice cell.  sides: (X, Y, Z)
    int32, boxes along the side of each cell, 0 in empty cells.  A box is sampled where the hash of its position and ``salt`` is
    below ``limit`` (both uint64).  Writes rows (n,) int64 and boxes (n,) uint64, the hash that identifies the box; returns
    their number.
    """
    held, coordinates = sides.reshape(-1), xyz.reshape(-1)
    # _ROWS points at a time, in loops that compile to vector instructions over x, y, z, x, y, z, ... as stored
    corner, most, strides = np.empty(3 * _ROWS), np.empty(3 * _ROWS), np.empty(3 * _ROWS, np.int32)
    for k in range(3 * _ROWS):
        axis = k % 3
        corner[k], most[k] = low[axis], sides.shape[axis]
        strides[k] = 1 if axis == 2 else sides.shape[2] * (1 if axis == 1 else sides.shape[1])
    place, whole = np.empty(3 * _ROWS), np.empty(3 * _ROWS, np.int32)
    cell, side = np.empty(_ROWS, np.int32), np.empty(_ROWS, np.int32)
    box, key = np.empty(_ROWS, np.uint64), np.empty(_ROWS, np.uint64)
    used = 0
    for start in range(0, xyz.shape[0], _ROWS):
        count = min(_ROWS, xyz.shape[0] - start)
        part = coordinates[3 * start : 3 * (start + count)]
        for k in range(3 * count):
            at = (part[k] - corner[k]) * inverse
            inside = (at >= 0) & (at < most[k])  # false for NaN
            at = at if inside else 0.0
            number = np.int32(at)
            place[k], whole[k] = at - number, number * strides[k] if inside else _OUTSIDE
        for k in range(count):
            cell[k] = whole[3 * k] + whole[3 * k + 1] + whole[3 * k + 2]
        for k in range(count):
            sampled = held[max(cell[k], 0)]
            side[k] = sampled if cell[k] >= 0 else 0
        for k in range(count):
            of_axis = np.float64(side[k])
            bx, by = np.int64(np.int32(place[3 * k] * of_axis)), np.int64(np.int32(place[3 * k + 1] * of_axis))
            box[k] = np.uint64((bx * side[k] + by) * side[k] + np.int64(np.int32(place[3 * k + 2] * of_axis)))
        for k in range(count):
            key[k] = _mix(_mix(np.uint64(cell[k]) + salt) ^ box[k])
        for k in range(count):
            if key[k] < limit and side[k] > 0:
                rows[used], boxes[used] = start + k, key[k]
                used += 1
    return used


@compiled(nogil=True)
def residuals(xyz, value, starts, near, far, reach, first, last):
    """Residuals of points' values from the plane fitted to their neighbours' values, scaled to the variance of one point.

    xyz: (n, 3) float32, near the origin.  value: (n,) float32.  starts: (S + 1,) int64, start of each segment (the points of
    one group in one neighbourhood).  Neighbours are the nearest points of the same segment.  Writes, for one
    point in STRIDE, near and far (n,) float32, from NEAR and FAR neighbours (fewer in smaller segments, of three points at
    least), and reach (n,) float32, the squared spacing of the points around it, by the area that its neighbours take.
    Only segments from number ``first`` to before ``last`` are looked at.
    """
    most = 0
    for s in range(first, last):
        most = max(most, starts[s + 1] - starts[s])
    xs, ys, zs, squares = np.empty((4, most), np.float32)
    some, of_some = np.empty(most + _LANES, np.float32), np.empty(most, np.int64)
    index, square = np.empty(FAR, np.int64), np.empty(FAR, np.float32)
    for s in range(first, last):
        begin, size = starts[s], starts[s + 1] - starts[s]
        for j in range(size):
            xs[j], ys[j], zs[j] = xyz[begin + j, 0], xyz[begin + j, 1], xyz[begin + j, 2]
        wanted, within = min(FAR, size - 1), np.float32(np.inf)
        for i in range(0, size, STRIDE):
            x, y, z = xs[i], ys[i], zs[i]
            for j in range(size):
                dx, dy, dz = xs[j] - x, ys[j] - y, zs[j] - z
                squares[j] = dx * dx + dy * dy + dz * dz
            squares[i] = np.nan  # not its own neighbour: no comparison is true
            # those within a distance that was enough for the point before, without branches, which could not be predicted
            found = 0
            while found < wanted:
                found = 0
                for j in range(size):
                    some[found], of_some[found] = squares[j], j
                    found += squares[j] <= within
                if found < wanted:
                    within = 2 * within if within > 0 else np.float32(np.inf)
            index[:] = -1
            padded = (found + _LANES - 1) // _LANES * _LANES
            some[found:padded] = np.inf
            for j in range(found):  # the place of each by counting those that are nearer
                d, nearer = some[j], np.int32(0)
                for k in range(padded):
                    nearer += np.int32(some[k] < d)
                while nearer < wanted and index[nearer] >= 0:  # as far away as one before it
                    nearer += np.int32(1)
                if nearer < wanted:
                    index[nearer], square[nearer] = begin + of_some[j], d
            within = np.float32(_AGAIN) * square[wanted - 1]
            near[begin + i] = _residual(xyz, value, begin + i, index, square, min(NEAR, wanted))
            far[begin + i] = _residual(xyz, value, begin + i, index, square, wanted)
            reach[begin + i] = np.float32(np.pi) * square[wanted - 1] / np.float32(wanted)


@compiled(nogil=True)
def nearest_of_others(xyz, value, starts, begins, ends, distance, difference):
    """The nearest point of another segment of the same box.

    xyz, value, starts: as in :func:`residuals`, with one origin for the segments of a box.  begins, ends: (S,) int64, the
    segments of the box that each segment is in.  Writes, for one point in STRIDE, distance (n,) float32, squared, and
    difference (n,) float32, the point's value minus the other's; leaves them where there is no other segment.
    """
    for s in range(len(starts) - 1):
        for i in range(starts[s], starts[s + 1], STRIDE):
            x, y, z, best, at = xyz[i, 0], xyz[i, 1], xyz[i, 2], np.float32(np.inf), np.int64(-1)
            for other in range(begins[s], ends[s]):
                if other == s:
                    continue
                low, high = starts[other], starts[other + 1]
                after = low + np.searchsorted(xyz[low:high, 0], x)
                before = after - 1
                while True:
                    dx, j, before, after = _next_in_x(xyz, x, before, after, low, high)
                    if not dx * dx < best or dx == np.inf:
                        break
                    dy, dz = xyz[j, 1] - y, xyz[j, 2] - z
                    d = dx * dx + dy * dy + dz * dz
                    if d < best:
                        best, at = d, j
            if at >= 0:
                distance[i], difference[i] = best, value[i] - value[at]


@compiled(nogil=True)
def _residual(xyz, value, i, index, square, count):
    """Value i minus the prediction of a plane fitted to ``count`` neighbours, over that difference's standard deviation for
    noise of 1."""
    mean_x = mean_y = mean_z = mean = size = 0.0
    for k in range(count):
        j = index[k]
        mean_x += xyz[j, 0]
        mean_y += xyz[j, 1]
        mean_z += xyz[j, 2]
        mean += value[j]
        size += square[k]
    mean_x, mean_y, mean_z, mean = mean_x / count, mean_y / count, mean_z / count, mean / count
    ridge = _RIDGE * size + 1e-30
    a = d = f = ridge
    b = c = e = 0.0
    gx = gy = gz = 0.0
    for k in range(count):
        j = index[k]
        x, y, z, v = xyz[j, 0] - mean_x, xyz[j, 1] - mean_y, xyz[j, 2] - mean_z, value[j] - mean
        a, b, c, d, e, f = a + x * x, b + x * y, c + x * z, d + y * y, e + y * z, f + z * z
        gx, gy, gz = gx + x * v, gy + y * v, gz + z * v
    # the inverse of the symmetric matrix ((a, b, c), (b, d, e), (c, e, f)), applied to the point's position
    x, y, z = xyz[i, 0] - mean_x, xyz[i, 1] - mean_y, xyz[i, 2] - mean_z
    m00, m01, m02 = d * f - e * e, c * e - b * f, b * e - c * d
    m11, m12, m22 = a * f - c * c, b * c - a * e, a * d - b * b
    determinant = a * m00 + b * m01 + c * m02
    sx = (m00 * x + m01 * y + m02 * z) / determinant
    sy = (m01 * x + m11 * y + m12 * z) / determinant
    sz = (m02 * x + m12 * y + m22 * z) / determinant
    variance = 1.0 + 1.0 / count
    for k in range(count):
        j = index[k]
        w = sx * (xyz[j, 0] - mean_x) + sy * (xyz[j, 1] - mean_y) + sz * (xyz[j, 2] - mean_z)
        variance += w * w
    predicted = mean + sx * gx + sy * gy + sz * gz
    return np.float32((value[i] - predicted) / np.sqrt(variance))
