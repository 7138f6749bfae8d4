"""Lays the meshes of a description over the developed views of a frame, by depth."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ...picture.meshes.mesh_layer import shown_meshes
from ...picture.provenance import MODELLED
from ...picture.provenance_tint import COLOURS
from ...picture.views import VIEWS
from ...readers.meshes.mesh_data import MeshData
from ..device.compute_pass import Pass
from .mesh_layers import MeshLayers, draw_meshes

if TYPE_CHECKING:
    import moderngl

    from ...picture.camera import Camera
    from ...picture.edits import Edits
    from ..device.shader import Programs


class Rendered(Protocol):
    """What meshes are laid over: a viewer.render.frame.Frame."""

    @property
    def camera(self) -> "Camera": ...

    @property
    def depth_texture(self) -> "moderngl.Texture": ...

    @property
    def mask_texture(self) -> "moderngl.Texture | None": ...

    @property
    def filled_depth(self) -> "moderngl.Texture | None": ...

    def image(self, view: str) -> np.ndarray: ...

    def mask(self) -> np.ndarray: ...


class MeshPass:
    """Owns the meshes' textures of one picture size, and a result for each view.  mesh_of: the triangles of a path; None: that
    mesh is left out."""

    def __init__(self, programs: "Programs", size: tuple[int, int], mesh_of: Callable[[str], MeshData | None]):
        self.size, self._context, self._mesh_of = size, programs.context, mesh_of
        make = programs.context.texture
        self._colours = [make(size, 4, dtype="f1") for _ in range(2)]
        self._depths = [make(size, 1, dtype="f4") for _ in range(2)]
        self._results: dict[str, moderngl.Texture] = {}
        self._pass = Pass(programs, "meshes", "mesh_over.comp", outputs=("result",), uniforms=("masked",),
                          inputs=("picture", "depth", "mask", "opaque", "opaque_depth", "clear", "clear_depth"))
        self.layers: MeshLayers | None = None
        self._drawn: tuple[Rendered, tuple] | None = None

    def draw(self, frame: Rendered, edits: "Edits", *, tint: bool = False) -> MeshLayers:
        """The meshes as the frame's camera sees them; drawn once for a frame.  tint: in the colour of their provenance.
        Raises InputError where a file cannot be read."""
        key = edits.meshes, edits.clips, tint
        if self.layers is None or self._drawn is None or self._drawn[0] is not frame or self._drawn[1] != key:
            shown = shown_meshes(edits.meshes)
            if tint:
                shown = tuple(replace(layer, colour=COLOURS[MODELLED]) for layer in shown)
            made = self.layers = draw_meshes(frame.camera, shown, edits.clips, self._mesh_of)
            self._colours[0].write(made.opaque)
            self._colours[1].write(made.clear)
            self._depths[0].write(made.opaque_depth)
            self._depths[1].write(made.clear_depth)
            self._drawn = frame, key
        return self.layers

    def over(self, frame: Rendered, view: str, picture: "moderngl.Texture", edits: "Edits",
             points: "moderngl.Texture | None" = None, *, tint: bool = False) -> "moderngl.Texture":
        """The picture of a view with the meshes; valid until the next call for that view.  points: depth of enlarged points,
        where the picture shows these."""
        self.draw(frame, edits, tint=tint)
        depth, mask = view_depth(frame, view)
        if points is not None:
            depth, mask = points, None
        if view not in self._results:
            self._results[view] = self._context.texture(self.size, 4, dtype="f1")
        result = self._results[view]
        self._pass.run(result, masked=int(mask is not None), inputs={
            "picture": picture, "depth": depth, "mask": mask or picture, "opaque": self._colours[0],
            "opaque_depth": self._depths[0], "clear": self._colours[1], "clear_depth": self._depths[1]})  # fmt: skip
        return result

    def release(self) -> None:
        for texture in (*self._colours, *self._depths, *self._results.values()):
            texture.release()


def view_depth(frame: Rendered, view: str) -> "tuple[moderngl.Texture, moderngl.Texture | None]":
    """The depth of what a view shows, 0 or +inf where it is unknown, and the mask of pixels where it counts, None: everywhere.

    Raw and filtered views show the points' depth; a filled or neural view that of the filled picture.
    """
    passes = VIEWS[view].passes
    if "fill" in passes and frame.filled_depth is not None:
        return frame.filled_depth, None
    return frame.depth_texture, frame.mask_texture if "filter" in passes else None


def model_pixels(frame: Rendered, view: str, layers: MeshLayers) -> np.ndarray:
    """(H, W) bool: pixels of a view that show a mesh for the larger part."""
    depth, mask = view_depth(frame, view)
    height, width = layers.opaque.shape
    z = np.frombuffer(depth.read(alignment=1), np.float32).reshape(height, width)
    z = np.where(z > 0, z, np.float32(np.inf))
    if mask is not None:
        z = np.where(frame.mask(), z, np.float32(np.inf))
    shown = frame.image(view)[..., 3]
    opaque, clear = ((alpha >= 128) & ((nearest < z) | (shown < 128)) for alpha, nearest in (
        (layers.opaque >> np.uint32(24), layers.opaque_depth), (layers.clear >> np.uint32(24), layers.clear_depth)))
    return opaque | clear


def model_depth(layers: MeshLayers) -> np.ndarray:
    """(H, W) float32: depth of the nearest mesh that shows for the larger part, +inf where there is none."""
    return np.minimum(*(np.where(alpha >> np.uint32(24) >= 128, nearest, np.float32(np.inf)) for alpha, nearest in (
        (layers.opaque, layers.opaque_depth), (layers.clear, layers.clear_depth))))
