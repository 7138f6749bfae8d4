"""Compiled loop of viewer.work.places.standing_place: what is visible around a place, by direction."""

import math

import numpy as np

from ....model.common.jit import compiled


@compiled(nogil=True)
def add_surroundings(points, level, step, place, rows, steepest, least, low, high, nearest, held, lit, light, obstacles):
    """Enters every ``step``-th point into the directions around a place.

    points: (n, 3) float64.  level: (n,) float32 brightness, 0 for points without colour.  place: (3,) float64.
    rows: of height, within a slope of ``steepest`` to either side of the horizon.  least: horizontal distance up to which
    points are skipped.  low, high: heights above the place between which points are in a person's way.
    nearest: (azimuths * rows,) float64, horizontal distance, updated.  held, lit: the same shape, number of points and of
    those not black; light: the sum of their levels.  obstacles: (azimuths,) float64, distance of the nearest point in the way.
    """
    azimuths = obstacles.shape[0]
    for i in range(0, points.shape[0], step):
        x, y, z = points[i, 0] - place[0], points[i, 1] - place[1], points[i, 2] - place[2]
        flat = math.hypot(x, y)
        if flat <= least:
            continue
        slope, in_the_way = z / flat, low < z < high
        in_view = abs(slope) < steepest
        if not (in_view or in_the_way):
            continue
        azimuth = int((math.atan2(y, x) / (2 * math.pi) + 0.5) * azimuths) % azimuths
        if in_the_way:
            obstacles[azimuth] = min(obstacles[azimuth], flat)
        if not in_view:
            continue
        at = azimuth * rows + min(int((slope + steepest) / (2 * steepest) * rows), rows - 1)
        nearest[at] = min(nearest[at], flat)
        held[at] += 1
        lit[at] += level[i] > np.float32(0.0)
        light[at] += level[i]
