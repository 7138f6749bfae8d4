"""What a person does with a selection: new fields of the document, as values.

Each function returns changes for one step of the history (DocumentState.edit).  files: of the scene (point_marks.file_keys).
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from ...grid.records.point_marks import PointMarks
from ...picture.point_sets import NO_POINTS, FileKey, PointSet
from ...picture.regions import ClassChange, Region
from ..document import Document, unique_name

if TYPE_CHECKING:
    from ...grid.scene import Scene

Changes = dict[str, Any]
DELETED, REST = "Deleted", "All else"
"""Names of the regions that deleting, and showing nothing but the selection, make."""


def kept_as_region(document: Document, name: str, *, shown: bool = True) -> Changes:
    """The selection becomes a region, with a number behind the name where there is one of it already."""
    made = Region(unique_name(name, (region.name for region in document.regions)), document.selection, shown)
    return {"regions": (*document.regions, made), "selection": NO_POINTS}


def deleted(document: Document, files: tuple[FileKey, ...]) -> Changes:
    """The selection joins the hidden region of deleted points."""
    return _in_hidden(document, DELETED, lambda before: before | document.selection.mask(files), files)


def shown_alone(document: Document, points: PointSet, files: tuple[FileKey, ...]) -> Changes:
    """All other points are in a hidden region."""
    return _in_hidden(document, REST, lambda _: ~points.mask(files), files)


def _in_hidden(document: Document, name: str, change, files: tuple[FileKey, ...]) -> Changes:
    old = next((region for region in document.regions if region.name == name and not region.shown), None)
    before = (NO_POINTS if old is None else old.points).mask(files)
    made = Region(name, PointSet.of(change(before), files), shown=False)
    others = tuple(region for region in document.regions if region is not old)
    return {"regions": (*others, made), "selection": NO_POINTS}


def classified(document: Document, code: int | None, files: tuple[FileKey, ...]) -> Changes:
    """The selected points have another class; code None: that of their file again.  They are selected no more: their colour
    shows it."""
    mask = document.selection.mask(files)
    points = {change.code: change.points.mask(files) & ~mask for change in document.reclassified}
    if code is not None:
        points[code] = points.get(code, False) | mask
    made = (ClassChange(number, PointSet.of(points[number], files)) for number in sorted(points))
    return {"reclassified": tuple(change for change in made if change.points), "selection": NO_POINTS}


def inverted(document: Document, in_sight: np.ndarray, files: tuple[FileKey, ...]) -> PointSet:
    """The points in sight that are not selected.  in_sight: (R,) bool by record."""
    return PointSet.of(in_sight & ~document.selection.mask(files), files)


def class_counts(scene: "Scene", marks: PointMarks | None) -> dict[int, int]:
    """Present class -> number of points of the grid, in ascending order; those of the files where none was changed."""
    from ...grid.scene import attributes_of

    if marks is None or not marks.reclassifies:
        return dict(scene.attributes.classes)
    found = np.zeros(256, np.int64)
    for start in range(0, scene.count, 1 << 20):
        some = slice(start, min(start + (1 << 20), scene.count))
        own = attributes_of(scene, some).classification if scene.attributes.has_classes else None
        found += np.bincount(marks.classes(marks.of_point[some], own), minlength=256)
    return {int(code): int(found[code]) for code in np.flatnonzero(found)}
