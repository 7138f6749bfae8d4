"""Compiled loops that see the points of a scan from a photograph: nearest distances, colours, agreement.  Photograph's
frame."""

import numpy as np

from ....model.common.jit import compiled
from ....model.reference.photo_colours import LEAST_ANGLE, PINHOLE, SPHERICAL

_F = np.float32
VOTES = 6
"""Photographs that a place votes for."""


@compiled(nogil=True)
def project(x, y, z, kind, lens, around, width, height):
    """(column, row, whether the photograph shows it) of a place in the photograph's frame."""
    if kind == PINHOLE:
        if z >= 0:
            return 0.0, 0.0, False
        column, row = lens[2] - x / z * lens[0], lens[3] + y / z * lens[1]
    else:
        flat = np.sqrt(x * x + y * y)
        if flat == 0:
            return 0.0, 0.0, False
        rise = np.arctan2(z, flat) if kind == SPHERICAL else z / flat
        column, row = lens[2] - np.arctan2(y, x) * lens[0], lens[3] - rise * lens[1]
        if around:
            column -= np.floor(column / width) * width
    return column, row, (column >= 0) & (column < width) & (row >= 0) & (row < height)


@compiled(nogil=True)
def nearest_points(points, nearest, turn, shift, kind, lens, around, width, height):
    """Lowers nearest (m, n) float32, over the whole photograph, to the distance of the nearest point.

    points: (n, 3) float32.  turn: (3, 3), shift: (3,): of their frame to the photograph's.  width, height: of the
    photograph."""
    rows, columns = nearest.shape
    for k in range(len(points)):
        a, b, c = points[k, 0], points[k, 1], points[k, 2]
        z = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c + shift[2]
        if kind == PINHOLE and z >= 0:
            continue
        x = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c + shift[0]
        y = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c + shift[1]
        column, row, shown = project(x, y, z, kind, lens, around, width, height)
        if shown:
            i, j = min(int(column / width * columns), columns - 1), min(int(row / height * rows), rows - 1)
            nearest[j, i] = min(nearest[j, i], _F(np.sqrt(x * x + y * y + z * z)))


@compiled(nogil=True)
def seen_points(points, nearest, farther, seen, turn, shift, kind, lens, around, width, height):
    """Sets seen (n,) bool: which points the photograph shows, not hidden by what lies in front of them."""
    rows, columns = nearest.shape
    for k in range(len(points)):
        a, b, c = points[k, 0], points[k, 1], points[k, 2]
        x = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c + shift[0]
        y = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c + shift[1]
        z = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c + shift[2]
        column, row, shown = project(x, y, z, kind, lens, around, width, height)
        seen[k] = False
        if shown:
            i, j = min(int(column / width * columns), columns - 1), min(int(row / height * rows), rows - 1)
            seen[k] = np.sqrt(x * x + y * y + z * z) <= nearest[j, i] * farther


@compiled(nogil=True)
def photograph_colours(points, level, colours, turn, shift, kind, lens, around, width, height):
    """Sets colours (n, 3) float32: those of a mip level (h, w, 4) uint8 at the points, bilinear; -1 where it holds nothing."""
    rows, columns = level.shape[0], level.shape[1]
    for k in range(len(points)):
        a, b, c = points[k, 0], points[k, 1], points[k, 2]
        x = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c + shift[0]
        y = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c + shift[1]
        z = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c + shift[2]
        column, row, shown = project(x, y, z, kind, lens, around, width, height)
        colours[k] = _F(-1.0)
        if not shown:
            continue
        u, v = column * columns / width - 0.5, row * rows / height - 0.5
        left, top = int(np.floor(u)), int(np.floor(v))
        s, t = _F(u - left), _F(v - top)
        right, below = min(left + 1, columns - 1), min(top + 1, rows - 1)
        left, top = max(left, 0), max(top, 0)
        if min(min(level[top, left, 3], level[top, right, 3]), min(level[below, left, 3], level[below, right, 3])) < 255:
            continue
        for channel in range(3):
            upper = level[top, left, channel] * (_F(1.0) - s) + level[top, right, channel] * s
            lower = level[below, left, channel] * (_F(1.0) - s) + level[below, right, channel] * s
            colours[k, channel] = upper * (_F(1.0) - t) + lower * t


@compiled(nogil=True)
def count_votes(places, view, votes, turns, shifts, kinds, lenses, rounds, sizes):
    """Adds to votes (n,) of the photographs what each place (p, 3) gives to those that would show it best: 1, 1/2, 1/3 ...

    view: (p, 3) unit rays of the camera.  Of each photograph: turns (n, 3, 3), shifts (n, 3), kinds, lenses (n, 4), rounds,
    sizes (n, 2)."""
    best, who = np.empty(VOTES), np.empty(VOTES, np.int64)
    for p in range(len(places)):
        a, b, c = places[p, 0], places[p, 1], places[p, 2]
        kept = 0
        for k in range(len(turns)):
            turn, shift = turns[k], shifts[k]
            x = turn[0, 0] * a + turn[0, 1] * b + turn[0, 2] * c + shift[0]
            y = turn[1, 0] * a + turn[1, 1] * b + turn[1, 2] * c + shift[1]
            z = turn[2, 0] * a + turn[2, 1] * b + turn[2, 2] * c + shift[2]
            far = np.sqrt(x * x + y * y + z * z)
            if far == 0:
                continue
            rx = turn[0, 0] * x + turn[1, 0] * y + turn[2, 0] * z
            ry = turn[0, 1] * x + turn[1, 1] * y + turn[2, 1] * z
            rz = turn[0, 2] * x + turn[1, 2] * y + turn[2, 2] * z
            apart = 1.0 - (rx * view[p, 0] + ry * view[p, 1] + rz * view[p, 2]) / far
            worth = lenses[k, 0] / ((LEAST_ANGLE + apart) * far)
            if kept == VOTES and worth <= best[VOTES - 1]:
                continue
            if not project(x, y, z, kinds[k], lenses[k], rounds[k], sizes[k, 0], sizes[k, 1])[2]:  # the dearest test: last
                continue
            place = min(kept, VOTES - 1)
            while place > 0 and best[place - 1] < worth:
                best[place], who[place] = best[place - 1], who[place - 1]
                place -= 1
            best[place], who[place] = worth, k
            kept = min(kept + 1, VOTES)
        for place in range(kept):
            votes[who[place]] += 1.0 / (place + 1)
