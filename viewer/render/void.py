"""Void or hole: which directions around a camera the scan surrounds, whatever the picture's border cuts off.

A hole in a room's floor is surrounded by floor on all sides, even where the picture ends in the middle of it; the sky
over a street and the space around a statue are not.  The directions around the camera are sorted into the cells of a
cube; a cell is closed where, walking from it in eight directions, each meets a scanned cell within 60 degrees.
World axes, no OpenGL.
"""

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from viewer.cloud import unpack

if TYPE_CHECKING:
    from viewer.cloud.scene import Scene

SIDE = 16
"""Cells along a side of a cube face: 5.6 degrees."""
_STEPS = np.radians(np.arange(6.0, 61.0, 6.0))
_WALKS = 8
_NEEDED = 8
_SAMPLES = 16384


def cell_of(directions: np.ndarray) -> np.ndarray:
    """(N,) int cell numbers, (face * SIDE + row) * SIDE + column, of directions (N, 3), none of them zero."""
    size = np.abs(directions)
    axis = size.argmax(axis=1)
    rows = np.arange(len(directions))
    along = directions[rows, axis]
    u, v = (directions[rows, (axis + k) % 3] / np.abs(along) for k in (1, 2))
    column, row = (np.clip(((w * 0.5 + 0.5) * SIDE).astype(np.int64), 0, SIDE - 1) for w in (u, v))
    return ((2 * axis + (along < 0)) * SIDE + row) * SIDE + column


@cache
def _walks() -> np.ndarray:
    """(cells, walks, steps) int: the cells met on the way from each cell's centre."""
    face, row, column = np.meshgrid(np.arange(6), np.arange(SIDE), np.arange(SIDE), indexing="ij")
    axis = (face // 2).ravel()
    centre = np.zeros((axis.size, 3))
    rows = np.arange(axis.size)
    centre[rows, axis] = np.where(face.ravel() % 2, -1.0, 1.0)
    centre[rows, (axis + 1) % 3] = ((column.ravel() + 0.5) / SIDE) * 2 - 1
    centre[rows, (axis + 2) % 3] = ((row.ravel() + 0.5) / SIDE) * 2 - 1
    centre /= np.linalg.norm(centre, axis=1, keepdims=True)
    helper = np.where(np.abs(centre[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]])
    a = np.cross(centre, helper)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(centre, a)
    met = []
    for angle in np.arange(_WALKS) * (2 * np.pi / _WALKS):
        heading = np.cos(angle) * a + np.sin(angle) * b
        met.append(np.stack([cell_of(np.cos(s) * centre + np.sin(s) * heading) for s in _STEPS], axis=1))
    return np.stack(met, axis=1)


class Surroundings:
    """A thinned skeleton of a scene, and the directions it closes as seen from anywhere."""

    def __init__(self, scene: "Scene"):
        coords = np.asarray(scene.cell_coords, np.int64)
        shift = 0
        while len(np.unique(coords >> shift, axis=0)) > _SAMPLES:
            shift += 1
        coarse = np.unique(coords >> shift, axis=0)
        centres = scene.origin + (coarse + 0.5) * (scene.cell_size * 2.0**shift)
        head = int(scene.offsets[len(coords) * min(2, scene.layers)])  # the two coarsest layers: an even sample
        points, *_ = unpack(scene, slice(0, min(head, 8 * _SAMPLES)))
        self._points = np.concatenate([centres, points[:: max(1, len(points) // _SAMPLES)]])

    def closed(self, position: np.ndarray) -> np.ndarray:
        """(6 * SIDE, SIDE) int8: 1 where a hole in that direction from ``position`` (3,) is to be filled."""
        ray = self._points - position
        ray = ray[np.abs(ray).max(axis=1) > 0]
        scanned = np.zeros(6 * SIDE * SIDE, bool)
        scanned[cell_of(ray)] = True
        hits = scanned[_walks()].any(axis=2).sum(axis=1)
        return (hits >= _NEEDED).astype(np.int8).reshape(6 * SIDE, SIDE)
