"""Reads pixels of the picture on the screen without waiting for the GPU: depth, the filter's mask, and the views.

A reading is a copy into a pixel buffer with a fence behind it (viewer.render.device.read_ring); it is there a frame or two
later, and serves everybody who asks for the same picture.  Who must have the exact answer at once, for a click, waits for it.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...render.device.read_ring import make_ring

if TYPE_CHECKING:
    import moderngl

    from ...render.frame import Frame

_SLOTS = 4
"""Readings under way at the same time: depth, mask and two views of one picture."""


class PixelReader:
    """Reads the frame that was asked for last; on the context's thread only.

    waiting: whether a reading is under way, so that somebody should ask again soon.
    """

    def __init__(self, context: "moderngl.Context"):
        self._context = context
        self._ring = make_ring(context, _SLOTS)
        self._buffers: dict[int, moderngl.Buffer] = {}  # slot -> pixel buffer
        self._number = 0
        self.forget()

    def forget(self) -> None:
        """The frame's textures are about to be released."""
        self._frame: Frame | None = None
        self._under_way: dict[tuple[str, bool], tuple[int, moderngl.Texture]] = {}
        self._read: dict[tuple[str, bool], np.ndarray] = {}

    @property
    def waiting(self) -> bool:
        return bool(self._under_way)

    def read(self, frame: "Frame", name: str, *, texture: "moderngl.Texture | None" = None, wait: bool = False
             ) -> np.ndarray | None:
        """What ``Frame.depth``, ``Frame.mask``, ``Frame.from_photographs`` ("depth", "mask", "photographs") or ``Frame.image``
        of a view gives; None where it is not there yet.  texture: another picture made of the frame, which ``name`` stands for.
        wait: for the reading.

        The frame must be the renderer's last one.  Raises DeviceLostError, and KeyError for a view that was not drawn.
        """
        if frame is not self._frame:
            self.forget()
            self._frame = frame
        key = name, bool(frame.facts.network_pending)  # the network draws into a view of the same frame later
        if key in self._read:
            return self._read[key]
        if name == "mask" and frame.mask_texture is None:
            if (depth := self.read(frame, "depth", wait=wait)) is not None:
                self._read[key] = np.isfinite(depth)
            return self._read.get(key)
        if key not in self._under_way:
            self._begin(key, texture or _texture_of(frame, name))
        self._take(key, wait)
        return self._read.get(key)

    def poll(self) -> None:
        """Takes what has arrived, also where nobody asks for it any more."""
        for key in list(self._under_way):
            self._take(key, wait=False)

    def _begin(self, key: tuple[str, bool], texture: "moderngl.Texture") -> None:
        while len(self._under_way) >= _SLOTS:
            self._take(next(iter(self._under_way)), wait=True)
        self._number += 1
        slot, size = self._number % _SLOTS, _words(texture)
        buffer = self._buffers.get(slot)
        if buffer is None or buffer.size < size:
            if buffer is not None:
                buffer.release()
            buffer = self._buffers[slot] = self._context.buffer(reserve=size)
        texture.read_into(buffer, alignment=1)
        self._ring.push(self._number, [(buffer, 0, size)])
        self._under_way[key] = self._number, texture

    def _take(self, key: tuple[str, bool], wait: bool) -> None:
        """Keeps what has arrived of a reading under way."""
        number, texture = self._under_way[key]
        if not wait and not self._ring.ready(number):
            return
        del self._under_way[key]
        words = self._ring.read(number)
        assert words is not None, "the ring has a slot for every reading under way"
        size, shape = texture.width * texture.height, (texture.height, texture.width)
        if texture.dtype == "f4":
            self._read[key] = words[:size].view(np.float32).reshape(shape).copy()
            return
        pixels = words.view(np.uint8)[:size * texture.components].reshape(*shape, texture.components)
        self._read[key] = pixels[..., 0] > 127 if texture.components == 1 else pixels.copy()

    def release(self) -> None:
        self.forget()
        self._ring.release()
        for buffer in self._buffers.values():
            buffer.release()
        self._buffers.clear()


def _texture_of(frame: "Frame", name: str) -> "moderngl.Texture":
    if name == "depth":
        return frame.depth_texture
    if name == "mask":
        assert frame.mask_texture is not None
        return frame.mask_texture
    view, _, photographs = name.partition(" ")
    return frame.photo_shares[view] if photographs else frame.textures[view]


def _words(texture: "moderngl.Texture") -> int:
    """Bytes of a texture's pixels, in whole words of 4."""
    size = texture.width * texture.height * texture.components * (4 if texture.dtype == "f4" else 1)
    return -(-size // 4) * 4
