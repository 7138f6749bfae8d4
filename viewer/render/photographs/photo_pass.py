"""Colours the filled picture from photographs, after the fill; their own colours come over the network's picture later.

On a GPU in compute shaders (photo_shader).  In software OpenGL, and where a GPU cannot hold the photographs, in compiled loops
on the processor, for which the picture is read back.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import in_rows
from ....model.reference.photo_colours import BLOCK
from .photo_loops import TILE, photograph_rows
from .photo_over_loops import block_sums, over_rows
from .photo_pool import PhotoPool
from .photo_shader import PhotoShader
from .photo_surface_loops import count_measured

if TYPE_CHECKING:
    import moderngl

    from ...picture.camera import Camera
    from ..device.shader import Programs
    from .scene_photographs import ScenePhotographs


@dataclass(frozen=True, eq=False)
class Coloured:
    """made: (H, W, 4) uint8, the filled picture with the colours of photographs.  share: (H, W) uint8, how much of each pixel
    is from them.  colours: (H, W, 4) uint8, their own colours with their share as alpha.  grid: (ceil(H / BLOCK),
    ceil(W / BLOCK)) float32, the pixels between measured pixels around each block.  sums: working memory."""

    made: np.ndarray
    share: np.ndarray
    colours: np.ndarray
    grid: np.ndarray
    sums: np.ndarray

    @classmethod
    def of(cls, width: int, height: int) -> "Coloured":
        """Memory for a picture of this size."""
        rows, columns = -(-height // BLOCK), -(-width // BLOCK)
        pictures = (np.empty((height, width, 4), np.uint8) for _ in range(2))
        return cls(next(pictures), np.empty((height, width), np.uint8), next(pictures), np.empty((rows, columns), np.float32),
                   np.empty((rows, columns, 4), np.float32))  # fmt: skip


def photographed(filled: np.ndarray, depth: np.ndarray, measured: np.ndarray, camera: "Camera", pool: PhotoPool,
                 numbers: list[int], into: Coloured | None = None) -> Coloured:
    """The filled picture with the colours of photographs.

    filled: (H, W, 4) uint8, premultiplied.  depth: (H, W) float32, view-space z, 0 where the picture is not opaque.  measured:
    (H, W) uint8, 255 where measured.  numbers: photographs that are in the pool.  into: memory that is written and returned.
    """
    height, width = depth.shape
    out = Coloured.of(width, height) if into is None else into
    words, made, colours = (np.ascontiguousarray(each).view(np.uint32).reshape(height, width)
                              for each in (filled, out.made, out.colours))
    colours[:] = 0
    floats, places = pool.records(numbers, camera)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    count_measured(measured, out.grid)
    in_rows(-(-height // TILE), 1, photograph_rows, words, depth, out.grid, lens, floats, places, pool.words, colours)
    in_rows(len(out.grid), 1, block_sums, words, colours, out.sums)
    in_rows(len(out.grid) + 1, 1, over_rows, words, colours, out.sums, made, out.share)
    return out


class PhotoPass:
    """Owns, for one picture size, ``share`` (R8), the photographs' share of each pixel of the last filled picture; and what
    comes over the network's: ``colours`` (RGBA8), their own colours with their share as alpha, and ``grid`` (R32F, by block),
    the pixels between measured pixels."""

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        self.size, self._programs = size, programs
        self.share = programs.context.texture(size, 1, dtype="f1", alignment=1)
        self.grid = programs.context.texture((-(-size[0] // BLOCK), -(-size[1] // BLOCK)), 1, dtype="f4")
        self.colours = programs.context.texture(size, 4, dtype="f1")
        self._shader: PhotoShader | None = None
        self._read: tuple[np.ndarray, np.ndarray, np.ndarray] | None = None  # picture, depth, mask
        self._made = Coloured.of(0, 0)

    def run(self, filled: "moderngl.Texture", depth: "moderngl.Texture", mask: "moderngl.Texture", camera: "Camera",
            photographs: "ScenePhotographs", numbers: list[int], *, neural: bool) -> None:
        """Colours ``filled`` (RGBA8) in place.  depth: R32F of the filled picture.  mask: R8, kept by the filter.  neural:
        ``colours`` and ``grid`` are needed, too."""
        if (resident := photographs.resident(self._programs.context)) is not None:
            self._shader = self._shader or PhotoShader(self._programs, self.size)
            return self._shader.run(filled, self.share, self.colours, self.grid, depth, mask, camera, resident, numbers)
        width, height = self.size
        if self._read is None:  # kept: taking fresh memory for each picture costs a tenth of the time
            self._read = (np.empty((height, width, 4), np.uint8), np.empty((height, width), np.float32),
                          np.empty((height, width), np.uint8))  # fmt: skip
            self._made = Coloured.of(width, height)
        for texture, memory in zip((filled, depth, mask), self._read):
            texture.read_into(memory, alignment=1)
        made = photographed(*self._read, camera, photographs.pool, numbers, self._made)
        filled.write(made.made)
        self.share.write(made.share)
        if neural:
            self.colours.write(made.colours)
            self.grid.write(made.grid)

    def release(self) -> None:
        for owned in (self.share, self.grid, self.colours):
            owned.release()
        if self._shader is not None:
            self._shader.release()
