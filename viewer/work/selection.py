"""The points of a grid in blocks, clipped, as numbers a file holds.  Memory: one block, whatever the scan's size.

Frame: file coordinates, file units.  A point lies within half a grid step of where it was measured (``Scene.step``: the cell's
side over 65,536, micrometres to fractions of a millimetre for a building).
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.errors import InputError
from ..common.progress import progress
from ..grid.place.hidden_grids import hidden_points, table_numbers
from ..grid.records.levelled_marks import levelled_marks
from ..grid.records.point_marks import file_keys, marks_of
from ..picture.clip import Clip, active, box_around, contains, may_contain
from ..picture.edits import Edits
from ..picture.point_sets import PointSet
from ..picture.regions import LAST_CLASS, Region

if TYPE_CHECKING:
    from ..grid.records.point_marks import PointMarks
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
    """The points of a scene that are in sight: not hidden with their station, class or region, left by ``clips`` and,
    separately, by ``within``.

    clips: of the project.  within: of ``--clip``.  hidden: numbers of stations that are left out, hidden ghosts among them
    (Scene.hidden_stations).  hidden_classes: codes that are left out.  classes: codes of which points are, of ``--class``;
    None: of any.  marks: what was done to single points: hidden with a region, classified anew; None: nothing.
    """

    scene: "Scene"
    clips: tuple[Clip, ...] = ()
    within: tuple[Clip, ...] = ()
    hidden: frozenset[int] = frozenset()
    hidden_classes: frozenset[int] = frozenset()
    classes: frozenset[int] | None = None
    marks: "PointMarks | None" = None

    @staticmethod
    def in_sight(scene: "Scene", edits: Edits, within: tuple[Clip, ...] = (), *, classes: frozenset[int] | None = None,
                 only: PointSet | None = None) -> "Selection":
        """What a person sees of a scene with these edits.  only: of these points; None: of all.  Where the grid does not tell
        which records its points are, sets of points do nothing; point_marks.check_sets raises an error there."""
        if edits.changes is not None:  # its marks leave out what classes and regions hide, too
            marks = levelled_marks(scene, replace(edits, changes=edits.changes.uncoloured))
            return Selection(scene, edits.clips, within, scene.hidden_stations(edits), marks=marks)
        marked = edits
        if only is not None:
            files = file_keys(scene)
            rest = Region("", PointSet.of(~only.mask(files), files), shown=False)
            marked = replace(edits, regions=(*edits.regions, rest))
        return Selection(scene, edits.clips, within, scene.hidden_stations(edits), frozenset(edits.hidden_classes), classes,
                         marks_of(scene, marked))

    @property
    def everything(self) -> bool:
        """Whether nothing is left out."""
        hidden = self.hidden or self.hidden_classes or (self.marks is not None and self.marks.drops_any)
        return not (active(self.clips) or self.within or hidden or self.classes is not None)

    def blocks(self, label: str) -> Iterator[Block]:
        """Every point once, in the order of the grid (coarse layers first), with a progress bar."""
        from ..grid.gathered_rows import points_of
        from ..grid.scene import scan_numbers, unpack

        scene = self.scene
        for start, stop in self._runs(label):
            xyz, rgb, intensity, station = unpack(scene, slice(start, stop))
            some = slice(start, stop)
            classes = self.classes_of(some)
            kept = slice(None) if self.everything else self.keeps(xyz, station, some)
            if scene.marked is not None:  # a ghost in sight is a point of its own station
                station = scan_numbers(points_of(scene, start, stop))
            if len(xyz[kept]):
                yield Block(xyz[kept], rgb[kept], intensity[kept], station[kept], classes[kept])

    def keeps(self, xyz: np.ndarray, station: np.ndarray, index: Any) -> np.ndarray:
        """(n,) bool: which points are in sight.  xyz: (n, 3) file coordinates.  station: (n,) uint8 scan numbers.  index: their
        numbers in the scene, a slice or (n,) of them."""
        hidden = np.zeros(256, bool)
        hidden[table_numbers(self.scene, self.hidden)] = True
        kept = ~hidden[station] & contains(self.clips, xyz) & contains(self.within, xyz)
        if (of_grids := hidden_points(self.scene, self.hidden, index)) is not None:
            kept &= ~of_grids
        codes = None if self.marks is None else self.marks.of_point[index]
        return kept & self.allows(codes, lambda: self._own_classes(index))

    def allows(self, codes: np.ndarray | None, own: Callable[[], np.ndarray | None]) -> np.ndarray | bool:
        """Which points their marks and classes leave in sight.  codes: (n,) marks; None: none has any.  own: gives the (n,)
        classes in the file, None where it has none; called where classes count."""
        kept: np.ndarray | bool = True
        if self.marks is not None and codes is not None:
            kept = ~self.marks.drops[codes]
        if self.hidden_classes or self.classes is not None:
            found = own()
            found = found if self.marks is None or codes is None else self.marks.classes(codes, found)
            wanted = np.zeros(256, bool)
            wanted[range(256) if self.classes is None else list(self.classes)] = True
            wanted[list(self.hidden_classes)] = False
            kept &= wanted[0 if found is None else found]
        return kept

    def classes_of(self, index: Any) -> np.ndarray:
        """(n,) uint8: the present classes of the points at ``index``, 0 where they have none."""
        own = self._own_classes(index)
        if self.marks is not None:
            return self.marks.classes(self.marks.of_point[index], own)
        count = len(range(*index.indices(self.scene.count)) if isinstance(index, slice) else np.atleast_1d(index))
        return np.zeros(count, np.uint8) if own is None else own

    def _own_classes(self, index: Any) -> np.ndarray | None:
        from ..grid.scene import attributes_of

        return attributes_of(self.scene, index).classification if self.scene.attributes.has_classes else None

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


def classes_of(text: str | None) -> frozenset[int] | None:
    """The codes of ``--class``, such as 2,6; None where it is not given.  Raises InputError."""
    if text is None:
        return None
    try:
        found = frozenset(int(part) for part in text.split(","))
    except ValueError:
        found = frozenset({-1})
    if not all(0 <= code <= LAST_CLASS for code in found):
        raise InputError(f"expected codes from 0 to {LAST_CLASS}, such as 2,6", option="--class", value=text)
    return found


def region_named(regions: Sequence[Region], name: str) -> Region:
    """The first region of a name.  Raises InputError where there is none."""
    for region in regions:
        if region.name == name:
            return region
    known = ", ".join(region.name for region in regions) or "none"
    raise InputError(f"the project has no such region (it has: {known})", option="--region", value=name)
