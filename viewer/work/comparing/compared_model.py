"""The mesh of a comparison: which of a document's meshes it is, where it stands, and the distances of points from it.

Frame: the document's coordinates, float64.
"""

from collections.abc import Sequence

import numpy as np

from ...common.errors import InputError
from ...common.rigid_transform import Rows
from ...picture.dates.date_comparison import FROM_MODEL, DateComparison
from ...picture.meshes.mesh_layer import MeshLayer
from ...picture.point_sets import FileKey
from ...readers.meshes.mesh_data import MeshData
from ...readers.meshes.mesh_store import mesh_of
from .compare import Distances
from .model_distances import distances_from_model

ModelPlace = tuple[str, str, Rows, str, float]
"""Path, checksum, transform, up axis and scale of a mesh."""
_FEWEST = 100
"""Points of a scan that are compared, at least."""


def model_of(comparison: DateComparison, meshes: Sequence[MeshLayer]) -> MeshLayer:
    """The mesh of a comparison among those of a document, shown or not.  Raises InputError where it is not there."""
    named = [layer for layer in meshes if layer.name == comparison.before[0]]
    if comparison.model >= len(named):
        raise InputError(f"the comparison of {comparison.after[0]} cannot be shown: {comparison.before[0]} is not beside it",
                         remedy="add it again with the tool Meshes")
    return named[comparison.model]


def with_model(after: FileKey, meshes: Sequence[MeshLayer], number: int, registration: float) -> DateComparison:
    """The comparison of a file with the mesh of this number, which is read where it is not in memory.  Raises InputError where
    it cannot be read."""
    layer = meshes[number]
    triangles = len(mesh_of(layer.path).faces)
    earlier = sum(other.name == layer.name for other in meshes[:number])
    return DateComparison((layer.name, triangles), after, FROM_MODEL, registration, model=earlier)


def place_of_model(layer: MeshLayer) -> ModelPlace:
    """What decides where the triangles of a mesh are."""
    return layer.path, layer.checksum, layer.transform, layer.up, layer.scale


def placed_vertices(layer: MeshLayer, mesh: MeshData) -> np.ndarray:
    """(V, 3) float64, the document's coordinates."""
    matrix = layer.matrix
    return mesh.vertices @ matrix[:3, :3].T + matrix[:3, 3]


def from_layer(layer: MeshLayer, comparison: DateComparison, xyz: np.ndarray) -> Distances:
    """Distances of (n, 3) points from a mesh, near or far, which is read where it is not in memory.  Raises InputError where it
    is another one than it was, and where it cannot be read; Cancelled."""
    mesh = mesh_of(layer.path)
    if len(mesh.faces) != comparison.before[1]:
        raise InputError(f"the comparison with {layer.name} cannot be shown: it has {len(mesh.faces):,} triangles now, and had "
                         f"{comparison.before[1]:,}", remedy="compare them again")
    return distances_of(layer, mesh, xyz, comparison.registration)


def distances_of(layer: MeshLayer, mesh: MeshData, xyz: np.ndarray, registration: float) -> Distances:
    """The same of a mesh that was read.  registration: as viewer.work.comparing.model_distances."""
    if len(xyz) < _FEWEST:
        raise InputError(f"the scan has {len(xyz):,} points, at least {_FEWEST} are compared")
    return distances_from_model(placed_vertices(layer, mesh), mesh.faces, xyz, registration=registration)
