"""What comes over the network's picture: the photographs' own colours, and those kept of a picture whose network goes on.

shaders/network_output.comp lays them over it.  While a network goes on in flight, later pictures write their own colours into
the same textures (photo_pass): a copy stays with the run.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Protocol

from ....model.reference import photo_colours as constants
from ..device.compute_pass import Pass

if TYPE_CHECKING:
    import moderngl

    from ..device.compute_pass import Storage
    from ..device.shader import Programs

OVER_NETWORK: dict[str, Any] = {
    "BLOCK": constants.BLOCK,
    **{f"{name}_{end}": getattr(constants, name)[k] for name in ("OVER", "DENSE", "APART", "CONTRADICTED")
       for k, end in enumerate(("FROM", "TO"))},
}  # fmt: skip
"""Constants of the shader."""


class PhotoColours(Protocol):
    """colours: RGBA8, the photographs' own colours with their share as alpha.  grid: R32F, by block, pixels between measured
    pixels."""

    @property
    def colours(self) -> "moderngl.Texture": ...
    @property
    def grid(self) -> "moderngl.Texture": ...


class OverNetwork:
    """Owns what a picture size needs to compare photographs with the network's picture.  copied: as of network_output.comp."""

    def __init__(self, programs: "Programs", blocks: tuple[int, int], *, copied: bool):
        self._apart = programs.context.texture(blocks, 4, dtype="f4")
        self._pass = Pass(programs, "photographs and network", "photo_apart.comp", outputs=("apart",),
                          inputs=("photographs", *(("copied",) if copied else ())), buffers=() if copied else ("NETWORK",),
                          BLOCK=constants.BLOCK, COPIED=1 if copied else None)

    def inputs(self, photographs: PhotoColours, source: "dict[str, moderngl.Texture]", buffers: "Mapping[str, Storage]"
               ) -> "dict[str, moderngl.Texture]":
        """Inputs of network_output.comp for these photographs.  source, buffers: where it finds the network's output."""
        colours = {"photographs": photographs.colours}
        self._pass.run(self._apart, inputs={**colours, **source}, buffers=buffers)
        return {**colours, "grid": photographs.grid, "block_apart": self._apart}

    def release(self) -> None:
        self._apart.release()


class KeptPhotographs:
    """Owns copies for the picture size of ``like``."""

    def __init__(self, context: "moderngl.Context", like: PhotoColours):
        self._context = context
        self.colours = context.texture(like.colours.size, 4, dtype="f1")
        self.grid = context.texture(like.grid.size, 1, dtype="f4")
        self._targets = context.framebuffer([self.colours]), context.framebuffer([self.grid])
        self._sources: tuple[PhotoColours, list[moderngl.Framebuffer]] | None = None  # of what was copied last

    def take(self, photographs: PhotoColours) -> None:
        """Copies what they hold now."""
        if self._sources is None or self._sources[0] is not photographs:
            self._forget_source()
            made = [self._context.framebuffer([texture]) for texture in (photographs.colours, photographs.grid)]
            self._sources = photographs, made
        for target, source in zip(self._targets, self._sources[1], strict=True):
            self._context.copy_framebuffer(target, source)

    def _forget_source(self) -> None:
        for source in self._sources[1] if self._sources is not None else ():
            source.release()
        self._sources = None

    def release(self) -> None:
        self._forget_source()
        for owned in (*self._targets, self.colours, self.grid):
            owned.release()
