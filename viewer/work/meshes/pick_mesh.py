"""Picking on meshes: where the ray through a position of the picture meets the nearest triangle, exactly.

Frame: the document's coordinates, float64.
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...picture.clip import Clip
from ...picture.meshes.clip_rows import clip_rows
from ...picture.meshes.mesh_layer import MeshLayer
from ...readers.meshes.mesh_data import MeshData
from ...readers.meshes.mesh_store import kept_mesh
from ...readers.meshes.ray_loops import ray_hit
from ..places.pick import Picked

if TYPE_CHECKING:
    from ...picture.camera import Camera

ON_MODEL = -1
"""``Picked.index`` and ``Picked.scan`` of a place on a mesh, which is no point of the scene."""
BESIDE_ELEMENT = " · "
"""Between the name of a mesh and that of an element."""


def pick_mesh(layers: Sequence[MeshLayer], clips: tuple[Clip, ...], camera: "Camera", at: tuple[float, float],
              mesh_of: Callable[[str], MeshData | None] = kept_mesh) -> tuple[Picked, float] | None:
    """The nearest place of the meshes on the ray through ``at``, pixels of the picture, and its view-space depth; None where
    there is none.  layers: those that are shown.  clips: of the document.

    Picked.station is "model", the name of the mesh, and that of the building's element where its file tells it; its place needs
    no file to be read and has no measured neighbours.
    """
    begin, way = camera.ray(at)
    best: tuple[float, MeshLayer, MeshData, int] | None = None
    for layer in layers:
        if (mesh := mesh_of(layer.path)) is None:
            continue
        linear, shift = layer.matrix[:3, :3], layer.matrix[:3, 3]
        cut = clip_rows(clips, np.ascontiguousarray(linear.T), shift)
        back = np.linalg.inv(linear)
        face, along = ray_hit(mesh.vertices, mesh.faces, back @ (begin - shift), back @ way, *cut)
        if face >= 0 and (best is None or along < best[0]):
            best = float(along), layer, mesh, int(face)
    if best is None:
        return None
    along, layer, mesh, face = best
    x, y, z = (begin + along * way).tolist()
    red, green, blue = layer.colour or tuple(int(value) for value in mesh.rgb[mesh.faces[face]].mean(axis=0))
    pixel = int(np.floor(at[0])), int(np.floor(at[1]))
    element = mesh.element(face)
    name = f"model {layer.name}{BESIDE_ELEMENT}{element}" if element else f"model {layer.name}"
    picked = Picked(ON_MODEL, (x, y, z), along, (red, green, blue), None, ON_MODEL, name, pixel, exact=True)
    return picked, along * float(way @ camera.forward)
