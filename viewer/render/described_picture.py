"""Pictures as a PictureSpec describes them: rendered, developed, and put together.

The window, F12, ``render``, films and Python all make their pictures here, so that the same description gives the same bytes.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ..picture.composition import joined
from ..picture.provenance import MODELLED, provenance
from ..picture.views import VIEWS
from ..readers.meshes.mesh_store import mesh_of
from .device.shader import Programs
from .meshes.mesh_pass import MeshPass, model_depth, model_pixels
from .passes.develop import Developer, needs, read_picture

if TYPE_CHECKING:
    import moderngl

    from ..picture.spec import PictureSpec
    from ..readers.meshes.mesh_data import MeshData
    from .culling.occlusion import Occlusion
    from .frame import Frame
    from .renderer import Renderer


def render(renderer: "Renderer", spec: "PictureSpec", history: "Occlusion | None" = None, *, more: tuple[str, ...] = (),
           streaming: bool = False, defer_network: bool = False, filled_depth: bool = False, keep_network: bool = False
           ) -> "Frame":
    """The views that a description shows, and those that it compares with.  more: views that are wanted besides.

    Of a description with two sides that show other points: one of its ``sides``.

    The other arguments, and errors, as of Renderer.render.
    """
    views = tuple(dict.fromkeys((*spec.rendered_views, *more)))
    return renderer.render(spec.camera, spec.settings, views, history, streaming=streaming, defer_network=defer_network,
                           edits=spec.edits, filled_depth=filled_depth or spec.shows_meshes, keep_network=keep_network)


def picture_of(renderer: "Renderer", spec: "PictureSpec") -> np.ndarray:
    """The picture that a description describes, as it is saved: (H, W, 3) uint8, with a transparent background (H, W, 4)."""
    composer = Composer(renderer.context)
    try:
        images = [image for side in spec.sides for image in composer.images(render(renderer, side), side)]
        return joined(images, spec.background, spec.titles, spec.split_at)
    finally:
        composer.release()


class Composer:
    """Develops the views of a frame as a description has them.

    Each developed view is made once and kept until the frame or what it depends on changes.  mesh_of: the triangles of a mesh's
    path, read where they are not in memory; None: that mesh is left out.  Owns GL objects: release it.
    """

    def __init__(self, context: "moderngl.Context", mesh_of: "Callable[[str], MeshData | None]" = mesh_of):
        self._programs, self._mesh_of = Programs(context), mesh_of
        self._developers: dict[str, Developer] = {}
        self._meshes: MeshPass | None = None
        self._made: dict[str, tuple[Frame, tuple, moderngl.Texture]] = {}

    def images(self, frame: "Frame", spec: "PictureSpec") -> list[np.ndarray]:
        """(H, W, 4) uint8, premultiplied, of each view shown, left first."""
        return [self.image(frame, view, spec) for view in spec.views]

    def image(self, frame: "Frame", view: str, spec: "PictureSpec") -> np.ndarray:
        """(H, W, 4) uint8, premultiplied, of a view of the frame."""
        if spec.shows_meshes or self._developed(frame, view, spec):
            return read_picture(self.texture(frame, view, spec))
        return frame.image(view)

    def provenance(self, frame: "Frame", spec: "PictureSpec") -> np.ndarray:
        """(H, W) uint8: where each pixel of the first view comes from, a key of viewer.picture.provenance.PROVENANCE."""
        view = spec.views[0]
        found = provenance(view, frame.image(view), frame.mask(), frame.from_photographs(view))
        if spec.shows_meshes:
            found[model_pixels(frame, view, self.meshes(frame).draw(frame, spec.edits))] = MODELLED
        return found

    def surface(self, frame: "Frame", spec: "PictureSpec") -> tuple[np.ndarray, np.ndarray]:
        """(H, W) float32, view-space depth of the filled view, 0 where nothing is, and (H, W) bool, where that was measured: a
        mesh has depth, and is not measured.  The frame was rendered with its filled depth."""
        assert frame.filled_depth is not None
        width, height = frame.filled_depth.size
        depth = np.frombuffer(frame.filled_depth.read(alignment=1), np.float32).reshape(height, width)
        measured = frame.mask() & (depth > 0)
        if not spec.shows_meshes:
            return depth, measured
        layers = self.meshes(frame).draw(frame, spec.edits)
        model = model_pixels(frame, "filled", layers)
        return np.where(model, model_depth(layers), depth), measured & ~model

    def texture(self, frame: "Frame", view: str, spec: "PictureSpec") -> "moderngl.Texture":
        """A view of the frame with the look, tint, lock and meshes of ``spec``: the frame's own texture where they change
        nothing.  Raises InputError where a mesh cannot be read."""
        developed = self._developed_view(frame, view, spec)
        if not spec.shows_meshes:
            return developed
        meshes = self.meshes(frame)
        developer = self._developers.get(view)
        shaped = developed is not frame.textures[view] and VIEWS[view].shows_points and spec.edits.look.shapes_points
        points = developer.nearest if shaped and developer and frame.ratio_depth is frame.depth_texture else None
        return meshes.over(frame, view, developed, spec.edits, points, tint=spec.tint)

    def meshes(self, frame: "Frame") -> MeshPass:
        """The pass that draws meshes at the frame's size."""
        if self._meshes is None or self._meshes.size != frame.depth_texture.size:
            if self._meshes is not None:
                self._meshes.release()
            self._meshes = MeshPass(self._programs, frame.depth_texture.size, self._mesh_of)
        return self._meshes

    def _developed_view(self, frame: "Frame", view: str, spec: "PictureSpec") -> "moderngl.Texture":
        """Without the meshes."""
        plain = frame.textures[view]
        asked = self._developed(frame, view, spec)
        if asked is None:
            return plain
        look, (tint, lock) = spec.edits.look, asked
        key = (look, tint, lock, frame.facts.network_pending)  # the network may add its picture later
        made = self._made.get(view)
        if made is not None and made[0] is frame and made[1] == key:
            return made[2]
        developer = self._developers.get(view)
        if developer is None or developer.size != plain.size:
            if developer is not None:
                developer.release()
            developer = self._developers[view] = Developer(self._programs, plain.size)
        texture = developer.run(frame, view, look, tint=tint, lock=lock)
        self._made[view] = frame, key, texture
        return texture

    def _developed(self, frame: "Frame", view: str, spec: "PictureSpec") -> tuple[bool, bool] | None:
        """Whether a view is tinted and locked; None where it is shown as it was rendered."""
        tint, lock = spec.tint, spec.edits.lock_measured
        if (tint or lock) and view != "raw" and "filtered" not in frame.textures:
            tint = lock = False  # of the frame before they were asked for
        return (tint, lock) if needs(spec.edits.look, view, tint=tint, lock=lock) else None

    def forget(self) -> None:
        """Releases the textures of the last pictures; they are made again when they are needed."""
        for developer in self._developers.values():
            developer.release()
        self._developers.clear()
        self._made.clear()
        if self._meshes is not None:
            self._meshes.release()
            self._meshes = None

    def release(self) -> None:
        self.forget()
        self._programs.release()
