"""Which points stations hide in a place of more stations than the 8 bits of a packed point tell apart.

The last number is then shared by all later stations, so that it hides none.  Where all stations of a grid are hidden, so are
its cells: that is exact for any number of grids.  Scenes of one grid are as ever: their shared number hides all that have it.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from ...preprocess.scan_table import MOST_NUMBERS
from .joined_points import JoinedPoints

if TYPE_CHECKING:
    from ..scene import Scene


def is_shared(scene: "Scene") -> bool:
    """Whether this is a place in which stations share a number."""
    return isinstance(scene.points, JoinedPoints) and len(scene.meta.scans) > MOST_NUMBERS


def table_numbers(scene: "Scene", hidden: frozenset[int]) -> list[int]:
    """The hidden stations that the numbers in packed points tell: for tables of 256 entries."""
    most = MOST_NUMBERS - 1 if is_shared(scene) else MOST_NUMBERS
    return [number for number in hidden if 0 <= number < most]


def hidden_cells(scene: "Scene", hidden: frozenset[int]) -> np.ndarray | None:
    """(C,) bool: the cells of grids all of whose stations are hidden; None where the numbers in points tell enough."""
    grids = _hidden_grids(scene, hidden)
    points: Any = scene.points
    return None if grids is None else np.repeat(grids, points.table.cells)


def hidden_points(scene: "Scene", hidden: frozenset[int], index: Any) -> np.ndarray | None:
    """(n,) bool: which of the points at ``index``, a slice or (n,) numbers, are of such grids; None as above."""
    grids = _hidden_grids(scene, hidden)
    if grids is None:
        return None
    numbers = np.arange(*index.indices(scene.count)) if isinstance(index, slice) else np.asarray(index)
    points: Any = scene.points
    return grids[points.table.places(numbers)[0]]


def _hidden_grids(scene: "Scene", hidden: frozenset[int]) -> np.ndarray | None:
    if not is_shared(scene) or not any(number >= MOST_NUMBERS - 1 for number in hidden):
        return None
    points: Any = scene.points
    flags = np.zeros(len(scene.meta.scans) + 1, np.int64)
    flags[[number for number in hidden if number < len(flags) - 1]] = 1
    before = np.concatenate([[0], np.cumsum(flags)])
    first = np.array([*points.first_stations, len(scene.meta.scans)])
    return np.diff(before[first]) == np.diff(first)
