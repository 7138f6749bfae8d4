"""Work of the Compare tool on a thread, and small choices of it."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....picture.dates.date_comparison import ChangeFigures, DateComparison
from ....picture.edits import Edits
from ....picture.meshes.mesh_layer import MeshLayer
from ....work.comparing.compared_model import model_of, place_of_model
from ....work.comparing.scene_changes import Coloured, SceneDistances, coloured, distances_in

if TYPE_CHECKING:
    from ....grid.scene import Scene


def compare_work(scene: "Scene", comparison: Callable[[], DateComparison], meshes: Sequence[MeshLayer]
                 ) -> Callable[[], tuple[DateComparison, SceneDistances]]:
    """Compares two files of a scene, or one with a mesh.  comparison: made on the thread, where a mesh may have to be read.
    Raises InputError on the thread as viewer.work.comparing.scene_changes does."""
    def work() -> tuple[DateComparison, SceneDistances]:
        made = comparison()
        return made, distances_in(scene, made, meshes)

    return work


def place_key(comparison: DateComparison | None, meshes: Sequence[MeshLayer]) -> object:
    """What a comparison that cannot be shown is known by: it is tried again where this has changed."""
    if comparison is None or not comparison.with_model:
        return comparison
    return comparison, tuple(place_of_model(layer) for layer in meshes if layer.name == comparison.before[0])


def with_model_hidden(meshes: tuple[MeshLayer, ...], comparison: DateComparison) -> tuple[MeshLayer, ...]:
    """The meshes without that of a comparison being shown: it would cover the colours of the points behind it."""
    if not comparison.with_model:
        return meshes
    layer = model_of(comparison, meshes)
    return tuple(replace(other, visible=False) if other is layer else other for other in meshes)


def colour_work(scene: "Scene", made: SceneDistances, edits: Edits, comparison: DateComparison
                ) -> Callable[[], tuple[DateComparison, Coloured]]:
    """Levels of the points for what is shown.  edits: with which they will be drawn."""
    return lambda: (comparison.in_picture, coloured(scene, made, edits, comparison))


def share_limit(made: SceneDistances, share: float) -> float | None:
    """The distance that a share of the known distances does not exceed, to two digits; None where none is known."""
    distance = made.shown().distance
    known = np.abs(distance[np.isfinite(distance)])
    if not len(known) or not (value := float(np.quantile(known, share))) > 0:
        return None
    return float(f"{value:.2g}")


def fresh_folder(parent: Path, name: str) -> Path:
    """A folder that is not there yet."""
    found, number = parent / name, 2
    while found.exists():
        found, number = parent / f"{name}-{number}", number + 1
    return found


def differing(known: DateComparison, now: ChangeFigures) -> list[str]:
    """Lines that say what a comparison found when the project was saved, and what it finds now."""
    assert known.figures is not None
    then = known.figures
    texts = [f"{figures.changed:,} of {figures.points:,} points changed, median " +
             ("unknown" if figures.median is None else f"{figures.median:.3g}") for figures in (then, now)]
    return [f"{known.before[0]} and {known.after[0]}: {texts[0]} when it was saved; now {texts[1]}. A file, its place or this "
            "program is another one."]
