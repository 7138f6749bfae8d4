"""The depth filter of preset ``auto`` where OpenGL is software: compiled loops on the arrays of the processor's rasteriser.

The same bytes as viewer.render.passes.filter; reference implementation: model/reference/depth_filter.py.  llvmpipe takes
several times as long, most of it for reading each pixel's neighbours (viewer/bench/README.md).
"""

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import in_rows
from ....model.reference import filter_constants as constants
from .filter import level_sizes
from .filter_loops import base_rows, coarser_rows, keep_rows, surround, threshold_rows

if TYPE_CHECKING:
    import moderngl

    from ..raster.raster_cpu import CpuRasteriser

_FEW = 32
"""Rows of a thread at least: a smaller plane takes less time than waking another thread.  Measured: 32 rows of 1280 pixels take
27 us, of the next level 32 us; handing two parts to threads and waiting for them takes 36 us."""
_NONE = np.empty(0, np.float32)


def _limits(level: int, strength: float) -> tuple[np.float32, ...]:
    return tuple(np.float32(limit) for limit in constants.hiding_limits(level, strength))


@dataclass(frozen=True)
class FilterLevel:
    """A level of the pyramid; planes as in filter_loops, thresholds (h * w,)."""

    width: int
    height: int
    near: np.ndarray
    support: np.ndarray
    threshold: np.ndarray

    @staticmethod
    def of(size: tuple[int, int]) -> "FilterLevel":
        width, height = size
        near, support = (np.zeros((width + 2) * (height + 2), np.float32) for _ in range(2))
        return FilterLevel(width, height, near, support, np.empty(width * height, np.float32))

    def surround(self, *, mirrored: bool) -> None:
        for plane in (self.near, self.support):
            surround(plane, self.width, self.height, mirrored)


def filter_pyramid(size: tuple[int, int], levels: int) -> list[FilterLevel]:
    """The planes of a picture of ``size`` (width, height) and of so many levels above it."""
    return [FilterLevel.of(each) for each in (size, *level_sizes(size, levels))]


def filter_picture(pyramid: list[FilterLevel], depths: np.ndarray, colours: np.ndarray, kept: np.ndarray, shown: np.ndarray, *,
                   strength: float = 1.0, least: int = _FEW) -> None:
    """Filters a picture: writes kept (H * W,) uint8, 255 where kept, and shown (H * W,) uint32, the filtered picture.

    pyramid: of :func:`filter_pyramid`, which is overwritten.  depths: (H * W,) float32, +inf where empty.  colours: (H * W,)
    uint32 RGBA8.  strength: multiplies the tolerance.  least: rows of a thread at least; the picture's height: this thread
    alone.
    """
    base = pyramid[0]
    in_rows(base.height, least, base_rows, depths, base.near, base.support, base.width)
    for fine, coarse in itertools.pairwise(pyramid):
        in_rows(coarse.height, least, coarser_rows, fine.near, fine.support, fine.width, coarse.near, coarse.support,
                coarse.width)  # fmt: skip
    coarser = _NONE
    for number in range(len(pyramid) - 1, 0, -1):
        level = pyramid[number]
        if number in constants.MIRRORED:
            level.surround(mirrored=True)
        in_rows(level.height, least, threshold_rows, level.near, level.support, level.width, coarser,
                *_limits(number, strength), level.threshold)  # fmt: skip
        if number in constants.MIRRORED:
            level.surround(mirrored=False)  # the next picture's blocks are empty beyond the edge
        coarser = level.threshold
    in_rows(base.height, least, keep_rows, base.near, base.width, coarser, *_limits(0, strength)[:2], colours, kept, shown)


class CpuDepthFilter:
    """Owns the planes of one picture size.  ``run`` fills ``mask`` (R8), ``kept``, (P,) uint8, with the same,
    and ``filtered`` (RGBA8)."""

    preset = "auto"

    def __init__(self, context: "moderngl.Context", size: tuple[int, int], levels: int | None = None):
        self.size, self.wanted_levels = size, levels
        self.levels = constants.LEVELS["auto"] if levels is None else levels
        self.mask, self.filtered = context.texture(size, 1, dtype="f1"), context.texture(size, 4, dtype="f1")
        self._pyramid = filter_pyramid(size, self.levels)
        self.kept, self._shown = np.empty(size[0] * size[1], np.uint8), np.empty(size[0] * size[1], np.uint32)

    def run(self, rasteriser: "CpuRasteriser", depths: np.ndarray, *, strength: float = 1.0) -> None:
        """Fills ``mask`` and ``filtered``.  depths: (H * W,) float32, the rasteriser's, or what stands for them.  strength:
        multiplies the tolerance."""
        filter_picture(self._pyramid, depths, rasteriser.colours, self.kept, self._shown, strength=strength)
        self.mask.write(self.kept)
        self.filtered.write(self._shown)

    def release(self) -> None:
        self.mask.release()
        self.filtered.release()
