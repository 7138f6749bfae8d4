"""View-dependent blending: scanner positions in the view frame, and the confidence of each measured pixel.

Each point is weighted by the angle between the viewing ray and its scanner's ray; model/reference/station_weights.py is the
reference implementation and says why.  World frame: the scan file's, float64.  View frame: x right, y down, z forward, relative
to the camera, float32.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from ....model.common.scanner_positions import stations_differ
from ....model.reference.station_constants import CONFIDENCE_BLOCK, CONFIDENCE_HALF_SUM, HEAVIEST
from ..device.compute_pass import Pass

if TYPE_CHECKING:
    import moderngl

    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...picture.settings import Settings
    from ..device.shader import Programs

MOST_STATIONS = 256
"""Stations that the eight bits of a packed point can number."""


class ScannerPositions:
    """Scanner positions of one scene by station number.  known: whether at least two differ."""

    def __init__(self, scene: "Scene"):
        self._world = scene.station_places
        self.known = stations_differ(self._world)
        self._view = np.zeros((MOST_STATIONS, 4), np.float32)  # complete, because the shader's block has this size
        self._view[: len(self._world), 3] = ~np.isnan(self._world).any(axis=1)

    def seen_from(self, camera: "Camera") -> np.ndarray:
        """(MOST_STATIONS, 4) float32: view-frame position, and 1 where it is known, else 0.  Overwritten by the next call."""
        self._view[: len(self._world), :3] = np.nan_to_num((self._world - camera.position) @ camera.view_rotation.T)
        return self._view


def uses_station_weights(settings: "Settings", positions: ScannerPositions) -> bool:
    """Whether points are weighted by their stations; never with the presets of the published programs."""
    return settings.stations == "auto" and settings.soft_z == "auto" and positions.known


class Confidence:
    """Confidence of measured pixels relative to their neighbours, where points are weighted.

    Owns the targets of one picture size.  ``run`` fills ``confidence`` (R8; 0 where the filter kept nothing) and ``toned``
    (RGBA8): colours of low confidence moved to the tone of more confident neighbours.
    """

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        context = programs.context
        blocks = -(-size[0] // CONFIDENCE_BLOCK), -(-size[1] // CONFIDENCE_BLOCK)
        self.confidence, self.toned = context.texture(size, 1, dtype="f1"), context.texture(size, 4, dtype="f1")
        self._share, self._sums = context.texture(size, 1, dtype="f1"), context.texture(blocks, 2, dtype="f4")
        self._more, self._less = (context.texture(blocks, 4, dtype="f4") for _ in range(2))
        constants: dict[str, Any] = {"CONFIDENCE_BLOCK": CONFIDENCE_BLOCK, "CONFIDENCE_HALF_SUM": CONFIDENCE_HALF_SUM,
                                     "HEAVIEST": HEAVIEST}  # fmt: skip

        def step(variant: str, outputs: tuple[str, ...], inputs: tuple[str, ...]) -> Pass:
            return Pass(programs, f"confidence, {variant.lower()}", "confidence.comp", outputs=outputs, inputs=inputs,
                        **{**constants, variant: 1})  # fmt: skip

        self._weigh = step("WEIGHTS", ("sums",), ("weight", "mask"))
        self._divide = step("SHARES", ("share",), ("weight", "mask", "sums"))
        self._tone = step("TONES", ("more", "less"), ("raw", "share"))
        self._finish = step("PICTURE", ("toned", "confidence"), ("raw", "share", "more", "less"))

    def run(self, raw: "moderngl.Texture", weight: "moderngl.Texture", mask: "moderngl.Texture") -> None:
        """raw, weight: colour and sum of weights of each pixel, from a rasteriser.  mask: the keep-mask."""
        measured, picture = {"weight": weight, "mask": mask}, {"raw": raw, "share": self._share}
        self._weigh.run(self._sums, inputs=measured)
        self._divide.run(self._share, inputs={**measured, "sums": self._sums})
        self._tone.run(self._more, self._less, inputs=picture)
        self._finish.run(self.toned, self.confidence, inputs={**picture, "more": self._more, "less": self._less})

    def release(self) -> None:
        """Frees the targets."""
        for texture in (self.confidence, self.toned, self._share, self._sums, self._more, self._less):
            texture.release()
