"""Background or hole: which directions around a camera the scan encloses, independent of the picture's border.

A hole in a room's floor has floor on all sides, even where the picture ends in the middle of it; the sky over a street and the
space around a statue do not.  Directions are binned into the cells of a cube around the camera.  A cell is enclosed where each
of eight walks from it meets a scanned cell within 60 degrees.  Connected cells without a point are one hole with one answer:
closed where most of its cells are enclosed, or where it lies below the horizon of a camera that the scan encloses (the blind
spot under a tripod, seen from low down).  Closed directions are filled.  The network may make them transparent again where they
could be sky, seen between branches for example: not in a room, and not below the horizon where there is ground all around.

Cells of six degrees are too coarse for a sky: filled whole, they would hang over a street as panels with straight edges.
Outdoors (under a sky, or where the scan does not surround the camera) only the ground is closed; the picture and the world
decide the rest (model/reference/hole_test.py, viewer/render/culling/occupancy.py).
World axes, z up, no OpenGL.
"""

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ...grid.scene import packed, positions
from .direction_kernels import close_directions, mark_directions, mark_near, settle_holes
from .occupancy import Occupancy, occupancy_of, without_gaps

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera

SIDE = 16
"""Cells along a side of a cube face: 5.6 degrees."""
_CELL_RADIUS = np.arctan(np.sqrt(2.0) / SIDE) * (1 + 1e-6)
"""Radians from the middle of a cell to its farthest corner, at most: in the middle of a face."""
_STEPS = np.radians(np.arange(6.0, 61.0, 6.0))
"""Radians of a walk's steps: about a cell each, up to 60 degrees.  With an end of 45 or 75 degrees, directions change at 2 of
128 viewpoints in eight scans, by at most 2.7 %."""
_WALKS = 8
"""Walks from each cell, as a pixel has neighbours."""
_NEEDED = 8
"""Walks that must meet a scanned cell: all."""
ENCLOSES = 3
"""A scan encloses the camera where at most one in so many cells has no point.  With 2 or 5, no direction changes at 128
viewpoints in eight scans."""
ROOM = 0.9
"""Least share of all directions that are closed around a camera inside a room; over a street a third stay open."""
AROUND = 3
"""A scan surrounds the camera where at least one in so many directions holds a point; a statue seen from outside does not."""
GROUND = 10
"""There is ground all around a camera where at most one in so many directions below the horizon belongs to a hole that extends
above it.  Close to a statue the hole between its bushes does; closed, it would end at the horizon in a straight line."""
SKY = 0.015
"""Least share of all directions, without its border cells, that the largest hole has under a sky.  With its border, the sky
over three streets had 0.14 to 0.33, the largest hole of rooms less than 0.03."""
GROUND_DIP = 15.0
"""Degrees below the horizon beyond which, outdoors, cells are closed where there is ground all around; nearer to the horizon
they extend beyond the scan.  With 10 or 22.5 degrees, no direction changes at 128 viewpoints in eight scans."""
ROOF = 0.5
"""Least share of the directions more than 45 degrees above the horizon that hold points under a roof: in a room of which a side
was not scanned, and neither in a street nor beside a statue."""
OPEN, CLOSED, SEALED = 0, 1, 2
"""State of a direction: background; filled; filled, and the network must keep it."""
_SAMPLES = 24576
"""Blocks, and points, of the scene's sample at most: 16 for each of the 6 * SIDE**2 cells of the cube."""
_NEAR_SAMPLES, _NEAR_A_CELL = 1 << 17, 4
"""Points of the sample for surfaces near the camera, at least; and at least so many for each cell of the scene."""


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
def _centres() -> np.ndarray:
    """(cells, 3) float64 unit vectors to the middle of each cell."""
    face, row, column = np.meshgrid(np.arange(6), np.arange(SIDE), np.arange(SIDE), indexing="ij")
    axis = (face // 2).ravel()
    centre = np.zeros((axis.size, 3))
    rows = np.arange(axis.size)
    centre[rows, axis] = np.where(face.ravel() % 2, -1.0, 1.0)
    centre[rows, (axis + 1) % 3] = ((column.ravel() + 0.5) / SIDE) * 2 - 1
    centre[rows, (axis + 2) % 3] = ((row.ravel() + 0.5) / SIDE) * 2 - 1
    return centre / np.linalg.norm(centre, axis=1, keepdims=True)


@cache
def _walks() -> np.ndarray:
    """(cells, walks, steps) int64: the cells met on the way from each cell's centre."""
    centre = _centres()
    helper = np.where(np.abs(centre[:, :1]) < 0.6, [[1.0, 0, 0]], [[0, 1.0, 0]])
    a = np.cross(centre, helper)
    a /= np.linalg.norm(a, axis=1, keepdims=True)
    b = np.cross(centre, a)
    met = []
    for angle in np.arange(_WALKS) * (2 * np.pi / _WALKS):
        heading = np.cos(angle) * a + np.sin(angle) * b
        met.append(np.stack([cell_of(np.cos(s) * centre + np.sin(s) * heading) for s in _STEPS], axis=1))
    return np.stack(met, axis=1)


def closed_in_view(closed: np.ndarray, camera: "Camera") -> int | None:
    """The state of all directions of a picture; None where they differ.

    closed: (6 * SIDE, SIDE) of Enclosure.  Looks at every cell that a pixel's ray could fall into, and some more.
    """
    across = max(camera.cx, camera.width - camera.cx) / camera.fx
    along = max(camera.cy, camera.height - camera.cy) / camera.fy
    reach = np.arctan(np.hypot(across, along)) + _CELL_RADIUS
    there = closed.reshape(-1)[_centres() @ camera.view_rotation[2] >= np.cos(min(reach, np.pi))]
    return int(there[0]) if (there == there[0]).all() else None


@dataclass(frozen=True, eq=False)
class Directions:
    """closed: (6 * SIDE, SIDE) int8, OPEN, CLOSED or SEALED by cell.  occupancy: where the scan has surfaces, for a
    camera outdoors (under a sky, or not surrounded by the scan); None in a room."""

    closed: np.ndarray
    occupancy: Occupancy | None = None


class Enclosure:
    """A sample of a scene's points, and the directions that they close around any position."""

    def __init__(self, scene: "Scene"):
        self._scene = scene
        self._occupancy: Occupancy | None = None
        self._no_gaps: Occupancy | None = None
        coords = np.asarray(scene.cell_coords)  # along the Morton curve: those of a block lie together
        shift, starts = 0, np.arange(len(coords))
        while len(starts) > _SAMPLES:
            shift += 1
            coarse = coords[starts] >> shift  # a block begins where one of its halves does
            starts = starts[np.r_[True, (coarse[1:] != coarse[:-1]).any(axis=1)]]
        self._side = scene.cell_size * 2.0**shift
        self._blocks = scene.origin + ((coords[starts] >> shift).astype(np.float64) + 0.5) * self._side
        points, _ = _sample(scene, starts, _SAMPLES)
        self._points = np.concatenate([self._blocks, points])
        self._marked = len(points) / len(starts) if len(points) < scene.count else np.inf
        points, of_points = _sample(scene, starts, max(_NEAR_SAMPLES, _NEAR_A_CELL * len(coords)))
        mixed = np.random.default_rng(0).permutation(len(points))
        assert _SAMPLES < 1 << 16  # numbers of blocks of 16 bits are sorted by radix, in a tenth of the time
        self._near = points.take(mixed[np.argsort(of_points[mixed].astype(np.uint16), kind="stable")], axis=0)
        self._first = np.zeros(len(starts) + 1, np.int64)
        np.cumsum(np.bincount(of_points, minlength=len(starts)), out=self._first[1:])
        self._below = _centres()[:, 2] < 0
        self._above = _centres()[:, 2] > np.sqrt(0.5)
        self._low = _centres()[:, 2] < -np.sin(np.radians(GROUND_DIP))
        self._scanned = np.empty(len(self._below), bool)
        self._hole, self._queue = np.empty((2, len(self._below)), np.int32)
        self._look(np.zeros(3))  # compiled now, or read from the cache, and not in the first frame

    @property
    def occupancy(self) -> Occupancy:
        """Where the scan has surfaces; computed when first needed, which it is not in rooms."""
        if self._occupancy is None:
            self._occupancy = occupancy_of(self._scene)
        return self._occupancy

    @property
    def occupancy_inside(self) -> Occupancy:
        """The same for a camera under a roof."""
        if self._no_gaps is None:
            self._no_gaps = without_gaps(self.occupancy)
        return self._no_gaps

    def closed(self, position: np.ndarray) -> np.ndarray:
        """(6 * SIDE, SIDE) int8: OPEN, CLOSED or SEALED, the state of each direction from ``position`` (3,)."""
        return self._look(position)[0]

    def around(self, position: np.ndarray) -> Directions:
        """The state of the directions from ``position`` (3,), and outdoors the scan's surfaces."""
        closed, outdoors, roofed = self._look(position)
        if not outdoors:
            return Directions(closed)
        return Directions(closed, self.occupancy_inside if roofed else self.occupancy)

    def _look(self, position: np.ndarray) -> tuple[np.ndarray, bool, bool]:
        """The state of each direction; whether the position is outdoors; whether under a roof."""
        closed, walks, scanned = np.empty(len(self._scanned), np.int8), _walks(), self._scanned
        eye = np.asarray(position, np.float64)
        scanned[:] = False
        mark_directions(self._points, eye, SIDE, scanned)
        mark_near(self._blocks, self._marked, self._first, self._near, self._side, eye, SIDE, scanned)
        close_directions(scanned, walks, _NEEDED, closed)
        through, sky = settle_holes(scanned, walks, self._below, ENCLOSES, closed, self._hole, self._queue)
        ground = GROUND * through <= np.count_nonzero(self._below)
        in_room = np.count_nonzero(closed) > ROOM * len(closed)
        outdoors = bool(sky >= SKY * len(closed) or (not in_room and AROUND * np.count_nonzero(scanned) < len(closed)))
        if outdoors:  # the picture's pixels are finer evidence than cells of six degrees
            ground = ground and ENCLOSES * np.count_nonzero(~scanned) <= len(closed)
            closed[:] = np.where((closed > 0) & self._low & ground, SEALED, OPEN)
        elif in_room:
            closed[closed > 0] = SEALED
        elif ground:
            closed[(closed > 0) & self._below] = SEALED
        return closed.reshape(6 * SIDE, SIDE), outdoors, bool(scanned[self._above].mean() >= ROOF)


def _sample(scene: "Scene", starts: np.ndarray, wanted: int) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) float64 points spread over the scene, ``wanted`` to twice as many where it has them; (n,) int64 the block of
    each.  starts: (B,) the first cell of each block."""
    head = scene.coarse_points(wanted)
    step = max(1, head // wanted)
    cells = scene.cell_of_points(0, head)[::step]
    some = slice(0, head, step)
    blocks = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(scene.cell_coords)))  # of each cell
    return positions(scene, packed(scene, some), some), blocks[cells]
