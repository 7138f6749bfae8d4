"""The depth filter as compute passes: raw picture and depth in, keep-mask and filtered picture out.

One class for each family of presets; ``model/reference/depth_filter.py`` is the reference implementation.  Textures have row 0
at the top; mask is R8, 1 where kept; filtered is RGBA8, all zero where not.
"""

import itertools

import moderngl

from ....model.reference import filter_constants as constants
from ..device import shader
from ..device.shader import BINDINGS

_SHARED = {
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


def _programs(programs: shader.Programs, preset: str) -> dict[str, moderngl.ComputeShader]:
    if preset == "off":
        return {"base": programs.compute("filter_off.comp")}
    if preset == "auto":
        return {
            "down_base": programs.compute("filter_down.comp", BASE=1, **_SHARED),
            "down": programs.compute("filter_down.comp", **_SHARED),
            "top": programs.compute("filter_up.comp", TOP=1, **_SHARED),
            "up": programs.compute("filter_up.comp", **_SHARED),
            "quads": programs.compute("filter_keep.comp", **_SHARED),
        }
    flavour = {"paper-code": {"PUBLISHED": 1}, "npbg++": {"NPBG": 1}}.get(preset, {})
    made = {
        "down": programs.compute("filter_parents_down.comp", **_SHARED),
        "base": programs.compute("filter_parents_up.comp", BASE=1, **flavour, **_SHARED),
    }
    if preset != "npbg++":
        made["up"] = programs.compute("filter_parents_up.comp", **flavour, **_SHARED)
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
        self._programs = _programs(programs, preset)
        self._compile = programs.compute

    def run(self, raw: moderngl.Texture, depth: moderngl.Texture, *, strength: float = 1.0, metre: float = 1.0) -> None:
        """Fills ``mask`` and ``filtered``.  strength: multiplies the tolerance.  metre: file units in a metre."""
        tolerance, top = self._tolerance(strength, metre), depth
        if self._down:
            self._pass("down_base" if "down_base" in self._programs else "down", self._down[0].size, self._down[:1], fine=depth)
            top = self._climb(strength, metre, self.levels)
        name, size = ("quads", level_sizes(self.size, 1)[0]) if "quads" in self._programs else ("base", self.size)
        self._pass(name, size, [self.mask, self.filtered], tolerance, level=depth, coarse=top, raw=raw)

    def _tolerance(self, strength: float, metre: float, level: int = 0) -> tuple[float, float, float]:
        """The three numbers of the uniform ``tolerance`` for this preset, and for a level of preset auto."""
        if self.preset == "auto":
            return constants.hiding_limits(level, strength)
        edge = constants.EDGE * (metre if self.preset == "paper-code" else 1.0)
        return 1.0 + constants.PARENT_RATIO * strength, edge, constants.NPBG_DEPTH * strength * metre

    def _climb(self, strength: float, metre: float, levels: int) -> moderngl.Texture:
        """From level 1, which exists, to coarser levels up to ``levels`` (at least 1) and back; returns the texture that level
        0 is compared with."""
        for fine, coarse in itertools.pairwise(self._down[:levels]):
            self._pass("down", coarse.size, [coarse], fine=fine)
        top = self._down[levels - 1]
        if self.preset == "auto":
            self._mirror("top", levels)
            self._pass("top", self._up[levels - 1].size, [self._up[levels - 1]], self._tolerance(strength, metre, levels),
                       level=top)
            top = self._up[levels - 1]
        if self.preset in ("auto", "paper-code", "paper-text"):
            for index in range(levels - 2, -1, -1):
                self._mirror("up", index + 1)
                self._pass("up", self._up[index].size, [self._up[index]], self._tolerance(strength, metre, index + 1),
                           level=self._down[index], coarse=top)
                top = self._up[index]
        return top

    def _mirror(self, name: str, level: int) -> None:
        program = self._programs[name]
        if "mirror" in program:
            program["mirror"] = int(level in constants.MIRRORED)

    def closing(self, keys: moderngl.Buffer, *, strength: float, levels: int) -> moderngl.Texture:
        """R32F, half the size: for each 2x2 pixels the inverse depth below which ``levels`` levels would remove a point, and
        0 where they would not.  keys: nearest depths of the whole picture, as the compute rasteriser keeps them.  Only with
        preset auto; valid until the next run.
        """
        if "down_keys" not in self._programs:  # needed only for occlusion culling
            self._programs["down_keys"] = self._compile("filter_down.comp", FROM_KEYS=1, **_SHARED)
        keys.bind_to_storage_buffer(BINDINGS["KEYS"])
        self._programs["down_keys"]["size"] = self.size
        self._pass("down_keys", self._down[0].size, self._down[:1])
        return self._climb(strength, 1.0, min(levels, self.levels))

    def _pass(self, name: str, size: tuple[int, int], outputs: list[moderngl.Texture],
              tolerance: tuple[float, float, float] | None = None, **inputs: moderngl.Texture) -> None:
        program = self._programs[name]
        for unit, (sampler, texture) in enumerate(inputs.items()):
            if sampler in program:
                texture.use(unit)
                program[sampler] = unit
        for unit, texture in enumerate(outputs):
            texture.bind_to_image(unit, read=False, write=True)
        if tolerance is not None and "tolerance" in program:
            program["tolerance"] = tolerance
        if "shift_by" in program:
            program["shift_by"] = self.levels
        program.run(*shader.groups(*size))
        self.context.memory_barrier()

    def release(self) -> None:
        for resource in (self.mask, self.filtered, *self._down, *self._up):
            resource.release()
