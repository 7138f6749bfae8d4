"""The meshes of one picture: the nearest opaque one and the nearest one that is not opaque at each pixel, and what a picture of
points becomes with them.

In software OpenGL and on a GPU alike the triangles are drawn in compiled loops on the processor, in float64: the same bytes
everywhere, and no precision is lost far from zero.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ....model.common.process.processors import in_rows
from ...picture.camera import Camera
from ...picture.clip import Clip
from ...picture.meshes.clip_rows import clip_rows
from ...picture.meshes.mesh_layer import MeshLayer
from ...readers.meshes.mesh_data import MeshData
from .mesh_loops import nearest_rows, triangle_boxes, view_places
from .shade_loops import shade_rows

_MANY = 1 << 15
"""Vertices or triangles of a thread at least."""
_FEW = 16
"""Rows of a thread at least."""
_FAR = np.float32(np.inf)


@dataclass(frozen=True, eq=False)
class MeshLayers:
    """Of each pixel, row 0 at the top: depths (H, W) float32, view-space z in units of the document, +inf where there is no
    mesh; colours (H, W) uint32, RGBA8 premultiplied, 0 there."""

    opaque: np.ndarray
    opaque_depth: np.ndarray
    clear: np.ndarray
    clear_depth: np.ndarray

    @staticmethod
    def empty(width: int, height: int) -> "MeshLayers":
        """Of a picture without a mesh."""
        return MeshLayers(np.zeros((height, width), np.uint32), np.full((height, width), _FAR, np.float32),
                          np.zeros((height, width), np.uint32), np.full((height, width), _FAR, np.float32))


def draw_meshes(camera: Camera, layers: tuple[MeshLayer, ...], clips: tuple[Clip, ...],
                mesh_of: Callable[[str], MeshData | None]) -> MeshLayers:
    """The meshes as a camera sees them.  layers: those that are shown.  clips: of the document, which cut meshes as they do
    points.  mesh_of: the triangles of a path; None: left out."""
    made = MeshLayers.empty(camera.width, camera.height)
    number = np.full((camera.height, camera.width), -1, np.int32)
    cut = clip_rows(clips, camera.view_rotation, camera.position)
    for layer in layers:
        if (mesh := mesh_of(layer.path)) is not None:
            alpha = max(1, round(255 * layer.opacity))
            colour, depth = (made.opaque, made.opaque_depth) if alpha == 255 else (made.clear, made.clear_depth)
            draw_mesh(camera, layer, mesh, cut, alpha, number, colour, depth)
    return made


def draw_mesh(camera: Camera, layer: MeshLayer, mesh: MeshData, cut: tuple[np.ndarray, np.ndarray], alpha: int,
              number: np.ndarray, colour: np.ndarray, depth: np.ndarray) -> None:
    """Draws one mesh into ``colour`` and ``depth`` where it is nearer.  cut: of clip_rows.  number: (H, W) int32, all -1
    before and after."""
    matrix = layer.matrix
    turned = camera.view_rotation @ matrix[:3, :3]
    to_view = np.column_stack([turned, camera.view_rotation @ (matrix[:3, 3] - camera.position)])
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy, camera.orthographic or 0.0], np.float64)
    view, boxes = np.empty_like(mesh.vertices), np.empty((len(mesh.faces), 4), np.int32)
    in_rows(len(view), _MANY, view_places, mesh.vertices, to_view, view)
    in_rows(len(boxes), _MANY, triangle_boxes, view, mesh.faces, lens, camera.width, camera.height, boxes)
    in_rows(camera.height, _FEW, nearest_rows, view, mesh.faces, boxes, lens, *cut, depth, number)
    chosen = np.array(layer.colour or (-1, -1, -1), np.int64)
    pictures = mesh.textures
    in_rows(camera.height, _FEW, shade_rows, view, mesh.faces, turned / layer.scale, mesh.normals, mesh.rgb, pictures.of_face,
            pictures.uv, pictures.texels, pictures.levels, lens, chosen, alpha, number, colour)
    number.fill(-1)


def composed(picture: np.ndarray, depth: np.ndarray, meshes: MeshLayers) -> np.ndarray:
    """The reference of shaders/mesh_over.comp.  picture: (H, W, 4) uint8, premultiplied.  depth: (H, W) float32 of the picture,
    0 or +inf where it is unknown: such pixels are behind everything.  Returns (H, W, 4) uint8."""
    height, width = depth.shape
    points_z = np.where(depth > 0, depth, _FAR)
    layers = [(points_z, picture), *((z, words.view(np.uint8).reshape(height, width, 4)) for z, words in (
        (meshes.opaque_depth, meshes.opaque), (meshes.clear_depth, meshes.clear)))]
    order = np.argsort(np.stack([z for z, _ in layers]), axis=0, kind="stable")
    stacked = np.stack([colour for _, colour in layers]).astype(np.int64)
    nearest, middle, farthest = (np.take_along_axis(stacked, order[i][None, ..., None], 0)[0] for i in range(3))
    return _over(_over(nearest, middle), farthest).astype(np.uint8)


def _over(top: np.ndarray, below: np.ndarray) -> np.ndarray:
    return top + (below * (255 - top[..., 3:]) + 127) // 255
