"""Buffers that the host writes while the GPU may still read what was in them.

To write into a buffer that a submitted frame uses makes the driver wait for that frame, or copy.  On a GPU it is orphaned
first: the driver gives it new storage, and the old one lives until the frame is done.  In software OpenGL nothing is in use any
more when the next frame is written, and new storage would be zeroed.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import moderngl
    import numpy as np

_LEAST = 4096  # bytes


class GrowingBuffer:
    """A buffer, rewritten every frame, that only ever grows, so that a steady frame allocates nothing of its own.

    orphans: new storage for each write (on a GPU).
    """

    def __init__(self, context: "moderngl.Context", *, orphans: bool = False):
        self.buffer = context.buffer(reserve=_LEAST, dynamic=True)
        self._orphans = orphans

    def reserve(self, size: int) -> "moderngl.Buffer":
        """Makes room for ``size`` bytes; the contents may be lost."""
        if size > self.buffer.size:
            self.buffer.orphan(1 << (size - 1).bit_length())
        return self.buffer

    def write(self, data: "np.ndarray") -> "moderngl.Buffer":
        """Writes C-contiguous data to the beginning; what was behind it is lost."""
        if data.nbytes > self.buffer.size:
            self.reserve(data.nbytes)
        elif self._orphans:
            self.buffer.orphan(self.buffer.size)
        if data.nbytes:
            self.buffer.write(data)
        return self.buffer


class Uploads:
    """Writes to parts of large buffers.  staged: through a buffer of its own and a copy on the GPU, in turn with its other work
    (on a GPU: a part of a buffer cannot be orphaned)."""

    def __init__(self, context: "moderngl.Context", *, staged: bool):
        self._context = context
        self._staging = GrowingBuffer(context, orphans=True) if staged else None

    def write(self, target: "moderngl.Buffer", data: "np.ndarray", offset: int) -> None:
        """Writes C-contiguous ``data`` to ``target`` at ``offset`` bytes."""
        if self._staging is None:
            target.write(data, offset=offset)
        elif data.nbytes:
            self._context.copy_buffer(target, self._staging.write(data), data.nbytes, write_offset=offset)

    def release(self) -> None:
        """Frees its own buffer."""
        if self._staging is not None:
            self._staging.buffer.release()
            self._staging = None
