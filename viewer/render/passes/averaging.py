"""Averaging in sparse places, before the fill: two compute passes that lower the weight of measured pixels where points are few
and noisy.  ``model/reference/pull_push.py`` is the reference implementation and says why."""

from typing import TYPE_CHECKING

from ....model.network.network_layout import NOISE_SCALE
from ....model.reference.fill_constants import AVERAGED, DENSE, DENSITY_BLOCK, NOISE_UNIT, SPARSE, widening
from ..device.compute_pass import Pass

if TYPE_CHECKING:
    import moderngl

    from ....model.appearance.noise import NoiseModel
    from ...picture.edits import Edits
    from ...picture.settings import Settings
    from ..device.shader import Programs


def widening_of(settings: "Settings", edits: "Edits | None", noise: "NoiseModel | None") -> float:
    """:func:`model.reference.fill_constants.widening` of a picture, 0 where nothing is averaged: scans of little noise,
    presets of the published programs, and points in other colours than their own."""
    recoloured = edits is not None and edits.recolours
    if noise is None or recoloured or settings.filter != "auto" or settings.soft_z != "auto":
        return 0.0
    return widening(noise.overall)


class Averaging:
    """Owns the targets of one picture size; ``run`` fills ``averaged`` (R32F), the weight of each pixel, 0 where nothing is
    measured."""

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        self.averaged = programs.context.texture(size, 1, dtype="f4")
        self._shares = programs.context.texture((-(-size[0] // DENSITY_BLOCK), -(-size[1] // DENSITY_BLOCK)), 1, dtype="f4")
        self._count = Pass(programs, "averaging, counts", "averaging.comp", outputs=("shares",), inputs=("mask",), COUNTS=1,
                           BLOCK=DENSITY_BLOCK)
        self._weigh = Pass(programs, "averaging", "averaging.comp", outputs=("averaged",), inputs=("mask", "shares", "level"),
                           uniforms=("per_level",), BLOCK=DENSITY_BLOCK, DENSE_SQUARE=DENSE**2,
                           SPARSE_SCALE=1.0 / (SPARSE**2 - DENSE**2))
        self._weigh.set_uniforms(per_level=AVERAGED / (NOISE_UNIT * NOISE_SCALE) ** 2)

    def run(self, mask: "moderngl.Texture", level: "moderngl.Texture") -> None:
        """mask: keep-mask or confidence.  level: of NoiseLevel, with detail 1."""
        self._count.run(self._shares, inputs={"mask": mask})
        self._weigh.run(self.averaged, inputs={"mask": mask, "shares": self._shares, "level": level})

    def release(self) -> None:
        """Frees the targets."""
        self.averaged.release()
        self._shares.release()
