"""The depth of an orthographic picture as the passes made for pinholes take it; model/reference/parallel_depth.py says why."""

from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ....model.reference.parallel_depth import MOST_DOUBLINGS, doublings_a_unit
from ..device.compute_pass import Pass

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ..device.shader import Programs


def middle_depth(camera: "Camera", scene: "Scene") -> float:
    """The middle of the depths of a scene's bounds, as far as they lie in front of the camera; view space, file units."""
    corners = np.array([[scene.bounds[i >> k & 1, k] for k in range(3)] for i in range(8)])
    depths = np.clip((corners - camera.position) @ camera.forward, 0.0, None)
    return float(depths.min() + depths.max()) / 2


class ParallelDepth:
    """Owns the target of one picture size; ``run`` fills ``depth`` (R32F, +inf where empty)."""

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        self.context = programs.context
        self.depth = self.context.texture(size, 1, dtype="f4")
        self._pass = Pass(programs, "parallel depth", "parallel_depth.comp", outputs=("made",), inputs=("depth",),
                          uniforms=("scale",), MOST_DOUBLINGS=MOST_DOUBLINGS)

    def run(self, depth: moderngl.Texture, camera: "Camera", middle: float) -> moderngl.Texture:
        """depth: view-space z of an orthographic camera's picture.  middle: :func:`middle_depth`."""
        assert camera.orthographic is not None
        self._pass.run(self.depth, inputs={"depth": depth},
                       scale=(camera.orthographic, middle, doublings_a_unit(camera.orthographic)))
        return self.depth

    def release(self) -> None:
        self.depth.release()
