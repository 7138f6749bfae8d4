"""Hole test: which empty pixels of a picture are holes, and which are background.  Reference:
``model/reference/hole_test.py``."""

from functools import partial
from math import log2
from typing import TYPE_CHECKING

import moderngl
import numpy as np

from ....model.reference import ray_march
from ....model.reference.hole_constants import (
    BACKGROUND_BELOW,
    COVER_SLOPE,
    FINE_LEVELS,
    KERNEL,
    KERNEL_SUM,
    fine_levels,
    strides,
    window_reach,
)
from ....model.reference.ray_march import RAY_BLOCK
from ..device.compute_pass import Pass
from .filter import level_sizes

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ...picture.camera import Camera
    from ..culling.occupancy import Occupancy
    from ..device.shader import Programs

_RAY_LEVELS = int(log2(RAY_BLOCK))


class HoleTest:
    """Owns the textures for one picture size; ``run`` writes ``holes``: for each cell of 4x4 pixels a byte for every pixel, its
    opacity (see ``shaders/hole_coverage.comp``).

    weights: of the fill's pyramid, written before each ``run``: of blocks of 2x2 pixels, of 4x4, and so on.
    """

    def __init__(self, programs: "Programs", size: tuple[int, int], weights: "Sequence[moderngl.Texture]"):
        context = programs.context
        self.context, self._programs, self._size = context, programs, size
        self._strides, blocks = strides(*size), fine_levels(*size)
        cells = level_sizes(size, FINE_LEVELS)[-1]
        self.holes = context.texture(cells, 4, dtype="u4")
        self._rows, self._around = (context.texture(cells, 1, dtype="f2") for _ in range(2))
        self._inputs = {"blocks": weights[0], "around": self._around} | ({"cells": weights[1]} if blocks == 2 else {})
        self._holes = Pass(programs, "holes", "hole_coverage.comp", outputs=("holes",), inputs=tuple(self._inputs),
                           BLOCKS=blocks, KERNEL_SUM=KERNEL_SUM, BACKGROUND_BELOW=BACKGROUND_BELOW,
                           COVER_SLOPE=COVER_SLOPE)  # fmt: skip
        self._owned, self._windows = [self.holes, self._rows, self._around], []
        smooth = partial(Pass, programs, "smoothed holes", "hole_smooth.comp", outputs=("smoothed",),
                         SIDE=(len(KERNEL) + 1) // 2)
        directions = ("seen",) if self._strides else ()
        self._smooth_rows = [
            smooth(inputs=(*directions, *marched), ROWS=1, AROUND=1 if self._strides else None, MARCHED=1 if marched else None,
                   RAY_SHIFT=_RAY_LEVELS - FINE_LEVELS, TOUCHED=ray_march.TOUCHED, IN_SURFACE=ray_march.IN_SURFACE)
            for marched in ((), ("met",))
        ]
        self._smooth = smooth(inputs=("rows",))
        self._rays: Rays | None = None
        if not self._strides:
            return
        self._windows = [weights[1], *(context.texture(cells, 1, dtype="f1") for _ in self._strides[1:])]
        self._seen = context.texture(cells, 1, dtype="u4")
        self._between = context.texture(cells, 1, dtype="f1")  # for dilations that take two passes: from one cell to five
        self._owned += [*self._windows[1:], self._seen, self._between]
        self._dilate = Pass(programs, "wider windows", "hole_dilate.comp", outputs=("wider",), inputs=("window",),
                            uniforms=("by",))  # fmt: skip
        self._directions = [
            Pass(programs, "directions", "hole_directions.comp", outputs=("seen",), inputs=("window",), uniforms=("stride",),
                 FIRST=first) for first in (1, None)]  # fmt: skip

    def run(self, camera: "Camera", occupancy: "Occupancy | None") -> None:
        """Writes ``holes``.  occupancy: the lattice that rays are tested against; None: the picture decides alone."""
        for number, (stride, window) in enumerate(zip(self._strides, self._windows, strict=True)):
            if number:
                before = self._strides[number - 1]
                self._dilate_to(self._windows[number - 1], window, window_reach(before), window_reach(stride))
            self._directions[min(number, 1)].run(self._seen, inputs={"window": window}, stride=stride)
        inputs = {"seen": self._seen} if self._strides else {}
        if occupancy is not None:
            self._rays = self._rays or Rays(self._programs, self._size)
            inputs["met"] = self._rays.run(camera, occupancy)
        self._smooth_rows[occupancy is not None].run(self._rows, inputs=inputs)
        self._smooth.run(self._around, inputs={"rows": self._rows})
        self._holes.run(self.holes, inputs=self._inputs)

    def _dilate_to(self, narrow: moderngl.Texture, wide: moderngl.Texture, reach: int, wanted: int) -> None:
        """Dilates windows of ``reach`` cells on each side to ``wanted``; no pass by more than their width."""
        while reach < wanted:
            by = min(wanted - reach, 2 * reach + 1)
            reach += by
            target = wide if reach == wanted else self._between
            self._dilate.run(target, inputs={"window": narrow}, by=by)
            narrow = target

    def release(self) -> None:
        for texture in self._owned:
            texture.release()
        if self._rays is not None:
            self._rays.release()


class Rays:
    """Owns the lattice's texture and what the rays of one picture size met in it; ``model/reference/ray_march.py`` is the
    reference."""

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        self.context = programs.context
        self._met = self.context.texture(level_sizes(size, _RAY_LEVELS)[-1], 1, dtype="u1")
        self._codes: moderngl.Texture3D | None = None
        self._of: Occupancy | None = None
        self._march = Pass(
            programs, "ray march", "hole_march.comp", outputs=("met",), inputs=("codes",),
            uniforms=("to_world", "lens", "sparse", "eye", "parallel"), RAY_BLOCK=RAY_BLOCK,
            STEP=ray_march.STEP, START=ray_march.START,
            START_IN_SURFACE=ray_march.START_IN_SURFACE,
            MAX_STEPS=ray_march.MAX_STEPS, LOOSE=ray_march.LOOSE, INNER=ray_march.INNER, NOTHING=ray_march.NOTHING,
            TOUCHED=ray_march.TOUCHED, IN_SURFACE=ray_march.IN_SURFACE,
        )  # fmt: skip

    def run(self, camera: "Camera", occupancy: "Occupancy") -> moderngl.Texture:
        """(w, h) r8ui, a texel for RAY_BLOCK pixels a side: NOTHING, TOUCHED or IN_SURFACE."""
        if occupancy is not self._of or self._codes is None:
            if self._codes is not None:
                self._codes.release()
            data = np.ascontiguousarray(occupancy.codes.transpose(2, 1, 0))  # x varies fastest
            self._codes = self.context.texture3d(occupancy.codes.shape, 1, data, alignment=1, dtype="u1")
            self._of = occupancy
        self._march.run(
            self._met, inputs={"codes": self._codes},
            to_world=tuple(camera.view_rotation.ravel()),  # rows of world -> view are columns of view -> world
            lens=(camera.fx, camera.fy, camera.cx, camera.cy),
            sparse=ray_march.sparse_depth(camera, occupancy.spacing) / occupancy.side,
            parallel=(camera.orthographic or 0.0) / occupancy.side,
            eye=tuple((camera.position - occupancy.origin) / occupancy.side))
        return self._met

    def release(self) -> None:
        self._met.release()
        if self._codes is not None:
            self._codes.release()
