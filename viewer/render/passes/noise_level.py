"""Noise level of a picture, an input of the network: one compute pass between the depth filter and the fill.

The scan's noise (:class:`model.appearance.noise.NoiseModel`, estimated when its grid is built) is looked up at each measured
pixel and divided by the square root of how many points the rasteriser averaged there.  :mod:`model.reference.noise_level` is
the reference implementation.
"""

from typing import TYPE_CHECKING

import numpy as np

from ....model.appearance.noise import KNOTS, LUMA
from ....model.network.network_layout import NOISE_SCALE, TYPICAL_WEIGHT
from ..device.compute_pass import Pass

if TYPE_CHECKING:
    import moderngl

    from ....model.appearance.noise import NoiseModel
    from ...picture.camera import Camera
    from ..device.shader import Programs


def noise_scale(detail: float) -> float:
    """Factor of the estimated noise.  detail: 0 (smooth: twice the noise) to 2 (every measured grain: none)."""
    return NOISE_SCALE * (2.0 - detail)


class NoiseLevel:
    """Owns the scan's noise on the GPU and the target of one picture size; ``run`` fills ``level`` (R16F)."""

    def __init__(self, programs: "Programs", size: tuple[int, int], noise: "NoiseModel"):
        context = programs.context
        self.noise = noise
        self.level = context.texture(size, 1, dtype="f2")
        sigma = np.ascontiguousarray(noise.sigma, "<f4")
        self._sigma = context.texture3d(sigma.shape[::-1], 1, sigma.tobytes(), dtype="f4")
        self._pass = Pass(
            programs, "noise level", "noise_level.comp", outputs=("level",), inputs=("raw", "depth", "weight", "mask", "sigma"),
            uniforms=("lens", "parallel", "to_lattice", "eye", "scale", "point_weight", "curve"), KNOTS=KNOTS,
            LUMA_R=float(LUMA[0]), LUMA_G=float(LUMA[1]), LUMA_B=float(LUMA[2]))
        self._pass.set_uniforms(curve=noise.curve.astype(float).tolist())

    def run(self, raw: "moderngl.Texture", depth: "moderngl.Texture", weight: "moderngl.Texture", mask: "moderngl.Texture", *,
            camera: "Camera", weighted: bool, detail: float) -> None:
        """raw, depth, weight: a rasteriser's targets.  mask: keep-mask or confidence.  weighted: whether points have
        weights.  detail: of the settings."""
        voxel = self.noise.voxel
        self._pass.run(
            self.level, inputs={"raw": raw, "depth": depth, "weight": weight, "mask": mask, "sigma": self._sigma},
            lens=(camera.fx, camera.fy, camera.cx, camera.cy), parallel=camera.orthographic or 0.0,
            to_lattice=tuple((camera.view_rotation / voxel).ravel()),  # rows of world -> view: columns of view -> world
            eye=tuple((np.asarray(camera.position, np.float64) - self.noise.origin) / voxel),
            scale=noise_scale(detail), point_weight=TYPICAL_WEIGHT if weighted else 1.0)

    def release(self) -> None:
        self.level.release()
        self._sigma.release()
