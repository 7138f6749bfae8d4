"""Work of the Compare tool on a thread: distances between two files of a scene, and the levels that colour its points.

Points are the grid's, half a step off at most (Scene.step), in the document's coordinates; what is exported is compared again
from the files.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from ....grid.records.levelled_marks import levelled_marks
from ....grid.scene import packed, positions, scan_numbers
from ....picture.edits import Edits
from ....picture.point_sets import LEFT_OUT, PointLevels
from ....work.comparing.change_levels import level_colours, levels_of
from ....work.comparing.compare import Distances, compare
from ....work.comparing.distance_statistics import Statistics, statistics_of
from ....work.comparing.facing import facing_of
from ....work.scan_files import FilePart

if TYPE_CHECKING:
    from ....grid.scene import Scene

Shown = Literal["change", "after", "before"]
_BLOCK = 1 << 20


@dataclass(frozen=True, eq=False)
class Comparison:
    """before, after: (n,) and (m,) int64, numbers in the scene of the points of both files.  distances: of those of ``after``.
    names: of both files.  count: points of the scene."""

    before: np.ndarray
    after: np.ndarray
    distances: Distances
    names: tuple[str, str]
    count: int


@dataclass(frozen=True, eq=False)
class Coloured:
    """levels: of the scene's points.  found: figures, with the range of the colours."""

    levels: PointLevels
    found: Statistics


def compare_work(scene: "Scene", before: FilePart, after: FilePart, method: str, registration: float
                 ) -> Callable[[], Comparison]:
    """Compares two files of a scene.  Raises InputError on the thread as viewer.work.comparing.compare does."""

    def work() -> Comparison:
        numbers = _numbers_of(scene, before), _numbers_of(scene, after)
        clouds = [positions(scene, packed(scene, rows), rows) for rows in numbers]
        places = [scene.station_places[part.numbers.start : part.numbers.stop] for part in (before, after)]
        station = scan_numbers(packed(scene, numbers[1])).astype(np.int64) - after.numbers.start
        one, other = clouds
        facing = facing_of(one if len(one) else np.zeros((1, 3)), *places)  # compare refuses what has no points
        found = compare(one, other, facing, method=method, station=station, registration=registration)
        return Comparison(*numbers, found, (Path(before.path).name, Path(after.path).name), scene.count)

    return work


def _numbers_of(scene: "Scene", part: FilePart) -> np.ndarray:
    wanted = np.zeros(256, bool)
    wanted[part.numbers.start : part.numbers.stop] = True
    found = [np.zeros(0, np.int64)]
    for start in range(0, scene.count, _BLOCK):
        words = packed(scene, slice(start, min(start + _BLOCK, scene.count)))
        found.append(start + np.flatnonzero(wanted[scan_numbers(words)]))
    return np.concatenate(found)


def colour_work(scene: "Scene", made: Comparison, edits: Edits, shown: Shown, limit: float | None, *, certain: bool
                ) -> Callable[[], Coloured]:
    """Levels of the points for what is shown.  edits: with which they will be drawn.  limit: where the colours end, file units;
    None: chosen by the changes.  certain: only changes above their uncertainty have a colour."""

    def work() -> Coloured:
        distance, uncertainty = made.distances.distance, made.distances.uncertainty
        found = statistics_of(distance, uncertainty, limit)
        levels = np.full(made.count, LEFT_OUT, np.uint8)
        if shown == "change":
            levels[made.after] = levels_of(distance, uncertainty, found.limit, certain=certain)
        else:
            levels[made.after if shown == "after" else made.before] = 0
        changes = PointLevels(levels, level_colours() if shown == "change" else None)
        levelled_marks(scene, replace(edits, changes=changes))  # made here, and not in the next picture
        return Coloured(changes, found)

    return work


def share_limit(made: Comparison, share: float) -> float | None:
    """The distance that a share of the known distances does not exceed, to two digits; None where none is known."""
    known = np.abs(made.distances.distance[np.isfinite(made.distances.distance)])
    if not len(known) or not (value := float(np.quantile(known, share))) > 0:
        return None
    return float(f"{value:.2g}")


def fresh_folder(parent: Path, name: str) -> Path:
    """A folder that is not there yet."""
    found, number = parent / name, 2
    while found.exists():
        found, number = parent / f"{name}-{number}", number + 1
    return found
