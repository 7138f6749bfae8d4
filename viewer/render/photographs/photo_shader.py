"""The pass of the photographs in compute shaders, for GPUs: nothing is read back.

Reference implementation: model/reference/photo_colours.py.  The compiled loops (photo_loops) do the same on a processor.
"""

from typing import TYPE_CHECKING, Any

import numpy as np

from ....model.reference import photo_colours as constants
from ..device.compute_pass import Pass
from . import photo_pool as layout
from .photo_pool import NUMBERS, PLACES, PhotoPool

if TYPE_CHECKING:
    import moderngl

    from ...picture.camera import Camera
    from ..device.compute_pass import Storage
    from ..device.shader import Programs

MOST_PHOTOGRAPHS = 32
"""Photographs at most for one picture, at least photo_library.IN_REACH."""
_SURFACE: dict[str, Any] = {"BEND_AT": constants.BEND_AT, "BEND": constants.BEND}
_COLOUR: dict[str, Any] = {
    **{name: getattr(layout, name) for name in ("TURN", "SHIFT", "LENS", "GAINS", "PRESENCE", "KIND", "AROUND", "WIDTH",
                                                "HEIGHT", "MAP", "MAP_WIDTH", "MAP_HEIGHT", "LEVELS", "LEVEL", "NUMBERS")},
    **{name: getattr(constants, name) for name in ("PINHOLE", "SPHERICAL", "BLOCK", "NORMAL_AT", "HIDDEN", "LEAST_ANGLE",
                                                   "BORDER", "AT_BORDER", "POINTS_VOTE", "AGREES")},
    **{f"{name}_{end}": getattr(constants, name)[k] for name in ("SPARSE", "COARSE", "GRAZING")
       for k, end in enumerate(("FROM", "TO"))},
    "RECORD": NUMBERS + PLACES, "MOST_PHOTOGRAPHS": MOST_PHOTOGRAPHS,
}  # fmt: skip

_OVER: dict[str, Any] = {"BLOCK": constants.BLOCK, "CONTRADICTED_FROM": constants.CONTRADICTED[0],
                         "CONTRADICTED_TO": constants.CONTRADICTED[1]}


class ResidentPool:
    """Owns a copy of a pool on the GPU.  words: the slots that hold a photograph, at most photo_library.BUDGET; it grows with
    them, and twice over, so that few photographs take little memory and many are uploaded twice at most."""

    def __init__(self, context: "moderngl.Context", pool: PhotoPool):
        self.pool, self._slots = pool, max(pool.filled, 1)
        self.words = context.buffer(reserve=4 * pool.size * self._slots)
        self._records = context.buffer(reserve=4 * (NUMBERS + PLACES) * MOST_PHOTOGRAPHS)
        pool.changed |= set(range(pool.filled))

    def update(self, numbers: list[int], camera: "Camera") -> "dict[str, Storage]":
        """Uploads what has changed, and the records of these photographs; returns the buffers of photo_colour.comp."""
        if self.pool.filled > self._slots:
            self._slots = min(max(self.pool.filled, 2 * self._slots), self.pool.count)
            self.words.orphan(4 * self.pool.size * self._slots)
            self.pool.changed |= set(range(self.pool.filled))
        for slot in sorted(self.pool.changed):
            part = slice(slot * self.pool.size, (slot + 1) * self.pool.size)
            self.words.write(self.pool.words[part], offset=4 * part.start)
        self.pool.changed.clear()
        floats, places = self.pool.records(numbers, camera)
        self._records.write(np.hstack([floats.view(np.uint32), places.view(np.uint32)]).tobytes())
        return {"PHOTOS": self.words, "PHOTO_RECORDS": self._records}

    def release(self) -> None:
        self.words.release()
        self._records.release()


class PhotoShader:
    """Owns the passes, and what they hand each other, of one picture size."""

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        self._programs, self.size = programs, size
        self._certain = programs.context.texture(size, 1, dtype="f4")
        self._surface = Pass(programs, "photographs", "photo_surface.comp", outputs=("certain",), inputs=("depth",), **_SURFACE)
        self._spacing = Pass(programs, "photographs", "photo_spacing.comp", outputs=("grid",), inputs=("mask",),
                             BLOCK=constants.BLOCK)
        self._colour = Pass(programs, "photographs", "photo_colour.comp", outputs=("colours",),
                            inputs=("filled", "depth", "certain", "grid"), uniforms=("lens", "photographs"),
                            buffers=("PHOTOS", "PHOTO_RECORDS"), **_COLOUR)
        self._apart = programs.context.texture((-(-size[0] // constants.BLOCK), -(-size[1] // constants.BLOCK)), 4, dtype="f4")
        self._sums = Pass(programs, "photographs", "photo_apart.comp", outputs=("apart",), inputs=("photographs", "filled"),
                          BLOCK=constants.BLOCK, FILLED=1)
        self._over = Pass(programs, "photographs", "photo_over.comp", outputs=("filled", "share"),
                          inputs=("photographs", "block_apart"), **_OVER)

    def run(self, filled: "moderngl.Texture", share: "moderngl.Texture", colours: "moderngl.Texture",
            grid: "moderngl.Texture", depth: "moderngl.Texture", mask: "moderngl.Texture", camera: "Camera",
            resident: ResidentPool, numbers: list[int]) -> None:
        """As PhotoPass.run; share, colours and grid: as there, written everywhere."""
        buffers = resident.update(numbers, camera)
        self._surface.run(self._certain, inputs={"depth": depth})
        self._spacing.run(grid, inputs={"mask": mask})
        inputs = {"filled": filled, "depth": depth, "certain": self._certain, "grid": grid}
        self._colour.run(colours, inputs=inputs, buffers=buffers, photographs=len(numbers),
                         lens=(camera.fx, camera.fy, camera.cx, camera.cy))
        self._sums.run(self._apart, inputs={"photographs": colours, "filled": filled})
        self._over.run(filled, share, inputs={"photographs": colours, "block_apart": self._apart})

    def release(self) -> None:
        self._certain.release()
        self._apart.release()
