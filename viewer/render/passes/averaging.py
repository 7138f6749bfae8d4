"""Averaging in sparse places, before the fill: two compute passes, or compiled loops, that lower the weight of measured pixels
where points are few and noisy.  ``model/reference/pull_push.py`` is the reference implementation and says why."""

from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import in_rows
from ....model.network.network_layout import DEPTH_FEATURE_LIMIT, DEPTH_FEATURE_SCALE, NOISE_SCALE
from ....model.reference.fill_constants import DENSITY_BLOCK, NEAR_DOUBLINGS, NEAR_SPREAD, NOISE_UNIT
from ..device.compute_pass import Pass
from .averaging_loops import Sparse, block_rows, weigh_rows

if TYPE_CHECKING:
    import moderngl

    from ....model.appearance.noise import NoiseModel
    from ....model.reference.fill_constants import Averaging
    from ...picture.edits import Edits
    from ...picture.settings import Settings
    from ..device.shader import Programs

_PER_LEVEL = 1.0 / (NOISE_UNIT * NOISE_SCALE) ** 2
"""Averaged points for each square of a noise level."""
_LEAST_ROWS = 16
"""Fewest rows of a thread, of pixels or blocks."""


def widening_of(settings: "Settings", edits: "Edits | None", noise: "NoiseModel | None", averaging: "Averaging") -> float:
    """:meth:`model.reference.fill_constants.Averaging.widening` of a picture, 0 where nothing is averaged: scans of little
    noise, presets of the published programs, and points in other colours than their own."""
    recoloured = edits is not None and edits.recolours
    if noise is None or recoloured or settings.filter != "auto" or settings.soft_z != "auto":
        return 0.0
    return averaging.widening(noise.overall)


class AveragingPass:
    """Owns the targets of one picture size; ``run`` fills ``averaged`` (R32F), the weight of each pixel, 0 where nothing is
    measured.  ``run_here`` returns the same weights, (P,) float32, from arrays."""

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        self.averaged = programs.context.texture(size, 1, dtype="f4")
        self._blocks = programs.context.texture((-(-size[0] // DENSITY_BLOCK), -(-size[1] // DENSITY_BLOCK)), 4, dtype="f4")
        constants = {"BLOCK": DENSITY_BLOCK, "FEATURE_SCALE": DEPTH_FEATURE_SCALE, "FEATURE_LIMIT": DEPTH_FEATURE_LIMIT}
        self._count = Pass(programs, "averaging, blocks", "averaging.comp", outputs=("blocks",), inputs=("mask", "depth"),
                           uniforms=("feature_scale",), BLOCKS=1, **constants)
        self._weigh = Pass(programs, "averaging", "averaging.comp", outputs=("averaged",),
                           inputs=("mask", "depth", "blocks", "level"), uniforms=("feature_scale", "ramp", "per_level"),
                           NEAR_SPREAD=NEAR_SPREAD, NEAR_SCALE=1.0 / (NEAR_DOUBLINGS * DEPTH_FEATURE_SCALE), **constants)
        self._weigh.set_uniforms(per_level=_PER_LEVEL)
        self._weights = np.empty(0, np.float32)
        self._block_sums = np.empty((self._blocks.height, self._blocks.width, 3), np.float32)

    def run(self, mask: "moderngl.Texture", level: "moderngl.Texture", depth: "moderngl.Texture", feature_scale: float,
            by: "Averaging") -> None:
        """mask: keep-mask or confidence.  level: of NoiseLevel, with detail 1.  depth, feature_scale: as of Fill."""
        self._count.run(self._blocks, inputs={"mask": mask, "depth": depth}, feature_scale=feature_scale)
        self._weigh.run(self.averaged, inputs={"mask": mask, "depth": depth, "blocks": self._blocks, "level": level},
                        feature_scale=feature_scale, ramp=_ramp(by))

    def run_here(self, weights: np.ndarray, levels: np.ndarray, depths: np.ndarray, feature_scale: float, by: "Averaging"
                 ) -> np.ndarray:
        """As :meth:`run`, in compiled loops, from (P,) float32 arrays; the result is kept until the next run."""
        width, height = self.averaged.size
        if not len(self._weights):
            self._weights = np.empty(width * height, np.float32)
        dense, slope = _ramp(by)
        sparse = Sparse(np.float32(feature_scale), np.float32(dense), np.float32(slope), np.float32(_PER_LEVEL))
        in_rows(len(self._block_sums), _LEAST_ROWS, block_rows, weights, depths, sparse, width, height, self._block_sums)
        in_rows(height, _LEAST_ROWS, weigh_rows, weights, depths, levels, self._block_sums, sparse, width, self._weights)
        return self._weights

    def release(self) -> None:
        """Frees the targets."""
        self.averaged.release()
        self._blocks.release()


def _ramp(by: "Averaging") -> tuple[float, float]:
    """Square of the distance between points from which some are averaged, and slope of the share."""
    return by.dense**2, 1.0 / (by.sparse**2 - by.dense**2)
