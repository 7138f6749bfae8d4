"""The place on a mesh that is seen at a position of the picture: not behind what the scan shows there."""

from typing import TYPE_CHECKING

import numpy as np

from ....picture.meshes.mesh_layer import shown_meshes
from ....picture.views import VIEWS
from ....readers.meshes.mesh_store import kept_mesh
from ....work.meshes.pick_mesh import pick_mesh
from ....work.places.pick import Picked

if TYPE_CHECKING:
    from ....picture.camera import Camera
    from ....render.frame import Frame
    from ..tool import ToolContext

_MOST_HOVERED = 300_000
"""Triangles that are looked through while the pointer hovers; a click looks through any number.  1.3 million took 40 to 55 ms
on a busy machine."""


def seen_mesh(context: "ToolContext", frame: "Frame", camera: "Camera", at: tuple[float, float], mask: np.ndarray,
              depth: np.ndarray, *, wait: bool) -> Picked | None:
    """The mesh's place at a pixel position; None where no mesh is seen.

    camera: of the frame.  mask, depth: of it, as read.  wait: for what else must be read; while hovering a large mesh is not
    looked through.
    """
    layers = shown_meshes(context.document.meshes)
    row, column = int(np.floor(at[1])), int(np.floor(at[0]))
    if not layers or not (0 <= row < depth.shape[0] and 0 <= column < depth.shape[1]):
        return None
    triangles = sum(len(mesh.faces) for layer in layers if (mesh := kept_mesh(layer.path)) is not None)
    if not wait and triangles > _MOST_HOVERED:
        return None
    hit = pick_mesh(layers, context.document.clips, camera, at)
    if hit is None:
        return None
    passes, shown = VIEWS[context.session.screen.drawn[-1]].passes, depth
    if "fill" in passes and frame.filled_depth is not None:
        filled = context.viewport.pixels.read(frame, "filled depth", texture=frame.filled_depth, wait=wait)
        if filled is None:
            return None
        shown = np.where(filled > 0, filled, np.inf)
    elif "filter" in passes and not mask[row, column]:
        return hit[0]
    return hit[0] if hit[1] < float(shown[row, column]) else None
