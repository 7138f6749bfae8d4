"""The scene's packed points on the GPU, in pages no larger than a storage block may be."""

from typing import TYPE_CHECKING

import numpy as np

from viewer.render.shader import BATCH

if TYPE_CHECKING:
    import moderngl

    from viewer.cloud.scene import Scene

POINT_BYTES = 12


class PointPages:
    """Owns the point buffers.  Page p holds points [p x size, (p + 1) x size) and one batch more, so that a batch that
    starts in a page ends in it."""

    def __init__(self, context: "moderngl.Context", scene: "Scene", storage_limit: int):
        total = len(scene.points)
        self.size = max(BATCH, min(total, storage_limit // POINT_BYTES - BATCH))
        self.buffers: list[moderngl.Buffer] = []
        for start in range(0, total, self.size):
            part = np.ascontiguousarray(scene.points[start : min(start + self.size + BATCH, total)])
            self.buffers.append(context.buffer(part))

    def bounds(self, first: np.ndarray) -> np.ndarray:
        """(P + 1,) positions that split the ascending point numbers ``first`` by page."""
        return np.searchsorted(first, np.arange(len(self.buffers) + 1) * self.size)

    def release(self) -> None:
        for buffer in self.buffers:
            buffer.release()
        self.buffers.clear()
