"""The pull-push fill where OpenGL is software: compiled loops on the arrays of the processor's rasteriser and depth filter.

The same bytes as viewer.render.passes.fill, of which the hole test is kept; reference implementation:
model/reference/pull_push.py.  What the network takes stays in main memory.
"""

from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import in_rows
from ....model.network.network_layout import PACKED_IN
from ....model.reference.fill_constants import wider_ramp
from ..culling.enclosed_directions import CLOSED, SEALED, Directions, closed_in_view
from .fill import Fill, footprint_feature
from .fill_loops import PLANES, WEIGHT, Measured, Pyramid, fill_coarse, pull_level, pull_picture, push_level
from .fill_picture_loops import Around, Filled, picture_rows
from .filter import level_sizes

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ..device.shader import Programs

_LEAST_ROWS = 16
"""Fewest rows of a thread, of pixels or blocks: as of the depth filter, whose rows take half the time."""
_THREADED = 2
"""Levels whose rows are distributed over threads; the coarser ones together take less time than handing them over."""
_NO_FLOATS, _NO_CHANNELS = np.empty(0, np.float32), np.empty((PACKED_IN, 0), np.float32)


class CpuFill(Fill):
    """Owns the planes of one picture size, besides Fill's textures.

    shown: (P,) uint32 RGBA8, the filled picture.  packed: (H, W, PACKED_IN) float32, the network's input of the last picture
    for which it was asked, values of half floats; in memory channel after channel.
    """

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        super().__init__(programs, size)
        rows, start = [], 0
        for width, height in level_sizes(size, len(self._values)):
            stride = width + width % 2
            rows.append((start, stride, width, height))
            start += stride * (height + height % 2)
        self._levels = np.array(rows, np.int64)
        self._planes = np.zeros((PLANES, start), np.float32)
        self.shown = np.empty(size[0] * size[1], np.uint32)
        self._channels = np.empty((PACKED_IN, 0), np.float32)
        self._depths = _NO_FLOATS

    def run_here(self, colours: np.ndarray, weights: np.ndarray, depths: np.ndarray, *, camera: "Camera", around: Directions,
                 spacing: float, network: bool = False, noise: np.ndarray | None = None, with_depth: bool = False,
                 widened: float = 0.0) -> None:
        """As :meth:`Fill.run`, from arrays: colours (P,) uint32 RGBA8, and (P,) float32.  network: ``packed`` is made, too."""
        (width, height), footprint = self.size, footprint_feature(camera, spacing)
        given = Measured(colours, weights, depths, _NO_FLOATS if noise is None or not network else noise, width, height,
                         np.float32(1.0 / (camera.fx * spacing)))
        ramps = np.array([wider_ramp(level - widened, footprint) for level in range(len(self._levels) + 1)], np.float32)
        pyramid, noisy = Pyramid(self._planes, self._levels, ramps), len(given.noise) > 0
        threaded = min(_THREADED, len(self._levels))
        in_rows(int(self._levels[0, 3]), _LEAST_ROWS, pull_picture, given, pyramid)
        for number in range(1, threaded):
            in_rows(int(self._levels[number, 3]), _LEAST_ROWS, pull_level, pyramid, number, noisy)
        view = closed_in_view(around.closed, camera)
        if view not in (CLOSED, SEALED):  # before the levels are completed, which changes no weight
            self._test_holes(camera, around)
        fill_coarse(pyramid, threaded, noisy)
        for number in range(threaded, 0, -1):
            if number < len(self._levels):
                in_rows(int(self._levels[number - 1, 3]), _LEAST_ROWS, push_level, pyramid, number, noisy)
        self._write(given, pyramid, self._around(camera, around, view), network=network, with_depth=with_depth)

    @property
    def packed(self) -> np.ndarray:
        width, height = self.size
        return self._channels.reshape(PACKED_IN, height, width).transpose(1, 2, 0)

    def _test_holes(self, camera: "Camera", around: Directions) -> None:
        """Runs the hole test on the weights of the levels that it reads."""
        for texture, (start, stride, width, height) in zip(self._weights[:2], self._levels[:2].tolist(), strict=False):
            plane = self._planes[WEIGHT, start : start + stride * height].reshape(height, stride)
            texture.write(np.ascontiguousarray(plane[:, :width]))
        self._hole_test.run(camera, around.occupancy)

    def _around(self, camera: "Camera", around: Directions, view: int | None) -> Around:
        tested = view not in (CLOSED, SEALED)
        holes = self._hole_test.holes
        cells = np.empty((holes.height, holes.width, 4) if tested else (0, 0, 4), np.uint32)
        if tested:
            holes.read_into(cells)
        return Around(-1 if view is None else view, np.array(around.closed, np.int8, order="C"),  # one kind of array for numba
                      np.ascontiguousarray(camera.view_rotation, np.float32),
                      np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32), cells)

    def _write(self, given: Measured, pyramid: Pyramid, around: Around, *, network: bool, with_depth: bool) -> None:
        width, height = self.size
        if with_depth:
            self.depth = self.depth or self.context.texture(self.size, 1, dtype="f4")
            self._depths = self._depths if len(self._depths) else np.empty(width * height, np.float32)
        if network and not self._channels.size:
            self._channels = np.empty((PACKED_IN, width * height), np.float32)
        made = Filled(self.shown, self._depths if with_depth else _NO_FLOATS, self._channels if network else _NO_CHANNELS)
        in_rows(int(self._levels[0, 3]), _LEAST_ROWS, picture_rows, given, pyramid, around, made)
        self.filled.write(self.shown)
        if with_depth and self.depth is not None:
            self.depth.write(self._depths)
