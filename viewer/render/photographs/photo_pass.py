"""Colours the filled picture from photographs, after the fill; their own colours come over the network's picture later.

On a GPU in compute shaders (photo_shader).  In software OpenGL, and where a GPU cannot hold the photographs, in compiled loops
on the processor, for which the picture is read back.
"""

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


def photographed(filled: np.ndarray, depth: np.ndarray, measured: np.ndarray, camera: "Camera", pool: PhotoPool,
                 numbers: list[int]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The filled picture with the colours of photographs, (H, W, 4) uint8; how much of each pixel is from them, (H, W) uint8;
    their own colours, (H, W, 4) uint8 with their share as alpha; and the pixels between measured pixels around each block,
    (ceil(H / BLOCK), ceil(W / BLOCK)) float32.

    filled: (H, W, 4) uint8, premultiplied.  depth: (H, W) float32, view-space z, 0 where the picture is not opaque.  measured:
    (H, W) uint8, 255 where measured.  numbers: photographs that are in the pool.
    """
    height, width = depth.shape
    rows, columns = -(-height // BLOCK), -(-width // BLOCK)
    grid, sums = np.empty((rows, columns), np.float32), np.empty((rows, columns, 4), np.float32)
    words = np.ascontiguousarray(filled).view(np.uint32).reshape(height, width)
    colours, made, share = np.zeros_like(words), np.empty_like(words), np.empty((height, width), np.uint8)
    floats, places = pool.records(numbers, camera)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    count_measured(measured, grid)
    in_rows(-(-height // TILE), 1, photograph_rows, words, depth, grid, lens, floats, places, pool.words, colours)
    in_rows(rows, 1, block_sums, words, colours, sums)
    in_rows(rows + 1, 1, over_rows, words, colours, sums, made, share)
    return made.view(np.uint8).reshape(filled.shape), share, colours.view(np.uint8).reshape(filled.shape), grid


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

    def run(self, filled: "moderngl.Texture", depth: "moderngl.Texture", mask: "moderngl.Texture", camera: "Camera",
            photographs: "ScenePhotographs", numbers: list[int], *, neural: bool) -> None:
        """Colours ``filled`` (RGBA8) in place.  depth: R32F of the filled picture.  mask: R8, kept by the filter.  neural:
        ``colours`` and ``grid`` are needed, too."""
        if (resident := photographs.resident(self._programs.context)) is not None:
            self._shader = self._shader or PhotoShader(self._programs, self.size)
            return self._shader.run(filled, self.share, self.colours, self.grid, depth, mask, camera, resident, numbers)
        width, height = self.size
        picture = np.frombuffer(filled.read(alignment=1), np.uint8).reshape(height, width, 4)
        z = np.frombuffer(depth.read(alignment=1), np.float32).reshape(height, width)
        measured = np.frombuffer(mask.read(alignment=1), np.uint8).reshape(height, width)
        made, share, colours, grid = photographed(picture, z, measured, camera, photographs.pool, numbers)
        filled.write(made)
        self.share.write(share)
        if neural:
            self.colours.write(colours)
            self.grid.write(grid)

    def release(self) -> None:
        for owned in (self.share, self.grid, self.colours):
            owned.release()
        if self._shader is not None:
            self._shader.release()
