"""Pull-push fill as compute passes: the filled picture and, for the neural view, the network's input.

``model/reference/pull_push.py`` is the reference implementation.  The network's input is eight half-precision channels a
pixel, channels last, in a storage buffer that CUDA can map as plain memory (see shaders/fill_picture.comp).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import log2
from typing import TYPE_CHECKING, Any

import moderngl

from ....model.network.network_layout import DEPTH_FEATURE_LIMIT, DEPTH_FEATURE_SCALE
from ....model.reference.fill_constants import EMPTY_FEATURE, FIRST_LEVEL, NEARER_SCALE, NEARER_START, wider_ramp
from ..culling.enclosed_directions import CLOSED, SEALED, SIDE, Directions, closed_in_view
from ..device.compute_pass import Pass
from .filter import level_sizes
from .hole_test import HoleTest

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ..device.compute_pass import Storage
    from ..device.shader import Programs

_CONSTANTS: dict[str, Any] = {"FEATURE_SCALE": DEPTH_FEATURE_SCALE, "FEATURE_LIMIT": DEPTH_FEATURE_LIMIT}
_BACKGROUND: dict[str, Any] = {
    "BACKGROUND": 1, "EMPTY_FEATURE": EMPTY_FEATURE, "NEARER_SCALE": NEARER_SCALE, "NEARER_START": NEARER_START,
}  # fmt: skip

_PULLED, _PUSHED = ("coarse_value", "coarse_weight", "coarse_noise"), ("out_value", "out_noise")


def footprint_feature(camera: "Camera", spacing: float) -> float | None:
    """Depth feature of every pixel by its size, which is the same everywhere in an orthographic picture; None of a pinhole."""
    return None if camera.orthographic is None else DEPTH_FEATURE_SCALE * log2(camera.orthographic / (camera.fx * spacing))


@dataclass(frozen=True)
class _Noise:
    """The noise level's own pyramid, beside that of colour and depth."""

    values: list[moderngl.Texture]
    pushed: list[moderngl.Texture]


class Fill:
    """Owns the pyramid for one picture size; ``run`` fills ``filled`` (RGBA8, alpha 0 where there is background) and, where
    asked, ``depth`` (R32F, view-space z in file units of the filled picture, 0 where it is not opaque) and the network's input.
    """

    def __init__(self, programs: "Programs", size: tuple[int, int]):
        context = programs.context
        self.context, self.size = context, size
        levels = max(1, (max(size) - 1).bit_length())
        sizes = level_sizes(size, levels)
        self.filled = context.texture(size, 4, dtype="f1")
        self._values = [context.texture(s, 4, dtype="f4") for s in sizes]
        self._weights = [context.texture(s, 1, dtype="f4") for s in sizes]
        self._pushed = [context.texture(s, 4, dtype="f4") for s in sizes[:-1]]
        self._hole_test = HoleTest(programs, size, self._weights)
        self._closed = context.texture((SIDE, 6 * SIDE), 1, dtype="i1", alignment=1)
        self.depth: moderngl.Texture | None = None  # made when it is first asked for
        self._noise: _Noise | None = None  # made when a noise level is first given
        self._programs = programs
        self._passes: dict[tuple, Pass] = {}

    def run(self, raw: moderngl.Texture, mask: moderngl.Texture, depth: moderngl.Texture, *, camera: "Camera",
            around: Directions, spacing: float, network: "Storage | None" = None,
            noise: moderngl.Texture | None = None, with_depth: bool = False, widened: float = 0.0) -> None:
        """depth: Frame.ratio_depth.  around: the directions from the camera position.  spacing: of points, file units.
        network: the input buffer to write, or None.  noise: one float a pixel, the noise level as the network takes it, 0 where
        nothing is measured; None: 0 everywhere.  It is filled for the network only.
        with_depth: whether ``depth`` is written, too.
        widened: of model.reference.fill_constants.Averaging.widening."""
        if network is None:
            noise = None
        feature_scale = 1.0 / (camera.fx * spacing)
        base = {"raw": raw, "depth": depth, "mask": mask} | ({} if noise is None else {"noise": noise})
        coarse, is_sum = self._pyramid(base, feature_scale, footprint_feature(camera, spacing), widened)
        view = closed_in_view(around.closed, camera)
        if view not in (CLOSED, SEALED):  # else no direction in view is background, and the hole test is not needed
            self._hole_test.run(camera, around.occupancy)
        self._closed.write(around.closed)
        inputs = {**base, **coarse, "holes": self._hole_test.holes, "whole_weight": self._weights[-1]}
        uniforms: dict[str, Any] = {"feature_scale": feature_scale, "coarse_is_sum": is_sum}
        if view is None:
            inputs["closed"] = self._closed
            uniforms["to_world"] = tuple(camera.view_rotation.ravel())  # rows of world -> view are columns of view -> world
            uniforms["lens"] = (camera.fx, camera.fy, camera.cx, camera.cy)
        outputs = {"filled": self.filled}
        if with_depth:
            self.depth = self.depth or self.context.texture(self.size, 1, dtype="f4")
            outputs["filled_depth"] = self.depth
        push = self._pass("fill_picture.comp", tuple(outputs), inputs, uniforms, base=True, noise=noise is not None,
                          writes=network is not None, ALIKE=view, SEALED=SEALED, DEPTH=1 if with_depth else None)
        push.run(*outputs.values(), inputs=inputs, buffers={} if network is None else {"NETWORK": network}, **uniforms)

    def _pyramid(self, base: dict[str, moderngl.Texture], feature_scale: float, footprint: float | None,
                 widened: float) -> tuple[dict[str, moderngl.Texture], int]:
        """Pulls and pushes.  Returns the filled textures of level 1, and 1 where they still carry their weight, else 0.

        footprint: :func:`footprint_feature`.  widened: as of :meth:`run`."""
        carried = self._noise_pyramid() if "noise" in base else _Noise([], [])
        noisy = bool(carried.values)
        levels = [{"value": value, "weight": weight} for value, weight in zip(self._values, self._weights, strict=True)]
        for level, noise in zip(levels, carried.values, strict=False):
            level["noise"] = noise
        for index, level in enumerate(levels):  # the children's level; ``levels`` starts at level 1
            below, background = levels[index - 1] if index else base, index >= FIRST_LEVEL
            uniforms: dict[str, Any] = {} if index else {"feature_scale": feature_scale}
            if background:
                uniforms["wider"] = wider_ramp(index - widened, footprint)
            pull = self._pass("fill_pull.comp", _PULLED[: len(level)], below, uniforms, base=index == 0, noise=noisy,
                              background=background)
            pull.run(*level.values(), inputs=below, **uniforms)
        coarse, is_sum = {"coarse": self._values[-1]} | ({"coarse_noise": carried.values[-1]} if noisy else {}), 1
        for index in range(len(self._pushed) - 1, -1, -1):
            above = index + 2  # the level of ``coarse``
            made = {"coarse": self._pushed[index]} | ({"coarse_noise": carried.pushed[index]} if noisy else {})
            inputs = {**coarse, **levels[index], "whole_weight": self._weights[-1]}
            uniforms = {"coarse_is_sum": is_sum}
            if background := above >= FIRST_LEVEL:
                uniforms["wider"] = wider_ramp(above - widened, footprint)
            push = self._pass("fill_push.comp", _PUSHED[: len(made)], inputs, uniforms, noise=noisy, background=background)
            push.run(*made.values(), inputs=inputs, **uniforms)
            coarse, is_sum = made, 0
        return coarse, is_sum

    def _noise_pyramid(self) -> _Noise:
        if self._noise is None:
            like = self._values, self._pushed
            self._noise = _Noise(*([self.context.texture(t.size, 1, dtype="f4") for t in textures] for textures in like))
        return self._noise

    def _pass(self, shader: str, outputs: Sequence[str], inputs: Iterable[str], uniforms: Iterable[str], *, base: bool = False,
              noise: bool = False, background: bool = False, writes: bool = False, **defines: object) -> Pass:
        """A pass, made when it is first needed.  writes: the network's input."""
        key = (shader, base, noise, background, writes, *defines.values())
        if key not in self._passes:
            constants = (_CONSTANTS if base else {}) | (_BACKGROUND if background else {})
            self._passes[key] = Pass(
                self._programs, "fill", shader, outputs=outputs, inputs=tuple(inputs), uniforms=tuple(uniforms),
                buffers=("NETWORK",) if writes else (), block=2 if "filled" in outputs else 1, BASE=base or None,
                NOISE=noise or None, NETWORK=1 if writes else None, **constants, **defines)
        return self._passes[key]

    def release(self) -> None:
        carried = [*self._noise.values, *self._noise.pushed] if self._noise else []
        depth = [] if self.depth is None else [self.depth]
        for resource in (self.filled, self._closed, *depth, *self._values, *self._weights, *self._pushed, *carried):
            resource.release()
        self._hole_test.release()
