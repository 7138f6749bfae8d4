"""Compiled loops of fits: the normal equations of least squares, the score of cylinders, and points that differ.

Each passes over the points once and makes no array of their size but its result.  The references are NumPy's
(tests/unit/work/test_fit_loops.py).  Frame: of the points, float64, file units.
"""

import math

import numpy as np

from ....model.common.jit import compiled


@compiled(inline="always")
def _linearised(x, y, z, frame, radius, slopes):
    """The distance of a point, relative to the place of a surface, and its derivatives in ``slopes`` (5,): as
    viewer.work.fits.surfaces has them.  frame: (3, 3) rows, the last along the surface's direction.  radius: 0 of a plane."""
    u = frame[0, 0] * x + frame[0, 1] * y + frame[0, 2] * z
    v = frame[1, 0] * x + frame[1, 1] * y + frame[1, 2] * z
    w = frame[2, 0] * x + frame[2, 1] * y + frame[2, 2] * z
    if radius == 0.0:
        slopes[0], slopes[1], slopes[2] = -1.0, u, v
        return w
    away = math.sqrt(u * u + v * v)
    safe = max(away, 1e-300)
    cosine, sine = u / safe, v / safe
    slopes[0], slopes[1], slopes[2], slopes[3], slopes[4] = -cosine, -sine, -1.0, -w * cosine, -w * sine
    return away - radius


@compiled(nogil=True)
def distances_of(points, place, frame, radius):
    """(n,) signed distances of points (n, 3) from a surface."""
    found, slopes = np.empty(points.shape[0]), np.empty(5)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0] - place[0], points[i, 1] - place[1], points[i, 2] - place[2]
        found[i] = _linearised(x, y, z, frame, radius, slopes)
    return found


@compiled(nogil=True)
def normal_equations(points, place, frame, radius, parameters, limit):
    """Matrix (p, p) and right side (p,) of a step with Tukey's biweight, and (p,) the largest slope of each parameter.

    limit: distance from which a point does not count."""
    matrix, right, largest = np.zeros((parameters, parameters)), np.zeros(parameters), np.zeros(parameters)
    slopes = np.empty(5)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0] - place[0], points[i, 1] - place[1], points[i, 2] - place[2]
        distance = _linearised(x, y, z, frame, radius, slopes)
        for a in range(parameters):
            largest[a] = max(largest[a], abs(slopes[a]))
        share = 1.0 - (distance / limit) ** 2
        if share <= 0.0:
            continue
        weight = share * share
        for a in range(parameters):
            scaled = weight * slopes[a]
            right[a] += scaled * distance
            for b in range(a + 1):
                matrix[a, b] += scaled * slopes[b]
    for a in range(parameters):
        for b in range(a):
            matrix[b, a] = matrix[a, b]
    return matrix, right, largest


@compiled(nogil=True)
def moved_by(points, place, frame, radius, changed_place, changed_frame, changed_radius, change, limit):
    """The largest change of a point's distance by a change of the parameters (p,), to first order; and (m,) the amounts of the
    distances from the changed surface of the points that counted, which lay within ``limit``."""
    left, found, most, slopes = np.empty(points.shape[0]), 0, 0.0, np.empty(5)
    for i in range(points.shape[0]):
        x, y, z = points[i, 0] - place[0], points[i, 1] - place[1], points[i, 2] - place[2]
        distance = _linearised(x, y, z, frame, radius, slopes)
        move = 0.0
        for a in range(change.shape[0]):
            move += slopes[a] * change[a]
        if not abs(move) <= most:
            most = abs(move)
        if abs(distance) < limit:
            x, y, z = points[i, 0] - changed_place[0], points[i, 1] - changed_place[1], points[i, 2] - changed_place[2]
            left[found] = abs(_linearised(x, y, z, changed_frame, changed_radius, slopes))
            found += 1
    return most, left[:found]


@compiled(nogil=True)
def median_of(values):
    """The median of (n,) values, n > 0, which it puts in another order (Hoare, Algorithm 65: Find, 1961)."""
    middle = values.shape[0] // 2
    low, high = 0, values.shape[0] - 1
    while low < high:
        pivot, i, j = values[(low + high) // 2], low, high
        while i <= j:
            while values[i] < pivot:
                i += 1
            while values[j] > pivot:
                j -= 1
            if i <= j:
                values[i], values[j] = values[j], values[i]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            break
    upper = values[middle]
    if values.shape[0] % 2:
        return upper
    lower = values[0]
    for i in range(middle):
        lower = max(lower, values[i])
    return (lower + upper) / 2


@compiled(nogil=True)
def explained(points, normals, centres, axes, radii, tolerance, turned):
    """(k,) how many of the points each cylinder explains: those within ``tolerance`` of it whose normals are turned from its
    own by less than an angle, of the cosine ``turned``."""
    found = np.zeros(centres.shape[0], np.int64)
    for k in range(centres.shape[0]):
        for i in range(points.shape[0]):
            x, y, z = points[i, 0] - centres[k, 0], points[i, 1] - centres[k, 1], points[i, 2] - centres[k, 2]
            along = x * axes[k, 0] + y * axes[k, 1] + z * axes[k, 2]
            x, y, z = x - along * axes[k, 0], y - along * axes[k, 1], z - along * axes[k, 2]
            away = math.sqrt(x * x + y * y + z * z)
            if abs(away - radii[k]) < tolerance:
                facing = abs(x * normals[i, 0] + y * normals[i, 1] + z * normals[i, 2])
                found[k] += facing > turned * max(away, 1e-300)
    return found


@compiled(nogil=True)
def first_of_each(bits):
    """(m,) int64 ascending: numbers of the rows of bits (n, 3) int64 that equal none before them."""
    size = 16
    while size < 2 * bits.shape[0]:
        size *= 2
    table, found, count = np.full(size, -1, np.int64), np.empty(bits.shape[0], np.int64), 0
    for i in range(bits.shape[0]):
        mixed = (bits[i, 0] * -7046029254386353131) ^ (bits[i, 1] * -4417276706812531889) ^ (bits[i, 2] * 1609587929392839161)
        at = (mixed >> 32) & (size - 1)
        while table[at] >= 0:
            other = table[at]
            if bits[other, 0] == bits[i, 0] and bits[other, 1] == bits[i, 1] and bits[other, 2] == bits[i, 2]:
                break
            at = (at + 1) & (size - 1)
        if table[at] < 0:
            table[at] = i
            found[count] = i
            count += 1
    return found[:count]
