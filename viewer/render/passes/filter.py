"""The depth filter as compute passes: raw picture and depth in, keep-mask and filtered picture out.

One class for each family of presets; ``model/reference/depth_filter.py`` is the reference implementation.  Textures have row 0
at the top; mask is R8, 1 where kept; filtered is RGBA8, all zero where not.
"""

import itertools
from functools import partial
from typing import Any

import moderngl

from ....model.reference import filter_constants as constants
from ..device import shader
from ..device.compute_pass import Pass

_SHARED: dict[str, Any] = {
    "EMPTY": constants.EMPTY,
    "TWIST": constants.TWIST,
    "STEEPEST": constants.STEEPEST,
    "SAME_SURFACE_FACTOR": 1.0 - constants.SAME_SURFACE,
    "SUPPORT_LIMIT": 36.0 * constants.SUPPORT,
    "SUPPORT_LIMIT_SHARED": 36.0 * constants.SUPPORT_SHARED,
    "CHILDREN": float(constants.CHILDREN),
    "CLUMPED": constants.CLUMPED,
}


def level_sizes(size: tuple[int, int], levels: int) -> list[tuple[int, int]]:
    """Sizes of the levels above the picture, each half of the one below, rounded up."""
    out = []
    for _ in range(levels):
        size = ((size[0] + 1) // 2, (size[1] + 1) // 2)
        out.append(size)
    return out


def _passes(programs: shader.Programs, preset: str) -> dict[str, Pass]:
    """The passes of a preset, by their part: ``base`` writes the pictures; the others, levels of the pyramid."""
    pictures, named = ("mask", "filtered"), f"depth filter, {preset}"
    if preset == "off":
        return {"base": Pass(programs, named, "filter_off.comp", outputs=pictures, inputs=("level", "raw"))}
    if preset == "auto":
        down = partial(Pass, programs, f"{named}, down", "filter_down.comp", outputs=("coarse",), inputs=("fine",), **_SHARED)
        up = partial(Pass, programs, f"{named}, up", "filter_up.comp", outputs=("threshold",), uniforms=("tolerance", "mirror"),
                     **_SHARED)  # fmt: skip
        return {
            "down_base": down(BASE=1), "down": down(),
            "top": up(inputs=("level",), TOP=1), "up": up(inputs=("level", "coarse")),
            "base": Pass(programs, named, "filter_keep.comp", outputs=pictures, inputs=("level", "coarse", "raw"),
                         uniforms=("tolerance",), block=2, **_SHARED),
        }  # fmt: skip
    flavour: dict[str, Any] = {"paper-code": {"PUBLISHED": 1}, "npbg++": {"NPBG": 1}}.get(preset, {})
    up = partial(Pass, programs, f"{named}, up", "filter_parents_up.comp", uniforms=("tolerance", "shift_by"), **flavour,
                 **_SHARED)  # fmt: skip
    down = Pass(programs, f"{named}, down", "filter_parents_down.comp", outputs=("coarse",), inputs=("fine",), **_SHARED)
    made = {"down_base": down, "down": down, "base": up(outputs=pictures, inputs=("level", "coarse", "raw"), BASE=1)}
    if preset != "npbg++":
        made["up"] = up(outputs=("refilled",), inputs=("level", "coarse"))
    return made


class DepthFilter:
    """Keeps the pixels whose depth belongs to the foremost surface."""

    def __init__(self, programs: shader.Programs, size: tuple[int, int], preset: str, levels: int | None = None):
        context = programs.context
        self.context, self.size, self.preset, self.wanted_levels = context, size, preset, levels
        self.levels = 0 if preset == "off" else (constants.LEVELS[preset] if levels is None else levels)
        self.mask = context.texture(size, 1, dtype="f1")
        self.filtered = context.texture(size, 4, dtype="f1")
        sizes = level_sizes(size, self.levels)
        pair = 2 if preset == "auto" else 1
        self._down = [context.texture(s, pair, dtype="f4") for s in sizes]
        self._up = [context.texture(s, 1, dtype="f4") for s in sizes] if preset != "npbg++" else []
        self._programs, self._passes = programs, _passes(programs, preset)

    def run(self, raw: moderngl.Texture, depth: moderngl.Texture, *, strength: float = 1.0, metre: float = 1.0) -> None:
        """Fills ``mask`` and ``filtered``.  strength: multiplies the tolerance.  metre: file units in a metre."""
        inputs = {"level": depth, "raw": raw}
        if self.preset != "off":
            inputs["coarse"] = depth
        if self._down:
            self._passes["down_base"].run(self._down[0], inputs={"fine": depth})
            inputs["coarse"] = self._climb(strength, metre, self.levels)
        self._passes["base"].run(self.mask, self.filtered, inputs=inputs, **self._limits(strength, metre))

    def _limits(self, strength: float, metre: float, level: int = 0) -> dict[str, Any]:
        """The uniforms that say how much nearer is nearer, of this preset, and of a level of preset auto."""
        if self.preset == "off":
            return {}
        if self.preset == "auto":
            return {"tolerance": constants.hiding_limits(level, strength)}
        edge = constants.EDGE * (metre if self.preset == "paper-code" else 1.0)
        return {"tolerance": (1.0 + constants.PARENT_RATIO * strength, edge, constants.NPBG_DEPTH * strength * metre),
                "shift_by": self.levels}

    def _climb(self, strength: float, metre: float, levels: int) -> moderngl.Texture:
        """From level 1, which exists, to coarser levels up to ``levels`` (at least 1) and back; returns the texture that level
        0 is compared with."""
        for fine, coarse in itertools.pairwise(self._down[:levels]):
            self._passes["down"].run(coarse, inputs={"fine": fine})
        top = self._down[levels - 1]
        if self.preset == "auto":
            top = self._up_to(levels, "top", {}, strength, metre)
        if self.preset in ("auto", "paper-code", "paper-text"):
            for level in range(levels - 1, 0, -1):
                top = self._up_to(level, "up", {"coarse": top}, strength, metre)
        return top

    def _up_to(self, level: int, part: str, coarser: dict[str, moderngl.Texture], strength: float, metre: float
               ) -> moderngl.Texture:
        """Makes what a level (1: the finest) is compared with; returns it."""
        mirror = {"mirror": int(level in constants.MIRRORED)} if self.preset == "auto" else {}
        made = self._up[level - 1]
        self._passes[part].run(made, inputs={"level": self._down[level - 1], **coarser}, **mirror,
                               **self._limits(strength, metre, level))  # fmt: skip
        return made

    def closing(self, keys: moderngl.Buffer, *, strength: float, levels: int) -> moderngl.Texture:
        """R32F, half the size: for each 2x2 pixels the inverse depth below which ``levels`` levels would remove a point, and
        0 where they would not.  keys: nearest depths of the whole picture, as the compute rasteriser keeps them.  Only with
        preset auto; valid until the next run.
        """
        if "down_keys" not in self._passes:  # needed only for occlusion culling
            self._passes["down_keys"] = Pass(self._programs, "depth filter, down from keys", "filter_down.comp", FROM_KEYS=1,
                                             outputs=("coarse",), buffers=("KEYS",), uniforms=("size",), **_SHARED)  # fmt: skip
        self._passes["down_keys"].run(self._down[0], buffers={"KEYS": keys}, size=self.size)
        return self._climb(strength, 1.0, min(levels, self.levels))

    def release(self) -> None:
        for resource in (self.mask, self.filtered, *self._down, *self._up):
            resource.release()
