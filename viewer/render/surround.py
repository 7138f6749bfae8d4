"""Which empty pixels of a picture are holes, and which are void: the passes behind ``model/surrounded.py``, their twin."""

from typing import TYPE_CHECKING

import moderngl

from model.surrounded import FINE_LEVELS, MOST, SMOOTH, fine_levels, strides, window_reach
from viewer.render import shader
from viewer.render.filter import level_sizes

if TYPE_CHECKING:
    from collections.abc import Sequence


class Surround:
    """Owns the textures for one picture size; ``run`` writes ``holes``: of each cell of 4x4 pixels a bit for every pixel that
    measured ones surround, and one for every pixel far inside.

    weights: of the fill's pyramid, written before each ``run``: of blocks of 2x2 pixels, of 4x4, and so on.
    """

    def __init__(self, programs: shader.Programs, size: tuple[int, int], weights: "Sequence[moderngl.Texture]"):
        context = programs.context
        self.context = context
        self._strides, blocks = strides(*size), fine_levels(*size)
        cells = level_sizes(size, FINE_LEVELS)[-1]
        self.holes = context.texture(cells, 1, dtype="u4")
        self._inputs = {"blocks": weights[0]} | ({"cells": weights[1]} if blocks == 2 else {})
        around = {"AROUND": 1, "MOST": MOST} if self._strides else {}
        self._holes = programs.compute("surround_holes.comp", BLOCKS=blocks, **around)
        self._owned, self._windows = [self.holes], []
        if not self._strides:
            return
        self._windows = [weights[1], *(context.texture(cells, 1, dtype="f1") for _ in self._strides[1:])]
        self._seen = context.texture(cells, 1, dtype="u4")
        self._between = context.texture(cells, 1, dtype="f1")  # where one pass is not enough: of one cell to five, no other
        self._rows, self._around = (context.texture(cells, 1, dtype="f2") for _ in range(2))
        self._owned += [*self._windows[1:], self._seen, self._between, self._rows, self._around]
        self._inputs["around"] = self._around
        self._widen = programs.compute("surround_widen.comp")
        self._look = [programs.compute("surround_look.comp", FIRST=first) for first in (1, None)]
        half = (len(SMOOTH) + 1) // 2
        self._smooth_rows, self._smooth = (programs.compute("surround_smooth.comp", ROWS=rows, SIDE=half) for rows in (1, None))

    def run(self) -> None:
        """Writes ``holes``."""
        for number, (stride, window) in enumerate(zip(self._strides, self._windows, strict=True)):
            if number:
                before = self._strides[number - 1]
                self._make_wider(self._windows[number - 1], window, window_reach(before), window_reach(stride))
            look = self._look[min(number, 1)]
            look["stride"] = stride
            self._pass(look, self._seen, {"window": window})
        if self._strides:
            self._pass(self._smooth_rows, self._rows, {"seen": self._seen})
            self._pass(self._smooth, self._around, {"rows": self._rows})
        self._pass(self._holes, self.holes, self._inputs)

    def _make_wider(self, narrow: moderngl.Texture, wide: moderngl.Texture, reach: int, wanted: int) -> None:
        """Windows of ``reach`` cells on each side into ones of ``wanted``; no pass by more than they are wide."""
        while reach < wanted:
            by = min(wanted - reach, 2 * reach + 1)
            reach += by
            target = wide if reach == wanted else self._between
            self._widen["by"] = by
            self._pass(self._widen, target, {"window": narrow})
            narrow = target

    def _pass(self, program: moderngl.ComputeShader, output: moderngl.Texture, inputs: dict[str, moderngl.Texture]) -> None:
        for unit, (name, texture) in enumerate(inputs.items()):
            texture.use(unit)
            program[name] = unit
        output.bind_to_image(0, read=True, write=True)
        program.run(*shader.groups(*output.size))
        self.context.memory_barrier()

    def release(self) -> None:
        for texture in self._owned:
            texture.release()
