"""Reprojection: the last neural picture, moved to the camera of a filled one.

While the camera moves on a processor, the network has no time for every picture.  The picture that it made last is then moved
to the present camera by the depth of both pictures: shaders/reproject.comp, or reprojection_loops where OpenGL is software.
``model/reference/reprojection.py`` is the reference implementation.  ``render`` knows nothing of this: a window does it, with
the pictures of its past.
"""

from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import in_rows
from ....model.reference.reprojection import COUNTED, FADES_OVER, MOST_NEARER, SAME_DEPTH, SHARE, WIDER, smoothing_of
from ..device.compute_pass import Pass
from ..device.context import describe_device
from ..device.read_ring import make_ring
from .reprojection_loops import moved_rows

if TYPE_CHECKING:
    import moderngl

    from ...picture.camera import Camera
    from ..device.shader import Programs

_CONSTANTS = {"SAME_DEPTH": SAME_DEPTH, "SHARE": SHARE, "MOST_NEARER": MOST_NEARER, "FADES_OVER": FADES_OVER,
              "COUNTED": COUNTED, "WIDER": WIDER}


BANDS, BAND_ROWS = 4, 10
"""Parts of a picture, over its whole width, in which is measured how far the network smoothed it.  In 15 pictures of studio,
plant room and demo they tell a share of 0.37 to 0.70 to 0.09."""
_LEAST_ROWS = 16
"""Fewest rows of a thread, as of the fill."""


_COPIES = 3
"""Pictures whose share is kept until the GPU has ended them: it is at most two behind where the window swaps two buffers."""


class Keyframe:
    """A neural picture, and the depth of its pixels; owns both textures.  camera: None until the depth was taken.  smoothing:
    how far the network moved the filled picture's pixels to the means around them, 0..1."""

    def __init__(self, context: "moderngl.Context", size: tuple[int, int]):
        self.size = size
        self.picture = context.texture(size, 4, dtype="f1")
        self.depth = context.texture(size, 1, dtype="f4")
        self._targets = [context.framebuffer([texture]) for texture in (self.picture, self.depth)]
        self._context = context
        self.camera: Camera | None = None
        self.smoothing = 0.0
        self._filled: np.ndarray | None = None
        self._read: tuple[np.ndarray, np.ndarray] | None = None

    def take_depth(self, camera: "Camera", depth: "moderngl.Texture", filled: "moderngl.Texture | None" = None) -> None:
        """Copies the depth of a filled picture, of which the neural picture follows.  filled: that picture; None: it is not
        smoothed."""
        self.camera, self._read = camera, None
        self._copy(depth, 1)
        self._filled = None if filled is None else self._bands(filled)

    def take_picture(self, picture: "moderngl.Texture | np.ndarray") -> None:
        """Copies the neural picture, (H, W, 4) uint8."""
        if isinstance(picture, np.ndarray):
            self.picture.write(np.ascontiguousarray(picture))
        else:
            self._copy(picture, 0)
        self.compare()

    def compare(self) -> None:
        """The neural picture is there: measures how far the network smoothed the filled one."""
        self._read = None
        self.smoothing = 0.0 if self._filled is None else smoothing_of(self._filled, self._bands(self.picture))

    @property
    def read(self) -> tuple[np.ndarray, np.ndarray]:
        """Picture (H, W) uint32 RGBA8 and depth (H, W) float32 in main memory, read once."""
        if self._read is None:
            width, height = self.size
            self._read = (np.frombuffer(self.picture.read(alignment=1), np.uint32).reshape(height, width),
                          np.frombuffer(self.depth.read(alignment=1), np.float32).reshape(height, width))  # fmt: skip
        return self._read

    def _bands(self, texture: "moderngl.Texture") -> np.ndarray:
        """(BANDS, rows, W, 4) uint8 of a picture of this size."""
        width, height = self.size
        rows, source = min(BAND_ROWS, height), self._context.framebuffer([texture])
        bands = [np.frombuffer(source.read((0, (height - rows) * (2 * k + 1) // (2 * BANDS), width, rows), 4), np.uint8)
                 for k in range(BANDS)]
        source.release()
        return np.stack(bands).reshape(BANDS, rows, width, 4)

    def _copy(self, texture: "moderngl.Texture", target: int) -> None:
        source = self._context.framebuffer([texture])
        self._context.copy_framebuffer(self._targets[target], source)
        source.release()

    def release(self) -> None:
        for owned in (*self._targets, self.picture, self.depth):
            owned.release()


class Reprojection:
    """Owns the result of one picture size.

    share: of the pixels, those that were moved, 0 to 1.  A GPU is not waited for: its share is that of an earlier picture.
    loops: whether compiled loops move; None: in software OpenGL.
    """

    def __init__(self, programs: "Programs", size: tuple[int, int], *, loops: bool | None = None):
        self.size = size
        self.result = programs.context.texture(size, 4, dtype="f1")
        self._moved = programs.context.buffer(bytes(4))  # how many pixels the pass has moved
        self._waits = describe_device(programs.context).software
        self._copies, self._copy = make_ring(programs.context, _COPIES), 0  # of these numbers, and the last one's
        self._here = self._waits if loops is None else loops
        self._memory: tuple[np.ndarray, ...] | None = None
        self.share = 0.0
        self._pass = Pass(programs, "reprojection", "reproject.comp", outputs=("result",), block=2,
                          inputs=("filled", "filled_depth", "earlier", "earlier_depth"), buffers=("COMMANDS",),
                          uniforms=("turn", "shift", "ray", "lens", "smoothing"), **_CONSTANTS)

    def run(self, filled: "moderngl.Texture", depth: "moderngl.Texture", camera: "Camera", keyframe: Keyframe
            ) -> "moderngl.Texture":
        """``filled`` with the colours of ``keyframe`` where both show the same surface, in ``result``.

        camera: of ``filled``, of the size of the result.  depth: Frame.filled_depth.
        """
        earlier = keyframe.camera
        assert earlier is not None
        turn = earlier.view_rotation @ camera.view_rotation.T
        shift = earlier.view_rotation @ (np.asarray(camera.position) - earlier.position)
        ray = 1 / camera.fx, 1 / camera.fy, -camera.cx / camera.fx, -camera.cy / camera.fy
        lens = earlier.fx, earlier.fy, earlier.cx, earlier.cy
        smoothing = keyframe.smoothing * min(1.0, self.size[0] / keyframe.size[0]) ** 2  # larger pixels hold less grain
        if self._here:
            self._run_here(filled, depth, keyframe, np.array([*turn.ravel(), *shift, *ray, *lens], np.float32), smoothing)
            return self.result
        if not self._waits:
            self._read_share()
        self._moved.clear()
        self._pass.run(
            self.result, inputs={"filled": filled, "filled_depth": depth, "earlier": keyframe.picture,
                                 "earlier_depth": keyframe.depth}, buffers={"COMMANDS": self._moved},
            turn=tuple(turn.T.ravel()), shift=tuple(shift), ray=ray, lens=lens, smoothing=smoothing)  # fmt: skip
        self._copy += 1
        self._copies.push(self._copy, [(self._moved, 0, 4)])
        if self._waits:
            self._read_share()
        return self.result

    def _run_here(self, filled: "moderngl.Texture", depth: "moderngl.Texture", keyframe: Keyframe, place: np.ndarray,
                  smoothing: float) -> None:
        """By compiled loops.  place: as of moved_rows."""
        width, height = self.size
        if self._memory is None:  # kept: taking fresh memory for each picture costs time
            self._memory = (np.empty((height, width), np.uint32), np.empty((height, width), np.float32),
                            np.empty((height, width), np.uint32), np.zeros(height, np.int64))  # fmt: skip
        pixels, depths, made, counts = self._memory
        filled.read_into(pixels, alignment=1)
        depth.read_into(depths, alignment=1)
        in_rows(height, _LEAST_ROWS, moved_rows, pixels, depths, *keyframe.read, place, np.float32(smoothing), made, counts)
        self.result.write(made)
        self.share = int(counts.sum()) / self._counted

    @property
    def _counted(self) -> int:
        return -(-self.size[0] // COUNTED) * -(-self.size[1] // COUNTED)

    def _read_share(self) -> None:
        """From the latest picture that the GPU has ended, of those that are kept."""
        kept = range(self._copy, max(self._copy - _COPIES, 0), -1)
        ended = next((number for number in kept if self._waits or self._copies.ready(number)), None)
        if ended is not None and (words := self._copies.read(ended)) is not None:
            self.share = int(words[0]) / self._counted

    def release(self) -> None:
        self.result.release()
        self._moved.release()
        self._copies.release()
