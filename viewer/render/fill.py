"""Pull-push fill as compute passes: the filled picture and, for the neural view, the network's input.

``model/pull_push.py`` is the twin.  The network's input is eight half-precision channels a pixel, channels last, in a
storage buffer that CUDA can map as plain memory (see shaders/fill_picture.comp).
"""

from typing import TYPE_CHECKING

import moderngl

from model.project import DEPTH_FEATURE_LIMIT, DEPTH_FEATURE_SCALE
from viewer.render import shader
from viewer.render.filter import level_sizes
from viewer.render.surround import Surround
from viewer.render.void import CLOSED, SEALED, SIDE, Directions, closed_in_view

if TYPE_CHECKING:
    from viewer.camera import Camera
    from viewer.render.bridge import Pixels

INPUT_BYTES = 16  # a pixel
_CONSTANTS = {"FEATURE_SCALE": DEPTH_FEATURE_SCALE, "FEATURE_LIMIT": DEPTH_FEATURE_LIMIT}


class Fill:
    """Owns the pyramid for one picture size; ``run`` fills ``filled`` (RGBA8, alpha 0 in the void) and, where asked, the
    network's input."""

    def __init__(self, programs: shader.Programs, size: tuple[int, int]):
        context = programs.context
        self.context, self.size = context, size
        levels = max(1, (max(size) - 1).bit_length())
        sizes = level_sizes(size, levels)
        self.filled = context.texture(size, 4, dtype="f1")
        self._values = [context.texture(s, 4, dtype="f4") for s in sizes]
        self._weights = [context.texture(s, 1, dtype="f4") for s in sizes]
        self._pushed = [context.texture(s, 4, dtype="f4") for s in sizes[:-1]]
        self._surround = Surround(programs, size, self._weights)
        self._closed = context.texture((SIDE, 6 * SIDE), 1, dtype="i1", alignment=1)
        self._pull_base = programs.compute("fill_pull.comp", BASE=1, **_CONSTANTS)
        self._pull = programs.compute("fill_pull.comp", **_CONSTANTS)
        self._push = programs.compute("fill_push.comp")
        self._programs = programs
        self._pictures: dict[tuple[bool, int | None], moderngl.ComputeShader] = {}  # of eight that there are, those in use

    def run(self, raw: moderngl.Texture, mask: moderngl.Texture, depth: moderngl.Texture, *, camera: "Camera",
            around: Directions, spacing: float, network: "Pixels | None" = None) -> None:
        """around: the directions from the camera's place.  spacing: of points, file units.
        network: the input buffer to write, or None."""
        feature_scale = 1.0 / (camera.fx * spacing)
        base = {"raw": raw, "depth": depth, "mask": mask}
        for index, (value, weight) in enumerate(zip(self._values, self._weights, strict=True)):
            inputs = {"value": self._values[index - 1], "weight": self._weights[index - 1]} if index else base
            self._pass(self._pull if index else self._pull_base, value.size, [value, weight], inputs, feature_scale)
        coarse, is_sum = self._values[-1], 1
        for index in range(len(self._pushed) - 1, -1, -1):
            inputs = {"coarse": coarse, "value": self._values[index], "weight": self._weights[index]}
            self._pass(self._push, self._pushed[index].size, [self._pushed[index]], inputs, feature_scale, is_sum)
            coarse, is_sum = self._pushed[index], 0
        view = closed_in_view(around.closed, camera)
        if view not in (CLOSED, SEALED):  # else no direction in the picture is void: nobody asks which pixels are surrounded
            self._surround.run(camera, around.occupancy)
        self._closed.write(around.closed)
        if network is not None:
            network.bind_to_storage_buffer(shader.BINDINGS["NETWORK"])
        push = self._picture(network is not None, view)
        if view is None:
            push["to_world"] = tuple(camera.view_rotation.ravel())  # rows of world -> view are columns of view -> world
            push["lens"] = (camera.fx, camera.fy, camera.cx, camera.cy)
        inputs = {**base, "coarse": coarse, "holes": self._surround.holes, "closed": self._closed}
        self._pass(push, level_sizes(self.size, 1)[0], [self.filled], inputs, feature_scale, is_sum)

    def _picture(self, network: bool, view: int | None) -> moderngl.ComputeShader:
        """The last pass, compiled when it is first needed."""
        if (network, view) not in self._pictures:
            self._pictures[network, view] = self._programs.compute(
                "fill_picture.comp", BASE=1, NETWORK=network or None, ALIKE=view, SEALED=SEALED, **_CONSTANTS
            )
        return self._pictures[network, view]

    def _pass(self, program: moderngl.ComputeShader, size: tuple[int, int], outputs: list[moderngl.Texture],
              inputs: dict[str, moderngl.Texture], feature_scale: float, is_sum: int = 0) -> None:
        for unit, (name, texture) in enumerate({**inputs, "whole_weight": self._weights[-1]}.items()):
            if name in program:
                texture.use(unit)
                program[name] = unit
        for unit, texture in enumerate(outputs):
            texture.bind_to_image(unit, read=False, write=True)
        if "feature_scale" in program:
            program["feature_scale"] = feature_scale
        if "coarse_is_sum" in program:
            program["coarse_is_sum"] = is_sum
        program.run(*shader.groups(*size))
        self.context.memory_barrier()

    def release(self) -> None:
        for resource in (self.filled, self._closed, *self._values, *self._weights, *self._pushed):
            resource.release()
        self._surround.release()
