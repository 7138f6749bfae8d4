"""Compiled: the distance of each point from the surface of another cloud, the plane through the points around its foot.

Reference implementation: tests/unit/work/plain_distances.py, surface_distances.
"""

import math

import numpy as np

from ....model.common.jit import compiled
from .cell_search import nearest_point
from .local_plane import FEWEST, plane_around

BALANCE = 0.5
"""How far the middle of the points around a foot may lie from it, as a share of their radius.  At the straight border of a
surface it is 0.42 (half a disc); what lies beyond the border has no counterpart."""
BEND = math.sqrt(3.0)
"""A plane through a disc of a bent surface lies R^2 / (4 r) beside it in the middle, and the scatter about it is R^2 / (4 r) /
sqrt(3) (disc of radius R, bend of radius r, integrated)."""


@compiled(nogil=True)
def distances_from_surface(places, own, limit, radius, scatter, side, sizes, points, keys, first, table, blocks, block_first,
                           block_table, distance, variance, normals, begin, end):  # fmt: skip
    """Results for the places begin..end: distance along ``normals`` (n, 3), NaN without a counterpart, and its ``variance``.

    places: (n, 3).  own: their noise, standard deviation; where the surface scatters more, they are taken to do so too.
    limit: farthest nearest point.  radius: of the points that make a plane.  scatter: noise of the cloud,
    standard deviation; larger scatter is taken for bend.
    """
    plane = np.empty((5, 3))
    count, away = 0, 0.0
    for i in range(begin, end):
        distance[i] = np.nan
        variance[i] = np.nan
        for axis in range(3):
            normals[i, axis] = 0.0
        x, y, z = places[i, 0], places[i, 1], places[i, 2]
        near = nearest_point(x, y, z, limit, side, sizes, points, keys, first, table, blocks, block_first, block_table)
        if near < 0:
            continue
        fx, fy, fz = points[near, 0], points[near, 1], points[near, 2]
        for turn in range(2):
            count = plane_around(fx, fy, fz, radius, plane, side, sizes, points, keys, first, table, blocks, block_first,
                                 block_table)  # fmt: skip
            if count < FEWEST:
                break
            away = (x - plane[0, 0]) * plane[1, 0] + (y - plane[0, 1]) * plane[1, 1] + (z - plane[0, 2]) * plane[1, 2]
            fx, fy, fz = x - away * plane[1, 0], y - away * plane[1, 1], z - away * plane[1, 2]
            if turn == 0 and (fx - plane[0, 0]) ** 2 + (fy - plane[0, 1]) ** 2 + (fz - plane[0, 2]) ** 2 > 4 * radius * radius:
                count = 0
                break
        if count < FEWEST or abs(away) > limit:
            continue
        dx, dy, dz = fx - plane[0, 0], fy - plane[0, 1], fz - plane[0, 2]
        if dx * dx + dy * dy + dz * dz > (BALANCE * radius) ** 2:
            continue
        u = dx * plane[2, 0] + dy * plane[2, 1] + dz * plane[2, 2]
        v = dx * plane[3, 0] + dy * plane[3, 1] + dz * plane[3, 2]
        spread = plane[4, 0]
        distance[i] = away
        variance[i] = max(own * own, spread) + spread * (1.0 + u * u / plane[4, 1] + v * v / plane[4, 2]) / count
        variance[i] += BEND * BEND * max(spread - scatter * scatter * (1.0 + 2.0 * math.sqrt(2.0 / (count - 3))), 0.0)
        for axis in range(3):
            normals[i, axis] = plane[1, axis]
