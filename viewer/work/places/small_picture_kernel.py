"""Compiled loops of viewer.work.places.small_picture: a sample of points drawn as squares as wide as the sample is sparse, and
how much is seen in such a picture."""

import math

import numpy as np

from ....model.common.jit import compiled


@compiled(nogil=True)
def draw_squares(points, spacing, level, eye, axes, width, height, focal, levels, within, depth, gap, held, lit, light):
    """Draws the points into a picture of ``width`` times ``height`` pixels, row 0 at the top.

    points: (n, 3) float32.  spacing: (n,) float32, of the sample around each point.  level: (n,) float32 brightness, 0 for
    points without colour.  eye: (3,) float64 in the frame of the points.  axes: (3, 3) float64, columns right, up and back.
    focal: pixels.  A point's square is a pixel block of a power of two, at most 2 ** (levels - 1) pixels, and at least as
    wide as the points of the sample lie apart there.
    depth, gap: (height, width) float32, written: depth of the nearest square, inf where there is none, and the spacing of the
    sample there over that depth.  held, lit, light: (height, width) float32, zeros at first: the points in each pixel that lie
    at most ``within`` times its depth away, those of them that are not black, and the sum of their levels.
    """
    first = np.zeros(levels + 1, np.int64)
    columns = np.zeros(levels, np.int64)
    for k in range(levels):
        columns[k] = ((width - 1) >> k) + 1
        first[k + 1] = first[k] + columns[k] * (((height - 1) >> k) + 1)
    nearest = np.full(first[levels], np.float32(np.inf), np.float32)
    apart = np.zeros(first[levels], np.float32)
    most = points.shape[0]
    at, away, number = np.empty(most, np.int32), np.empty(most, np.float32), np.empty(most, np.int32)
    drawn = 0
    for i in range(points.shape[0]):
        x, y, z = points[i, 0] - eye[0], points[i, 1] - eye[1], points[i, 2] - eye[2]
        d = -(x * axes[0, 2] + y * axes[1, 2] + z * axes[2, 2])
        if d <= 1e-9:
            continue
        u = (x * axes[0, 0] + y * axes[1, 0] + z * axes[2, 0]) / d * focal + width * 0.5
        v = height * 0.5 - (x * axes[0, 1] + y * axes[1, 1] + z * axes[2, 1]) / d * focal
        if not (0.0 <= u < width and 0.0 <= v < height):
            continue
        side, k = spacing[i] / d * focal, 0
        while k < levels - 1 and (1 << k) < side:
            k += 1
        row, column = int(v), int(u)
        block = first[k] + (row >> k) * columns[k] + (column >> k)
        if d < nearest[block]:
            nearest[block] = d
            apart[block] = spacing[i]
        at[drawn], away[drawn], number[drawn] = row * width + column, d, i
        drawn += 1
    for row in range(height):
        for column in range(width):
            best, between = np.float32(np.inf), np.float32(0.0)
            for k in range(levels):
                block = first[k] + (row >> k) * columns[k] + (column >> k)
                if nearest[block] < best:
                    best, between = nearest[block], apart[block]
            depth[row, column] = best
            gap[row, column] = between / best if best < np.inf else 0.0
    for j in range(drawn):
        row, column = at[j] // width, at[j] % width
        if away[j] <= depth[row, column] * within:
            value = level[number[j]]
            held[row, column] += 1.0
            light[row, column] += value
            if value > 0.0:
                lit[row, column] += 1.0


@compiled(nogil=True)
def add_up(depth, gap, held, lit, light, coarse, near, far, metre, level_edge, depth_edge):
    """Sums over the pixels of a picture of :func:`draw_squares`: of worth, of sharpness, of surfaces, and of near ones.

    coarse: gap at which a surface counts half.  near, far: depths; surfaces beyond ``far`` count no more than there.
    metre: the unit of the reach.  level_edge, depth_edge: differences of brightness and of the logarithm of depth that are
    full detail.
    """
    height, width = depth.shape
    worth, sharp, covered, blocked = 0.0, 0.0, 0.0, 0.0
    for row in range(height):
        for column in range(width):
            d = depth[row, column]
            if not d < np.inf:
                continue
            covered += 1.0
            if d < near:
                blocked += 1.0
            crisp = 1.0 / (1.0 + (gap[row, column] / coarse) ** 2)
            n = held[row, column]
            shown = crisp * (lit[row, column] / n if n > 0.0 else 1.0)  # a black surface occludes and shows nothing
            sharp += shown
            detail = 0.0
            for k in range(2):
                r, c = row + k, column + 1 - k
                if n > 0.0 and r < height and c < width and held[r, c] > 0.0:
                    change = abs(light[r, c] / held[r, c] - light[row, column] / n) / level_edge
                    detail = max(detail, min(change, 1.0), min(abs(math.log(depth[r, c] / d)) / depth_edge, 1.0))
            # where points are sparse, their noise looks like detail
            worth += shown * math.log1p(min(d, far) / metre) * (1.0 + crisp * detail)
    return worth, sharp, covered, blocked
