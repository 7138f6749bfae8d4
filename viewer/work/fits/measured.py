"""The measured points that a fit looks at: those of a scene in an oriented box, no more than are needed.

A fit gains little beyond some tens of thousands of points.  Where a box holds more, only the coarser density layers are read,
which are an even choice of all points (viewer.grid.density_layers), of the last of them every so many, and of what is found
every so many.
Frame: relative to the place that was clicked, in file units, axes of the file, float64.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ..places.pick import Kept

MOST = 15_000
"""Points of a box that are looked at, about.  With half and twice as many the diameters of tests/unit/work/test_fits.py lie
within what is stated.  The spread of a diameter falls with the root of their number only where noise has no structure, which
real surfaces have."""
AT_ONCE = 100_000
"""Points of the cells that meet a box, up to which all are looked at: 2 ms.  Of more, so many tell how many are needed."""
_SURE = 1.5
"""How many points are looked for, in those that are needed: the share of AT_ONCE in a small box is unsure."""
LOOKED = 4_000_000
"""Points of the cells that meet a box that are looked at, at most: 96 MB of coordinates, where all lie in it."""


@dataclass(frozen=True, eq=False)
class Points:
    """xyz: (n, 3) float64 relative to the click.  index: (n,) int64, numbers in the scene; None where there is no scene.
    share: of all points in the box, how many were looked at, in 0..1."""

    xyz: np.ndarray
    index: np.ndarray | None
    share: float = 1.0

    def __len__(self) -> int:
        return len(self.xyz)

    def where(self, chosen: np.ndarray) -> "Points":
        """Those that a mask or numbers choose."""
        return Points(self.xyz[chosen], None if self.index is None else self.index[chosen], self.share)


InBox = Callable[[np.ndarray, np.ndarray, np.ndarray], Points]
"""Centre (3,) relative to the click, axes (3, 3) rows, half lengths (3,) -> the points in this box."""


def distinct(in_box: InBox) -> InBox:
    """Boxes in which points at the same place count once: a scan that is in a file twice says nothing new."""
    from .fit_loops import first_of_each  # numba: only once something is fitted

    def once(centre: np.ndarray, axes: np.ndarray, half: np.ndarray) -> Points:
        points = in_box(centre, axes, half)
        return points.where(first_of_each(np.ascontiguousarray(points.xyz).view(np.int64)))

    return once


def in_scene(scene: "Scene", place: np.ndarray, kept: "Kept | None" = None, most: int = MOST) -> InBox:
    """Boxes of a scene around ``place``, (3,) file coordinates.  kept: which points are drawn; None: all."""
    from ...grid.gathered_rows import gathered
    from ...grid.scene import packed, scan_numbers
    from ..places import pick_kernels  # numba: only once something is picked or fitted

    coords, offsets = np.asarray(scene.cell_coords), np.asarray(scene.offsets)
    size, at = scene.cell_size, np.asarray(place, np.float64) - scene.origin

    def read(rows: np.ndarray, counts: np.ndarray, wanted: float, *box: np.ndarray):
        """Numbers and places of the points of a box, of about ``wanted`` points of the cells ``rows``, and how many were looked
        at.  counts: points of all layers up to each."""
        layer = min(int(np.searchsorted(counts, wanted)), len(counts) - 1)
        before = int(counts[layer - 1]) if layer else 0
        every = max(int((counts[layer] - before) / max(wanted - before, 1)), 1)
        cells = gathered(scene, rows, layer + 1)
        index, xyz = pick_kernels.points_in_box(cells.points, cells.coords, cells.offsets, layer + 1, every, cells.rows, size,
                                                *box)
        return cells.numbers(index), xyz, before + (counts[layer] - before) / every

    def in_box(centre: np.ndarray, axes: np.ndarray, half: np.ndarray) -> Points:
        reach, axes, half = np.abs(axes).T @ half, np.ascontiguousarray(axes), np.asarray(half, np.float64)
        low, high = (np.floor((at + centre + sign * reach) / size).astype(np.int64) for sign in (-1, 1))
        rows = pick_kernels.cells_in_box(coords, low, high)
        middles = (coords[rows] + 0.5) * size - (at + centre)
        rows = rows[(np.abs(middles @ axes.T) <= half + size / 2 * np.abs(axes).sum(axis=1)).all(axis=1)]
        counts = np.cumsum(pick_kernels.points_by_layer(offsets, scene.layers, len(coords), rows))
        box = at + centre, axes, half
        index, xyz, seen = read(rows, counts, AT_ONCE, *box)
        if seen < counts[-1] and len(index) < most:
            index, xyz, seen = read(rows, counts, min(_SURE * most / max(len(index), 1) * seen, LOOKED), *box)
        looked = seen / counts[-1] if counts[-1] else 1.0
        if len(index) > most:
            step = len(index) / most
            chosen = (np.arange(most) * step).astype(np.int64)
            index, xyz, looked = index[chosen], xyz[chosen], looked / step
        xyz = xyz + centre
        if kept is not None and len(index):
            left = kept(xyz + place, scan_numbers(packed(scene, index)), index)
            index, xyz = index[left], xyz[left]
        return Points(xyz, index, float(looked))

    return in_box


def in_cloud(xyz: np.ndarray, place: np.ndarray, most: int = MOST) -> InBox:
    """Boxes of (n, 3) points, plainly: the reference of :func:`in_scene`, and what fits of arrays use."""
    xyz = np.asarray(xyz, np.float64) - place

    def in_box(centre: np.ndarray, axes: np.ndarray, half: np.ndarray) -> Points:
        index = np.flatnonzero((np.abs((xyz - centre) @ axes.T) <= half).all(axis=1))
        step = max(len(index) / most, 1.0)
        index = index[(np.arange(int(len(index) / step)) * step).astype(np.int64)]
        return Points(xyz[index], index, 1.0 / step)

    return in_box
