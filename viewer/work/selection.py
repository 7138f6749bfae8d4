"""The points of a grid in blocks, clipped, as numbers a file holds.  Memory: one block, whatever the scan's size.

Frame: file coordinates, file units.  A point lies within half a grid step of where it was measured (``Scene.step``: the cell's
side over 65,536, micrometres to fractions of a millimetre for a building).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import InputError
from ..common.progress import progress
from ..picture.clip import Clip, box_around, contains, may_contain

if TYPE_CHECKING:
    from ..grid.scene import Scene

BLOCK = 1 << 20
"""Points read at a time: 28 MiB of float64 coordinates and attributes."""


@dataclass(frozen=True)
class Block:
    """xyz (n, 3) float64; rgb (n, 3) uint8, as shown; intensity (n,) uint16; station (n,) uint8, the number of the scan;
    classification (n,) uint8, 0 where the scan has none."""

    xyz: np.ndarray
    rgb: np.ndarray
    intensity: np.ndarray
    station: np.ndarray
    classification: np.ndarray


@dataclass(frozen=True)
class Selection:
    """The points of a scene that are in sight: not of a hidden station, left by ``clips`` and, separately, by ``within``.

    clips: of the project.  within: of ``--clip``.  hidden: numbers of stations that are left out, hidden ghosts among them
    (Scene.hidden_stations).
    """

    scene: "Scene"
    clips: tuple[Clip, ...] = ()
    within: tuple[Clip, ...] = ()
    hidden: frozenset[int] = frozenset()

    def blocks(self, label: str) -> Iterator[Block]:
        """Every point once, in the order of the grid (coarse layers first), with a progress bar."""
        from ..grid.scene import attributes_of, scan_numbers, unpack

        scene = self.scene
        for start, stop in self._runs(label):
            xyz, rgb, intensity, station = unpack(scene, slice(start, stop))
            classes = attributes_of(scene, slice(start, stop)).classification
            classes = np.zeros(len(xyz), np.uint8) if classes is None else classes
            kept = self.keeps(xyz, station) if self.clips or self.within or self.hidden else slice(None)
            if scene.marked is not None:  # a ghost in sight is a point of its own station
                station = scan_numbers(scene.points[start:stop])
            if len(xyz[kept]):
                yield Block(xyz[kept], rgb[kept], intensity[kept], station[kept], classes[kept])

    def keeps(self, xyz: np.ndarray, station: np.ndarray) -> np.ndarray:
        """(n,) bool: which points are in sight.  xyz: (n, 3) file coordinates.  station: (n,) uint8 scan numbers."""
        hidden = np.zeros(256, bool)
        hidden[list(self.hidden)] = True
        return ~hidden[station] & contains(self.clips, xyz) & contains(self.within, xyz)

    def _runs(self, label: str) -> Iterator[tuple[int, int]]:
        scene = self.scene
        possible = self._possible_cells()
        with progress(scene.count, label, "point") as meter:
            for start in range(0, scene.count, BLOCK):
                stop = min(start + BLOCK, scene.count)
                if possible is None or possible[self._cells_of(start, stop)].any():
                    yield start, stop
                meter.update(stop - start)

    def _possible_cells(self) -> np.ndarray | None:
        """(C,) bool: cells that may hold a point left by the clips; None without clips."""
        if not (self.clips or self.within):
            return None
        half = self.scene.cell_size / 2
        centre = self.scene.cell_min + half
        return may_contain(self.clips, centre, half) & may_contain(self.within, centre, half)

    def _cells_of(self, start: int, stop: int) -> np.ndarray:
        """The cells that a run of points touches, some of them more than once."""
        offsets = self.scene.offsets
        first = np.searchsorted(offsets, start, side="right") - 1
        last = np.searchsorted(offsets, stop, side="left")
        return np.arange(first, last) % len(self.scene.cell_coords)


def parse_box(text: str) -> Clip:
    """``xmin,ymin,zmin,xmax,ymax,zmax`` in file coordinates -> the box.  Raises InputError."""
    try:
        values = np.array([float(part) for part in text.split(",")])
    except ValueError:
        values = np.empty(0)
    if values.shape != (6,) or not np.isfinite(values).all():
        raise InputError("expected xmin,ymin,zmin,xmax,ymax,zmax in file coordinates", option="--clip", value=text)
    if not (values[3:] > values[:3]).all():
        raise InputError("each maximum must be greater than its minimum", option="--clip", value=text)
    return box_around(values[:3], values[3:], "--clip")


def clips_of(texts: Sequence[str]) -> tuple[Clip, ...]:
    """The boxes of ``--clip`` options; a point inside any of them is left."""
    return tuple(parse_box(text) for text in texts)
