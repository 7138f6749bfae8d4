"""Colours the filled picture from photographs, after the fill and before the network.

On a GPU in compute shaders (photo_shader).  In software OpenGL, and where a GPU cannot hold the photographs, in compiled loops
on the processor, for which the picture is read back.
"""

from typing import TYPE_CHECKING, Protocol

import numpy as np

from ....model.common.process.processors import in_rows
from ....model.reference.photo_colours import BLOCK
from .photo_loops import TILE, photograph_rows
from .photo_pool import PhotoPool
from .photo_shader import PhotoShader
from .photo_surface_loops import count_measured

if TYPE_CHECKING:
    import moderngl

    from ...picture.camera import Camera
    from ..device.shader import Programs
    from .scene_photographs import ScenePhotographs


class Pixels(Protocol):
    """The network's input, of viewer.render.network.bridge."""

    def bind_to_storage_buffer(self, binding: int = 0) -> None: ...
    def read(self) -> bytes: ...
    def write(self, data) -> None: ...


_NO_NETWORK = np.empty((0, 0, 4), np.uint32)


def photographed(filled: np.ndarray, depth: np.ndarray, measured: np.ndarray, camera: "Camera", pool: PhotoPool,
                 numbers: list[int], network: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """The filled picture with the colours of photographs, (H, W, 4) uint8, and their share of each pixel, (H, W) uint8.

    filled: (H, W, 4) uint8, premultiplied.  depth: (H, W) float32, view-space z, 0 where the picture is not opaque.  measured:
    (H, W) uint8, 255 where measured.  numbers: photographs that are in the pool.  network: (H, W, 4) uint32, the network's
    input (shaders/fill_picture.comp), changed in place.
    """
    height, width = depth.shape
    grid = np.empty((-(-height // BLOCK), -(-width // BLOCK)), np.float32)
    words = np.ascontiguousarray(filled).view(np.uint32).reshape(height, width)
    made, share = words.copy(), np.zeros((height, width), np.uint8)
    floats, places = pool.records(numbers, camera)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    count_measured(measured, grid)
    in_rows(-(-height // TILE), 1, photograph_rows, words, depth, grid, lens, floats, places, pool.words,
            _NO_NETWORK if network is None else network, made, share)
    return made.view(np.uint8).reshape(filled.shape), share


class PhotoPass:
    """Owns ``share`` (R8), the photographs' share of each pixel of the last picture, for one picture size."""

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        self.size, self._programs = size, programs
        self.share = programs.context.texture(size, 1, dtype="f1", alignment=1)
        self._shader: PhotoShader | None = None

    def run(self, filled: "moderngl.Texture", depth: "moderngl.Texture", mask: "moderngl.Texture", camera: "Camera",
            photographs: "ScenePhotographs", numbers: list[int], network: "Pixels | None") -> None:
        """Colours ``filled`` (RGBA8) in place, and ``network``, the network's input.  depth: R32F of the filled picture.  mask:
        R8, kept by the filter."""
        if (resident := photographs.resident(self._programs.context)) is not None:
            self._shader = self._shader or PhotoShader(self._programs, self.size)
            return self._shader.run(filled, self.share, depth, mask, camera, resident, numbers, network)
        width, height = self.size
        picture = np.frombuffer(filled.read(alignment=1), np.uint8).reshape(height, width, 4)
        z = np.frombuffer(depth.read(alignment=1), np.float32).reshape(height, width)
        measured = np.frombuffer(mask.read(alignment=1), np.uint8).reshape(height, width)
        given = None
        if network is not None:
            given = np.frombuffer(network.read(), np.uint32).reshape(height, width, 4).copy()
        made, share = photographed(picture, z, measured, camera, photographs.pool, numbers, given)
        filled.write(made)
        self.share.write(share)
        if network is not None and given is not None:
            network.write(given)

    def release(self) -> None:
        self.share.release()
        if self._shader is not None:
            self._shader.release()
