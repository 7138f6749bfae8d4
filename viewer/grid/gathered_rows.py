"""The points of some cells as arrays, for compiled loops that look at points around a place.

In a scene in memory these are the scene's own arrays, and nothing is copied.  Of grids on disk, whose points are no array, the
points of the cells are read and stand together.
"""

from dataclasses import dataclass

import numpy as np

from .scene import Scene, packed


@dataclass(frozen=True, eq=False)
class GatheredRows:
    """points (n, 3) uint32, coords (c, 3) int32, offsets (L * c + 1,) int64: as in Scene.  rows: numbers of the wanted cells in
    ``coords``.  starts: (L * c,) int64 number in the scene of the first point of each run; None: the numbers are the
    scene's."""

    points: np.ndarray
    coords: np.ndarray
    offsets: np.ndarray
    rows: np.ndarray
    starts: np.ndarray | None = None

    def numbers(self, index: np.ndarray) -> np.ndarray:
        """Numbers in the scene of points by their numbers in ``points``, (n,)."""
        if self.starts is None:
            return index
        run = np.searchsorted(self.offsets, index, side="right") - 1
        return self.starts[run] + index - self.offsets[run]


def points_of(scene: Scene, start: int = 0, stop: int | None = None) -> np.ndarray:
    """(stop - start, 3) uint32: the points ``start`` to ``stop`` as an array, those on disk read."""
    points = scene.points[start : scene.count if stop is None else stop]
    return points if isinstance(scene.points, np.ndarray) else _read_only(points)


def _read_only(points: np.ndarray) -> np.ndarray:
    """As points in a map are, so that loops are compiled for one kind of array (viewer.compile_kernels)."""
    points.flags.writeable = False
    return points


def gathered(scene: Scene, rows: np.ndarray, layers: int | None = None) -> GatheredRows:
    """The cells ``rows`` (c,) of a scene.  layers: how many layers are wanted, from the coarsest; None: all."""
    coords, offsets = np.asarray(scene.cell_coords), np.asarray(scene.offsets)
    if isinstance(scene.points, np.ndarray):
        return GatheredRows(scene.points, coords, offsets, rows)
    wanted = scene.layers if layers is None else layers
    runs = (np.arange(wanted)[:, None] * len(coords) + rows).reshape(-1)
    starts, sizes = offsets[runs], offsets[runs + 1] - offsets[runs]
    ends = np.concatenate([[0], np.cumsum(sizes)])
    index = np.repeat(starts - ends[:-1], sizes) + np.arange(ends[-1])
    points, coords = _read_only(packed(scene, index)), np.ascontiguousarray(coords[rows])
    return GatheredRows(points, coords, ends, np.arange(len(rows)), starts)
