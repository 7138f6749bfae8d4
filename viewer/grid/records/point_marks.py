"""What a person did to single points of a scene: a byte for each point of the grid, and what each byte says.

Selected, hidden with a region, classified anew: sets of records (viewer.picture.point_sets) become one number a point, which
rasterisers, picking and export look up in one table.  They therefore agree to the point.
"""

from dataclasses import dataclass, field
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from ...common.errors import InputError
from ...picture.edits import Edits
from ...picture.point_sets import FileKey
from ...picture.regions import hidden_regions

if TYPE_CHECKING:
    from ..scene import Scene
    from .point_records import PointRecords

HAS_CLASS, SELECTED, DROPPED = 1 << 8, 1 << 9, 1 << 10
"""Bits of an entry of the table; the lowest 8 bits are the class of an entry with HAS_CLASS."""
_DROPPED = 255
_BLOCK = 1 << 20
"""Points whose marks are gathered at a time."""


@dataclass(frozen=True, eq=False)
class PointMarks:
    """of_record: (R,) uint8 codes by running number.  of_point: (N,) uint8 codes by number in the scene.  table: (256,) uint32,
    what each code says."""

    of_record: np.ndarray
    of_point: np.ndarray
    table: np.ndarray
    drops: np.ndarray = field(init=False)
    """(256,) bool: codes of points that are not drawn."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "drops", (self.table & DROPPED) != 0)

    def classes(self, codes: np.ndarray, own: np.ndarray | None) -> np.ndarray:
        """(n,) uint8: the classes of points.  codes: (n,) marks.  own: (n,) those of their file; None: 0."""
        entries = self.table[codes]
        found = np.zeros(len(codes), np.uint8) if own is None else own.astype(np.uint8)
        return np.where(entries & HAS_CLASS, (entries & 255).astype(np.uint8), found)

    @property
    def drops_any(self) -> bool:
        """Whether some point is not drawn."""
        return bool(self.drops.any())

    @property
    def reclassifies(self) -> bool:
        """Whether some point has another class than in its file."""
        return bool((self.table & HAS_CLASS).any())


def file_keys(scene: "Scene") -> tuple[FileKey, ...]:
    """Names and numbers of records of the scene's files, in their order.

    Raises InputError where the grid does not tell which points of the files its points are."""
    if scene.records is None:
        raise InputError("this grid does not tell which points of the file its points are, so that none can be selected",
                         remedy="convert the scan again")
    counts = np.diff(scene.records.first).tolist()
    sources = scene.meta.sources
    names = [Path(source).name for source in sources] if len(sources) == len(counts) else [f"#{n}" for n in range(len(counts))]
    return tuple(zip(names, counts, strict=True))


_MADE: "WeakKeyDictionary[PointRecords, dict[tuple, PointMarks]]" = WeakKeyDictionary()
_KEPT = 2
"""Marks of a scene that are kept: those of the picture, and those of what is selected or exported beside it."""
_MAKING = Lock()


def has_sets(edits: Edits) -> bool:
    """Whether edits have sets of points that change a picture or an export."""
    return bool(edits.selection or edits.reclassified or hidden_regions(edits.regions))


def check_sets(scene: "Scene", edits: Edits) -> None:
    """Raises InputError where edits have sets of points, and the grid does not tell which records its points are."""
    if has_sets(edits):
        file_keys(scene)


def unknown_sets(scene: "Scene", edits: Edits) -> list[str]:
    """A line for each set with points of files that the scene does not have: left out, or another number of records now."""
    if scene.records is None:
        return []
    files = file_keys(scene)
    named = [(f"region {region.name!r}", region.points) for region in edits.regions]
    named += [(f"class {change.code}", change.points) for change in edits.reclassified]
    lost = [(name, points.unknown(files)) for name, points in (*named, ("the selection", edits.selection))]
    return [f"{name}: {count:,} points are of a file that is not open, or has another number of points now"
            for name, count in lost if count]


def marks_of(scene: "Scene", edits: Edits) -> PointMarks | None:
    """The marks of a scene's points; None where edits have none, or the grid does not tell which records its points are.

    Those asked for last are kept: a call for the same sets returns them.  From any thread.
    """
    if not has_sets(edits) or scene.records is None:
        return None
    key = edits.selection, edits.reclassified, tuple(region.points for region in hidden_regions(edits.regions))
    with _MAKING:
        known = _MADE.setdefault(scene.records, {})
        marks = known.pop(key, None) or _made(scene, edits)
        known[key] = marks  # the last one now
        while len(known) > _KEPT:
            del known[next(iter(known))]
        return marks


def _made(scene: "Scene", edits: Edits) -> PointMarks:
    records, files = scene.records, file_keys(scene)
    assert records is not None
    of_record, table = record_codes(edits, files)
    of_point = np.empty(scene.count, np.uint8)
    for start in range(0, scene.count, _BLOCK):
        some = slice(start, min(start + _BLOCK, scene.count))
        of_point[some] = of_record[records.numbers(some)]
    return PointMarks(of_record, of_point, table)


def record_codes(edits: Edits, files: tuple[FileKey, ...]) -> tuple[np.ndarray, np.ndarray]:
    """(R,) uint8 codes by running number over ``files``, and the table (256,) uint32."""
    codes, table = np.zeros(sum(records for _, records in files), np.uint8), np.zeros(256, np.uint32)
    for number, change in enumerate(edits.reclassified, 1):
        codes[change.points.mask(files)] = 2 * number
        table[2 * number : 2 * number + 2] = HAS_CLASS | change.code
    if edits.selection:
        codes += edits.selection.mask(files)
        table[1::2] |= np.uint32(SELECTED)
    for region in hidden_regions(edits.regions):
        codes[region.points.mask(files)] = _DROPPED
        table[_DROPPED] = DROPPED
    return codes, table
