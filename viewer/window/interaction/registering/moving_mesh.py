"""A mesh that the Align tool moves: its points on a thread to the scan's (ICP), and its step in the document.

Meshes are numbered after the files of the scene.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ....common.rigid_transform import Rows, combined
from ....common.text import printable
from ....picture.meshes.mesh_layer import MeshLayer
from ....readers.meshes.mesh_store import mesh_of
from ....work.comparing.compared_model import placed_vertices
from ....work.document import replaced
from ....work.meshes.laid_meshes import bounds_of
from ....work.meshes.pick_mesh import BESIDE_ELEMENT, ON_MODEL
from ....work.places.pick import Picked
from ....work.registration.align_mesh import align_mesh, mesh_words
from ....work.registration.moved_files import points_of
from ....work.scan_files import FilePart
from .refining import Moved

if TYPE_CHECKING:
    from ....grid.scene import Scene


def names_of(parts: Sequence[FilePart], meshes: Sequence[MeshLayer], name_of: Callable[[FilePart], str]) -> list[str]:
    """Of the files, and of the meshes after them; none without files."""
    return [name_of(part) for part in parts] + [f"model {printable(layer.name)}" for layer in meshes if parts]


def number_of(picked: Picked, parts: Sequence[FilePart], meshes: Sequence[MeshLayer]) -> int | None:
    """The file, or the mesh, that a picked place is of; None where it is of none.  Of meshes of one name the first."""
    if picked.scan == ON_MODEL:
        named = [f"model {layer.name}" for layer in meshes]
        return next((len(parts) + at for at, name in enumerate(named)
                     if picked.station == name or picked.station.startswith(name + BESIDE_ELEMENT)), None)
    return next((number for number, part in enumerate(parts) if picked.scan in part.numbers), None)


def is_of(layer: MeshLayer) -> Callable[[str], bool]:
    """Tells whether the scan that a point was picked on, as its measurement names it, is this mesh."""
    name = f"model {layer.name}"
    return lambda scan: scan == name or scan.startswith(name + BESIDE_ELEMENT)


def with_mesh_at(meshes: tuple[MeshLayer, ...], at: int, transform: Rows, unsure: float | None) -> tuple[MeshLayer, ...]:
    """The meshes of a document, one at another place, which is unsure by so much."""
    return replaced(meshes, at, replace(meshes[at], transform=transform, unsure=unsure))


def middle_of(layer: MeshLayer) -> np.ndarray:
    """(3,) of its box, the document's coordinates."""
    return bounds_of(layer, mesh_of(layer.path)).mean(axis=0)


def refine_mesh_work(scene: "Scene", parts: Sequence[FilePart], number: int, layer: MeshLayer, start: Rows,
                     unit: str) -> Callable[[], Moved]:
    """Aligns a mesh to all files of the scene.  start: its transformation to begin with.  Raises InputError on the thread as
    align_mesh does."""
    def work() -> Moved:
        mesh, begun = mesh_of(layer.path), replace(layer, transform=start)
        found = align_mesh(placed_vertices(begun, mesh), mesh.faces, points_of(scene, parts))
        after = combined(found.transform, start)
        return Moved(number, layer.transform, after, f"Refine the place of {layer.name}", mesh_words(found, unit),
                     found.surfaces.uncertainty)

    return work
