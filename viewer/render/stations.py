"""Where a scan's scanners stood, as the eye sees it, and how far each measured pixel is trusted beside its neighbours, in their
tone.

Points count by how nearly their scanner looked the way the eye looks; :mod:`model.station_weights` says why, and is the twin.
World frame: the scan file's, float64; the view frame (x right, y down, z forward) is relative to the camera, float32.
"""

from typing import TYPE_CHECKING

import numpy as np

from model.common.scanner_positions import stations_differ
from model.station_constants import CONFIDENCE_BLOCK, CONFIDENCE_HALF_SUM, HEAVIEST
from viewer.render import shader

if TYPE_CHECKING:
    import moderngl

    from viewer.camera import Camera
    from viewer.grid.scene import Scene
    from viewer.settings import Settings

MOST_STATIONS = 256
"""What the eight bits of a packed point can tell apart."""


class Places:
    """Of one scene's scanners, by scan number.  known: whether two are known to have stood apart."""

    def __init__(self, scene: "Scene"):
        self._world = scene.station_places
        self.known = stations_differ(self._world)
        self._view = np.zeros((MOST_STATIONS, 4), np.float32)  # all of them: what is not written would be anything
        self._view[: len(self._world), 3] = ~np.isnan(self._world).any(axis=1)

    def seen_from(self, camera: "Camera") -> np.ndarray:
        """(MOST_STATIONS, 4) float32: view position, and 1 where it is known, 0 where not.  Overwritten by the next call."""
        self._view[: len(self._world), :3] = np.nan_to_num((self._world - camera.position) @ camera.view_rotation.T)
        return self._view


def weighs(settings: "Settings", places: Places) -> bool:
    """Whether points count by their stations; never in the published programs' pictures."""
    return settings.stations == "auto" and settings.soft_z == "auto" and places.known


class Trust:
    """Owns the targets of one picture size; ``run`` fills ``trust`` (R8; 0 where nothing is kept) and ``toned`` (RGBA8)."""

    def __init__(self, programs: shader.Programs, size: tuple[int, int]):
        context = programs.context
        self.context, self.size = context, size
        blocks = -(-size[0] // CONFIDENCE_BLOCK), -(-size[1] // CONFIDENCE_BLOCK)
        self.trust, self.toned = context.texture(size, 1, dtype="f1"), context.texture(size, 4, dtype="f1")
        self._share, self._sums = context.texture(size, 1, dtype="f1"), context.texture(blocks, 2, dtype="f4")
        self._more, self._less = (context.texture(blocks, 4, dtype="f4") for _ in range(2))
        targets = {"WEIGHTS": (self._sums,), "SHARES": (self._share,), "TONES": (self._more, self._less),
                   "PICTURE": (self.toned, self.trust)}  # fmt: skip
        self._steps = [(programs.compute("trust.comp", CONFIDENCE_BLOCK=CONFIDENCE_BLOCK,
                                         CONFIDENCE_HALF_SUM=CONFIDENCE_HALF_SUM, HEAVIEST=HEAVIEST, **{step: 1}), made)
                       for step, made in targets.items()]

    def run(self, raw: "moderngl.Texture", weight: "moderngl.Texture", mask: "moderngl.Texture") -> None:
        """raw, weight: the pixels' colours, and what their points count, as a rasteriser leaves them.  mask: the keep-mask."""
        inputs = {"raw": raw, "weight": weight, "mask": mask, "sums": self._sums, "share": self._share, "more": self._more,
                  "less": self._less}  # fmt: skip
        for step, targets in self._steps:
            for unit, name in enumerate(name for name, texture in inputs.items() if name in step and texture not in targets):
                inputs[name].use(unit)
                step[name] = unit
            for unit, target in enumerate(targets):
                target.bind_to_image(unit, read=False, write=True)
            step.run(*shader.groups(*targets[0].size))
            self.context.memory_barrier()

    def release(self) -> None:
        for texture in (self.trust, self.toned, self._share, self._sums, self._more, self._less):
            texture.release()
