"""Compiled loops of viewer.work.ghosts: range images of stations, and the test of points against them.

Directions around a station are divided into cells of equal azimuth and inclination, about the file's z axis.
"""

import math

from ...model.common.jit import compiled


@compiled(inline="always")
def _range_and_cell(point, place, rows, columns):
    """Range of a point from a place, and row and column of its direction, rows from +z downwards; range 0: it has none."""
    x, y, z = point[0] - place[0], point[1] - place[1], point[2] - place[2]
    radius = math.sqrt(x * x + y * y + z * z)
    if radius <= 0.0:
        return 0.0, 0, 0
    row = int(math.acos(min(max(z / radius, -1.0), 1.0)) / math.pi * rows)
    column = int((math.atan2(y, x) / (2 * math.pi) + 0.5) * columns)
    return radius, min(row, rows - 1), min(column, columns - 1)


@compiled(nogil=True)
def add_ranges(xyz, station, slot, places, nearest, rays):
    """Enters the points of each station into its range image.

    xyz: (n, 3) float64.  station: (n,) uint8.  slot: (256,) int16, the range image of each station, -1 for none.
    places: (S, 3) float64, where the station of each image stood.  nearest: (S, rows, columns) float32, least range, updated.
    rays: the same shape, uint16, number of points, updated, at most 65535.
    """
    rows, columns = nearest.shape[1], nearest.shape[2]
    for i in range(xyz.shape[0]):
        s = slot[station[i]]
        if s < 0:
            continue
        radius, row, column = _range_and_cell(xyz[i], places[s], rows, columns)
        if radius <= 0.0:
            continue
        if radius < nearest[s, row, column]:
            nearest[s, row, column] = radius
        if rays[s, row, column] < 65535:
            rays[s, row, column] += 1


@compiled(nogil=True)
def blurred_ranges(nearest, rays, near, enough, least_rays):
    """What the 3 x 3 cells around each cell hold.  Columns wrap around.

    near: (S, rows, columns) float32, result: the least range.  enough: uint8, the same shape, result: whether the cell itself
    has a point, and all of them together ``least_rays``."""
    stations, rows, columns = nearest.shape
    for s in range(stations):
        for row in range(rows):
            for column in range(columns):
                least, count = nearest[s, row, column], 0
                for other in range(max(row - 1, 0), min(row + 2, rows)):
                    for step in range(-1, 2):
                        beside = (column + step) % columns
                        least = min(least, nearest[s, other, beside])
                        count += rays[s, other, beside]
                near[s, row, column] = least
                enough[s, row, column] = rays[s, row, column] > 0 and count >= least_rays


@compiled(nogil=True)
def seen_through(xyz, station, slot, places, near, enough, slack, share, width):
    """Which points some other station saw through and none confirmed.

    A station saw through a point where everything near its direction lies farther away by more than ``slack`` + ``share`` of
    the range.  It confirms one where something lies within that of its range.

    xyz, station, slot, places: as in :func:`add_ranges`.  near, enough: of :func:`blurred_ranges`.  width: (n,) float32,
    result: 0 for points that stay, else the width of three cells at the point, of the station whose cells are widest there.
    """
    stations, rows, columns = near.shape
    for i in range(xyz.shape[0]):
        width[i] = 0.0
        own = slot[station[i]]
        widest = 0.0
        for s in range(stations):
            if s == own:
                continue
            radius, row, column = _range_and_cell(xyz[i], places[s], rows, columns)
            if radius <= 0.0:
                continue
            behind = near[s, row, column] - radius
            margin = slack + share * radius
            if abs(behind) <= margin:
                widest = 0.0
                break
            if behind > margin and enough[s, row, column]:
                widest = max(widest, radius * 3 * math.pi / rows)
        width[i] = widest
