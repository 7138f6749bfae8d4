"""The marks of a scene's points whose colours are levels (viewer.picture.point_sets): a level stands where else a class does.

Rasterisers look a marked class up in one table of colours.  What hides points (regions, classes) hides them here, too.
"""

from dataclasses import replace
from threading import Lock
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from ...picture.point_sets import LEFT_OUT, MOST_LEVELS, PointLevels
from ..scene import attributes_of
from .point_marks import DROPPED, HAS_CLASS, SELECTED, PointMarks, marks_of

if TYPE_CHECKING:
    from ...picture.edits import Edits
    from ..scene import Scene

_BLOCK = 1 << 20
_MADE: "WeakKeyDictionary[PointLevels, tuple[tuple, PointMarks]]" = WeakKeyDictionary()
_MAKING = Lock()


def levelled_marks(scene: "Scene", edits: "Edits") -> PointMarks:
    """The marks of a scene's points for edits with levels.  Those made last are kept: a call for the same edits returns them.
    From any thread."""
    levels = edits.changes
    assert levels is not None and len(levels.levels) == scene.count
    plain = replace(edits, changes=None)
    marks = marks_of(scene, plain)
    key = marks, plain.hidden_classes
    with _MAKING:
        known = _MADE.get(levels)
        if known is None or known[0] != key:
            known = _MADE[levels] = key, _made(scene, levels, marks, plain.hidden_classes)
        return known[1]


def _made(scene: "Scene", levels: PointLevels, marks: PointMarks | None, hidden_classes: tuple[int, ...]) -> PointMarks:
    """marks: without the levels; None: no point has one."""
    codes = np.minimum(2 * levels.levels.astype(np.uint16), LEFT_OUT).astype(np.uint8)
    hidden = np.isin(np.arange(256), hidden_classes)
    for start in range(0, scene.count, _BLOCK):
        some = slice(start, min(start + _BLOCK, scene.count))
        gone, own = levels.levels[some] == LEFT_OUT, marks.of_point[some] if marks is not None else None
        if marks is not None and own is not None:
            codes[some] += (marks.table[own] & SELECTED > 0).astype(np.uint8) * ~gone
            gone |= marks.drops[own]
        if hidden_classes:
            classes = attributes_of(scene, some).classification
            classes = classes if marks is None or own is None else marks.classes(own, classes)
            gone |= hidden[0 if classes is None else classes]
        codes[some][gone] = LEFT_OUT
    table = np.zeros(256, np.uint32)
    for level in range(MOST_LEVELS):
        table[2 * level : 2 * level + 2] = HAS_CLASS | level if levels.colours is not None else 0
    table[1 : 2 * MOST_LEVELS : 2] |= np.uint32(SELECTED)
    table[LEFT_OUT] = DROPPED
    return PointMarks(np.zeros(0, np.uint8), codes, table)
