"""Work of the Compare tool on a thread, and small choices of it."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....picture.dates.date_comparison import DateComparison
from ....picture.edits import Edits
from ....work.comparing.scene_changes import Coloured, SceneDistances, coloured, distances_in

if TYPE_CHECKING:
    from ....grid.scene import Scene


def compare_work(scene: "Scene", comparison: DateComparison) -> Callable[[], tuple[DateComparison, SceneDistances]]:
    """Compares two files of a scene.  Raises InputError on the thread as viewer.work.comparing.scene_changes does."""
    return lambda: (comparison, distances_in(scene, comparison))


def colour_work(scene: "Scene", made: SceneDistances, edits: Edits, comparison: DateComparison
                ) -> Callable[[], tuple[DateComparison, Coloured]]:
    """Levels of the points for what is shown.  edits: with which they will be drawn."""
    return lambda: (comparison.in_picture, coloured(scene, made, edits, comparison))


def share_limit(made: SceneDistances, share: float) -> float | None:
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
