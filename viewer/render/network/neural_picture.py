"""From the network's pixels, as a bridge holds them, to a picture: unpacked, bounded by the filled picture's alpha, under the
colours of the photographs.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import in_rows
from ..device.compute_pass import Pass
from ..photographs.kept_photographs import OVER_NETWORK, KeptPhotographs, OverNetwork, PhotoColours
from .bridge import Bridge, ReadBackBridge
from .present_loops import present_rows

if TYPE_CHECKING:
    import moderngl

    from ..device.compute_pass import Storage
    from ..device.shader import Programs

_LEAST_ROWS = 32
"""Fewest rows of a thread, when a picture is made of the network's output."""


def unpacking(programs: "Programs", *, copied: bool, bounded: bool = True, photographs: bool = False) -> Pass:
    """The pass that makes a picture of the network's pixels.  copied: they are in a texture, not a buffer.  bounded: the filled
    picture's alpha is a bound.  photographs: their colours come over it, and if bounded, how far is written, too."""
    inputs = (*(("filled",) if bounded else ()), *(("copied",) if copied else ()),
              *(("photographs", "grid", "block_apart") if photographs else ()))
    counted = photographs and bounded
    return Pass(programs, "network's picture", "network_output.comp", outputs=("neural", *(("counted",) if counted else ())),
                inputs=inputs, buffers=() if copied else ("NETWORK",), COPIED=1 if copied else None,
                BOUNDED=1 if bounded else None, PHOTOGRAPHS=1 if photographs else None, COUNTED=1 if counted else None,
                **(OVER_NETWORK if photographs else {}))  # fmt: skip


class NeuralPicture:
    """Owns the picture of one size and the passes that write it.

    copied: whether the network's pixels come in a texture (ReadBackBridge), not in a buffer.
    texture: RGBA8, what was shown last.
    """

    def __init__(self, programs: "Programs", size: tuple[int, int], *, copied: bool):
        self._programs, self._copied = programs, copied
        self.texture = programs.context.texture(size, 4, dtype="f1")
        self._passes: dict[tuple[bool, bool], Pass] = {}  # (bounded, with photographs), each made when it is first needed
        self._pass(bounded=True, photographs=False)
        self._share: moderngl.Texture | None = None
        self._has_photographs = False
        self._contradictions: OverNetwork | None = None

    @property
    def photo_share(self) -> "moderngl.Texture | None":
        """R8: how much of each pixel of ``texture`` is from photographs; None: nothing."""
        return self._share if self._has_photographs else None

    def show(self, bridge: Bridge, filled: "moderngl.Texture", photographs: PhotoColours | None, shown: np.ndarray | None
             ) -> None:
        """Writes the output of ``bridge`` into ``texture``.  filled: the picture whose alpha bounds it.  photographs: what
        comes over it.  shown: of CpuFill, the filled picture in main memory, if it is there."""
        self._has_photographs = photographs is not None
        if shown is not None and isinstance(bridge, ReadBackBridge) and photographs is None:
            return self._show_by_loops(bridge, shown)
        outputs = [self.texture]
        inputs: dict[str, moderngl.Texture] = {"copied": bridge.output_texture()} if isinstance(bridge, ReadBackBridge) else {}
        buffers = {} if inputs else {"NETWORK": bridge.output}
        if photographs is not None:
            self._share = self._share or self._programs.context.texture(self.texture.size, 1, dtype="f1", alignment=1)
            outputs.append(self._share)
            inputs |= self._over(photographs, inputs, buffers)
        unpack = self._pass(bounded=True, photographs=photographs is not None)
        unpack.run(*outputs, inputs={**inputs, "filled": filled}, buffers=buffers)

    def _show_by_loops(self, bridge: ReadBackBridge, shown: np.ndarray) -> None:
        """The same in compiled loops."""
        (width, height), made = self.texture.size, np.empty(len(shown), np.uint32)
        in_rows(height, _LEAST_ROWS, present_rows, bridge.made.reshape(-1).view(np.uint16), shown, width, made)
        self.texture.write(made)

    def write_into(self, target: "moderngl.Texture", bridge: ReadBackBridge, kept: KeptPhotographs | None) -> None:
        """Writes the output of ``bridge`` into ``target``, without the bound of a filled picture.  kept: what comes over it."""
        inputs = {"copied": bridge.output_texture()}
        if kept is not None:
            inputs |= self._over(kept, inputs, {})
        self._pass(bounded=False, photographs=kept is not None).run(target, inputs=inputs)

    def _pass(self, *, bounded: bool, photographs: bool) -> Pass:
        key = bounded, photographs
        if key not in self._passes:
            self._passes[key] = unpacking(self._programs, copied=self._copied, bounded=bounded, photographs=photographs)
        return self._passes[key]

    def _over(self, photographs: PhotoColours, source: "dict[str, moderngl.Texture]", buffers: "Mapping[str, Storage]"
              ) -> "dict[str, moderngl.Texture]":
        self._contradictions = self._contradictions or OverNetwork(self._programs, photographs.grid.size, copied=self._copied)
        return self._contradictions.inputs(photographs, source, buffers)

    def release(self) -> None:
        for owned in (self.texture, self._share, self._contradictions):
            if owned is not None:
                owned.release()
