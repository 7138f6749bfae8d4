"""Distances between two files of a scene, or of one from a mesh beside it, and the levels that colour the points: what a
DateComparison describes.

Points are the grid's, half a step off at most (Scene.step), in the document's coordinates; what is exported is compared again
from the files.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from ...common.errors import InputError
from ...grid.records.levelled_marks import levelled_marks
from ...grid.records.point_marks import file_keys
from ...grid.scene import packed, positions, scan_numbers
from ...picture.dates.date_comparison import ChangeFigures, DateComparison
from ...picture.edits import Edits
from ...picture.meshes.mesh_layer import MeshLayer
from ...picture.point_sets import LEFT_OUT, FileKey, PointLevels
from ..scan_files import FilePart, files_of
from .change_levels import level_colours, levels_of
from .compare import Distances, compare
from .compared_model import ModelPlace, from_layer, model_of, place_of_model
from .distance_statistics import Statistics, statistics_of
from .facing import facing_of
from .model_distances import METHOD, within

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.spec import PictureSpec

_BLOCK = 1 << 20


Compared = tuple[tuple[FileKey, FileKey, str, float, int], ModelPlace | None]
"""DateComparison.compared, and the place of its mesh."""


@dataclass(frozen=True, eq=False)
class SceneDistances:
    """before, after: (n,) and (m,) int64, numbers in the scene of the points of both files; of a mesh none.  distances: of
    those of ``after``; from a mesh also of those that are far from it.  compared: :func:`compared_of`.  count: points of the
    scene."""

    before: np.ndarray
    after: np.ndarray
    distances: Distances
    compared: "Compared"
    count: int

    def shown(self, limit: float | None = None) -> Distances:
        """The distances that are coloured and counted.  limit: where the colours end; None: chosen by the changes."""
        return within(self.distances, limit=limit) if self.distances.method == METHOD else self.distances


@dataclass(frozen=True, eq=False)
class Coloured:
    """levels: of the scene's points.  found: figures, with the range of the colours."""

    levels: PointLevels
    found: Statistics

    @property
    def figures(self) -> ChangeFigures:
        found = self.found
        values = (found.median, found.sd, found.uncertainty) if found.known else (None, None, None)
        return ChangeFigures(found.count, found.known, found.changed, *values)


_MADE: "WeakKeyDictionary[Scene, SceneDistances]" = WeakKeyDictionary()


def keys_of(scene: "Scene") -> tuple[FileKey, ...]:
    """Name and number of records of each file; 0 records where the grid does not tell."""
    try:
        return file_keys(scene)
    except InputError:
        return tuple((Path(source).name, 0) for source in scene.meta.sources)


def compared_of(comparison: DateComparison, meshes: Sequence[MeshLayer]) -> Compared:
    """What decides the distances.  meshes: of the document.  Raises InputError where its mesh is not among them."""
    return comparison.compared, place_of_model(model_of(comparison, meshes)) if comparison.with_model else None


def compared_files(scene: "Scene", comparison: DateComparison) -> tuple[FilePart | None, FilePart]:
    """The files before and after; None for a mesh.  Raises InputError where one is not in the scene, has another number of
    records now, or cannot be told apart."""
    keys, parts = keys_of(scene), files_of(scene)
    found: list[int] = []
    for name, records in (comparison.before, comparison.after)[comparison.with_model :]:
        number = next((at for at, key in enumerate(keys) if key == (name, records) and at not in found), None)
        if number is None or number >= len(parts):
            now = next((there for other, there in keys if other == name), None)
            what = "is not open" if now is None else f"has {now:,} records now, and had {records:,}"
            both = f"{comparison.before[0]} and {comparison.after[0]}"
            raise InputError(f"the comparison of {both} cannot be shown: {name} {what}",
                             remedy="open both files as they were" if now is None else "compare them again")
        found.append(number)
    if not all(parts[number].apart for number in found):
        raise InputError("the comparison cannot be shown: the grid does not tell the points of its files apart",
                         remedy="open fewer files together")
    return None if comparison.with_model else parts[found[0]], parts[found[-1]]


def distances_in(scene: "Scene", comparison: DateComparison, meshes: Sequence[MeshLayer] = ()) -> SceneDistances:
    """Compares two files of a scene, or one with a mesh; what was compared last is kept.  meshes: of the document.  Raises
    InputError as :func:`compared_of`, :func:`compared_files` and viewer.work.comparing.compare do."""
    wanted = compared_of(comparison, meshes)
    if (known := _MADE.get(scene)) is not None and known.compared == wanted:
        return known
    before, after = compared_files(scene, comparison)
    numbers = np.zeros(0, np.int64) if before is None else _numbers_of(scene, before), _numbers_of(scene, after)
    one, other = (positions(scene, packed(scene, rows), rows) for rows in numbers)
    if before is None:
        found = from_layer(model_of(comparison, meshes), comparison, other)
    else:
        places = [scene.station_places[part.numbers.start : part.numbers.stop] for part in (before, after)]
        station = scan_numbers(packed(scene, numbers[1])).astype(np.int64) - after.numbers.start
        facing = facing_of(one if len(one) else np.zeros((1, 3)), *places)  # compare refuses what has no points
        found = compare(one, other, facing, method=comparison.method, station=station, registration=comparison.registration)
    made = SceneDistances(*numbers, found, wanted, scene.count)
    made.shown()  # refuses a mesh that nothing is near
    _MADE[scene] = made
    return made


def _numbers_of(scene: "Scene", part: FilePart) -> np.ndarray:
    wanted = np.zeros(256, bool)
    wanted[part.numbers.start : part.numbers.stop] = True
    found = [np.zeros(0, np.int64)]
    for start in range(0, scene.count, _BLOCK):
        words = packed(scene, slice(start, min(start + _BLOCK, scene.count)))
        found.append(start + np.flatnonzero(wanted[scan_numbers(words)]))
    return np.concatenate(found)


def coloured(scene: "Scene", made: SceneDistances, edits: Edits, comparison: DateComparison) -> Coloured:
    """Levels of the points as a comparison shows them.  edits: with which they will be drawn."""
    shown_distances = made.shown(comparison.limit)
    distance, uncertainty = shown_distances.distance, shown_distances.uncertainty
    found = statistics_of(distance, uncertainty, comparison.limit)
    levels = np.full(made.count, LEFT_OUT, np.uint8)
    shown = comparison.shown
    if comparison.with_model and shown != "change":  # points of other files, too
        levels[:] = 0
    if shown == "change":
        levels[made.after] = levels_of(distance, uncertainty, found.limit, certain=comparison.certain)
    else:
        levels[made.after if shown == "after" else made.before] = 0
    changes = PointLevels(levels, level_colours() if shown == "change" else None)
    levelled_marks(scene, replace(edits, changes=changes))  # made here, and not in the next picture
    return Coloured(changes, found)


def with_changes(scene: "Scene", edits: Edits) -> Edits:
    """The edits with the levels of their comparison, where they have one.  Raises InputError as :func:`distances_in`."""
    if edits.changes is not None or (made := changes_of(scene, edits)) is None:
        return edits
    return replace(edits, changes=made.levels)


def changes_of(scene: "Scene", edits: Edits) -> Coloured | None:
    """What the comparison of edits shows; None where they have none.  Raises InputError as :func:`distances_in`."""
    if edits.comparison is None:
        return None
    return coloured(scene, distances_in(scene, edits.comparison, edits.meshes), edits, edits.comparison)


def spec_with_changes(scene: "Scene", spec: "PictureSpec") -> "PictureSpec":
    """The same for the description of a picture."""
    edits, other = with_changes(scene, spec.edits), spec.other_edits
    if other is not None:
        other = with_changes(scene, other)
    return spec if edits is spec.edits and other is spec.other_edits else replace(spec, edits=edits, other_edits=other)
