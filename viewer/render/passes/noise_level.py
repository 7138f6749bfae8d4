"""Noise level of a picture, an input of the network: one compute pass between the depth filter and the fill.

The scan's noise (:class:`model.appearance.noise.NoiseModel`, estimated when its grid is built) is looked up at each measured
pixel and divided by the square root of how many points the rasteriser averaged there.  :mod:`model.reference.noise_level` is
the reference implementation.
"""

from typing import TYPE_CHECKING

import numpy as np

from ....model.appearance.noise import KNOTS, LUMA
from ....model.common.process.processors import in_rows
from ....model.network.network_layout import NOISE_SCALE, TYPICAL_WEIGHT
from ..device.compute_pass import Pass
from .noise_loops import Lattice, noise_rows

if TYPE_CHECKING:
    import moderngl

    from ....model.appearance.noise import NoiseModel
    from ...picture.camera import Camera
    from ..device.shader import Programs


def noise_scale(detail: float) -> float:
    """Factor of the estimated noise.  detail: 0 (smooth: twice the noise) to 2 (every measured grain: none)."""
    return NOISE_SCALE * (2.0 - detail)


_LEAST_ROWS = 16
"""Fewest rows of a thread."""


class NoiseLevel:
    """Owns the scan's noise on the GPU and the target of one picture size; ``run`` fills ``level`` (R16F), ``run_here`` fills
    ``levels``, (P,) float32, in compiled loops with the same values."""

    def __init__(self, programs: "Programs", size: tuple[int, int], noise: "NoiseModel"):
        context = programs.context
        self.noise = noise
        self.level = context.texture(size, 1, dtype="f2")
        self.levels = np.empty(0, np.float32)
        self._lattice = sigma = np.array(noise.sigma, "<f4", order="C")
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

    def run_here(self, colours: np.ndarray, depths: np.ndarray, points: np.ndarray, weights: np.ndarray, *, camera: "Camera",
                 weighted: bool, detail: float) -> np.ndarray:
        """As :meth:`run`, from the arrays of the processor's rasteriser; weights (P,) float32.  Returns ``levels``."""
        (width, height), voxel = self.level.size, self.noise.voxel
        if not len(self.levels):
            self.levels = np.empty(width * height, np.float32)
        eye = (np.asarray(camera.position, np.float64) - self.noise.origin) / voxel
        lens, curve = (camera.fx, camera.fy, camera.cx, camera.cy), np.array(self.noise.curve, np.float32)
        lattice = Lattice(self._lattice, curve, np.array(lens, np.float32),
                          np.ascontiguousarray(camera.view_rotation / voxel, np.float32),
                          eye.astype(np.float32), np.asarray(LUMA, np.float32), np.float32(camera.orthographic or 0.0),
                          np.float32(noise_scale(detail)), np.float32(TYPICAL_WEIGHT if weighted else 1.0))
        in_rows(height, _LEAST_ROWS, noise_rows, colours, depths, points, weights, lattice, width, self.levels)
        return self.levels

    def release(self) -> None:
        self.level.release()
        self._sigma.release()
