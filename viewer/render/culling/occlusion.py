"""Occlusion culling in rounds within one frame: visible cells, then those that they do not hide.

1. The depth of the cells that were visible in an earlier frame is drawn.  2. The depth filter's own passes derive from it the
depth behind which a point shows nowhere: neither in front, nor through a gap, where the filter would remove it.  3. The box of
each cell is tested against a pyramid of that depth; cells that could be visible are drawn too.  2 and 3 are done in rounds, the
nearest cells first (ROUNDS), since these hide most of what a turn or a jump brings into view.  All cells that could be
visible in the end are drawn first in a later frame.  So a cell that comes into view is drawn in the same frame.

A strict test against the depth alone would hide nothing, because points of 1x1 pixel leave gaps everywhere; and a plain closing
of gaps would hide points that the filter keeps.  So only pictures behind the filter use this, and the filter decides.
It remains an approximation: a point that shows nowhere may still influence the filter's decision for its neighbours.  (A
margin of 4 pixels around cells kept 4 to 10 % more points and helped in one of five walks: 0.033 % wrong pixels to 0.019 %.)
"""

import contextlib
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import moderngl
import numpy as np

from ...common.errors import DeviceError
from ...grid.cell_boxes import SHARE_BITS
from ..device.compute_pass import MAX_GROUPS, Pass
from ..device.gpu_buffers import GrowingBuffer
from ..device.read_ring import make_ring
from ..device.shader import BINDINGS, Programs

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.settings import Settings
    from .cull import DrawList


@dataclass(frozen=True)
class HiddenCount:
    """What a frame did not draw because it was hidden."""

    cells_hidden: int
    points_hidden: int


LAG = {True: 1, False: 2}
"""Frames back of the visibility that a frame uses, in software OpenGL, which is done with a frame when it is submitted, and on
a GPU."""
WORTH = 4
"""Points to be drawn, per pixel of the picture, below which occlusion culling costs more than it saves."""
BLOCK_SHIFT = 2
"""Level 0 of the pyramid has blocks of 2**BLOCK_SHIFT pixels a side."""
GAP_LEVELS = 1
"""Levels of the filter that may close a gap here.  With two, the filter's view of a gap still depends on the points behind it:
up to 0.5 % of pixels wrong (20 rooms, 20M points) instead of 0.03 %."""
TEXELS = 8
"""Texels of the pyramid, along a side, that a cell is tested against at most."""
ROUNDS = (2.0, 6.0, 18.0, 40.0)
"""Points a pixel of the cells that are nearer than those of the second, third, ... round of tests.  Of a walk through 20 rooms
(100 million points, 24 frames) 142 million points are drawn of 802; 160 without the last value, 137 with (2, 5, 10, 20, 40),
272 with one round behind the nearest quarter of the points."""
LAST = len(ROUNDS) + 1
"""Number of the last round; 0: what is drawn without a test."""
SEEN, DRAWN = 1, 2
"""Bits of a cell's flag: could be visible; is drawn.  The others hold its round."""
_ROUND_SHIFT = 2
_DISTANCE_SHIFT = 20
"""Bits of the squared distance, as float32, that are dropped where cells are ordered: steps of 3 to 6 % of the distance are
left."""
_LEVELS = 16
"""Levels of the pyramid at most: for pictures up to 2**17 pixels a side."""
_CELLS_A_GROUP = 64
"""Cells that a workgroup tests: a multiple of every GPU's wave."""


@dataclass(frozen=True)
class History:
    """Occlusion culling of one frame: its caller's memory and the scene.

    closing: of a buffer of nearest depths, the texture with the depth below which the frame's filter would close a gap of
    GAP_LEVELS (viewer.render.passes.filter.DepthFilter.closing).
    """

    memory: "Occlusion"
    scene: "Scene"
    closing: Callable[[moderngl.Buffer], moderngl.Texture]


class Occlusion:
    """Which cells were visible in an earlier frame.  Owned by the caller, one for each moving picture; nothing is on the GPU.

    On a GPU the flags of the frame before the previous one are used: those of the previous one may not be there yet, and
    waiting for them would leave the GPU without work.  A changed scene or picture size, or another caller's frame in between,
    makes it forget, which costs time and changes no pixel.
    """

    def __init__(self) -> None:
        self._scene: Scene | None = None
        self._seen = np.zeros(0, np.uint8)  # by cell of the scene; all zero between frames
        self._rounds = np.zeros(0, np.uint8)
        self._frames: deque[tuple[OcclusionPasses, int, np.ndarray, int]] = deque()  # whose, number, cells (longer), how many
        self._spare: list[np.ndarray] = []

    def forget(self) -> None:
        """Makes the next frame a first one."""
        self._spare += [rows for _, _, rows, _ in self._frames]
        self._frames.clear()

    def recall(self, scene: "Scene", draw: "DrawList", hider: "OcclusionPasses") -> np.ndarray:
        """(V,) uint8: the round in which each cell of the draw list is tested, 0 for those drawn without a test; valid until
        the next call."""
        cells = len(scene.cell_coords)
        if scene is not self._scene:
            self._frames.clear()
            self._spare = []
            self._scene = scene
            self._seen, self._rounds = np.zeros(cells, np.uint8), np.zeros(cells, np.uint8)
        rounds = self._rounds[: len(draw.cells)]
        rounds[:] = 0
        while len(self._frames) > hider.lag:
            self._spare.append(self._frames.popleft()[2])
        if len(self._frames) == hider.lag:
            made_by, serial, rows, count = self._frames[0]
            if (flags := hider.flags_of(made_by, serial)) is not None:
                last = rows[:count]
                self._seen[last] = flags & SEEN
                np.take(self._seen, draw.cells, out=rounds)
                self._seen[last] = 0
        rows = self._spare.pop() if self._spare else np.zeros(cells, np.int32)
        rows[: len(draw.cells)] = draw.cells
        self._frames.append((hider, hider.begin(), rows, len(draw.cells)))
        _number_rounds(draw, rounds, hider.size[0] * hider.size[1])
        return rounds


def _number_rounds(draw: "DrawList", rounds: np.ndarray, pixels: int) -> None:
    """Turns ``rounds``, 1 for each cell that is known to be visible and 0 for the others, into 0 for these cells and the round
    of the others, by distance.  The nearest are in round 1, however many points they hold."""
    points = np.bincount(draw.slot, draw.count, len(rounds))
    points[rounds > 0] = 0
    step = np.square(draw.cell_view[:, :3]).sum(axis=1).view(np.uint32) >> _DISTANCE_SHIFT
    held = np.bincount(step, points, 1)
    nearer = held.cumsum() - held
    numbers = 1 + np.searchsorted(np.array(ROUNDS) * pixels, nearer, side="right").astype(np.uint8)
    rounds[:] = np.where(rounds > 0, 0, numbers[step])


class OcclusionPasses:
    """The passes, for one picture size.  ``keys`` (the compute rasteriser's) must hold the whole picture.

    rows: batches that one of its workgroups takes.  lag: how many frames back the flags are that a frame uses.
    """

    def __init__(self, programs: Programs, size: tuple[int, int], rows: int, lag: int):
        context = programs.context
        self.context, self.size = context, size
        side = 1 << BLOCK_SHIFT
        sizes = [(-(-size[0] // side), -(-size[1] // side))]
        while max(sizes[-1]) > 1:
            sizes.append(((sizes[-1][0] + 1) // 2, (sizes[-1][1] + 1) // 2))
        self._sizes = sizes
        begins = np.cumsum([0] + [w * h for w, h in sizes])
        levels = [(*extent, int(begin), 0) for extent, begin in zip(sizes, begins[:-1], strict=True)]
        self._levels = levels + [(0, 0, 0, 0)] * (_LEVELS - len(levels))
        self._pyramid = context.buffer(reserve=4 * int(begins[-1]))
        orphans = lag > 1  # on a GPU
        self._flags = GrowingBuffer(context, orphans=orphans)
        self._commands = GrowingBuffer(context, orphans=orphans)
        self._appended = GrowingBuffer(context)
        shared: dict[str, Any] = {"LEVELS": _LEVELS, "BLOCK_SHIFT": BLOCK_SHIFT}
        cells: dict[str, Any] = {"CELLS_A_GROUP": _CELLS_A_GROUP}
        test: dict[str, Any] = {"TEXELS": TEXELS, "SHARE_BITS": SHARE_BITS, "LAST": LAST, "ROUND_SHIFT": _ROUND_SHIFT, **shared,
                                **cells}
        named = partial(Pass, programs)
        self._blocks = named("occluding blocks", "occlusion_blocks.comp", inputs=("gaps",), buffers=("KEYS", "PYRAMID"),
                             uniforms=("blocks",), BLOCK_SHIFT=BLOCK_SHIFT)  # fmt: skip
        self._reduce = named("occlusion pyramid", "occlusion_reduce.comp", buffers=("PYRAMID",), uniforms=("levels", "level"),
                             **shared)  # fmt: skip
        self._test = named("occlusion test", "occlusion_test.comp", buffers=("CELLS", "PYRAMID", "FLAGS", "COMMANDS"),
                           uniforms=("levels", "cell_count", "tally", "number"), **test)  # fmt: skip
        self._append = named("batches of visible cells", "occlusion_append.comp",
                             buffers=("BATCHES", "APPENDED", "FLAGS", "COMMANDS"),
                             uniforms=("list", "first_batch", "batch_count", "tally"),
                             MAX_GROUPS=MAX_GROUPS, ROWS=rows, **cells)  # fmt: skip
        self.lag = lag
        self._ring = make_ring(context, lag + 2)
        self._words = np.zeros(0, np.uint32)
        self._visible = self._pages = self._lists = self._serial = 0
        self._hidden_counts: dict[int, HiddenCount] = {}  # of the last frames, once this is released

    def begin(self) -> int:
        """A new frame; returns its number.  Until it has ended there are no flags of it."""
        self._serial, self._visible = self._serial + 1, 0
        return self._serial

    def flags_of(self, made_by: "OcclusionPasses", serial: int) -> np.ndarray | None:
        """(V,) uint32 flags of frame ``serial`` as occlusion_test.comp left them, if it is the frame ``lag`` before the next
        one and this object made it.  Waits for the GPU where it is not done with that frame yet.

        Raises DeviceError where the GPU does not answer.
        """
        if made_by is not self or serial != self._serial - self.lag + 1:
            return None
        words = self._ring.read(serial)
        return None if words is None else words[:-2]

    def end(self) -> None:
        """Has the frame's flags and tally copied for the host."""
        if self._visible:
            self._ring.push(self._serial, [(self._flags.buffer, 0, 4 * self._visible),
                                           (self._commands.buffer, 16 * self._lists, 8)])

    def start(self, rounds: np.ndarray, pages: int, batches: int) -> None:
        """Uploads the round of each cell, (V,) uint8, and clears the commands.  batches: of all pages."""
        if len(self._words) < len(rounds):
            self._words = np.zeros(1 << max(len(rounds) - 1, 0).bit_length(), np.uint32)
        self._visible, self._pages = len(rounds), pages
        words = self._words[: len(rounds)]
        np.left_shift(rounds, _ROUND_SHIFT, out=words, casting="unsafe", dtype=np.uint32)
        words[rounds == 0] = SEEN | DRAWN
        self._flags.write(words)
        self._lists = pages * LAST
        commands = np.zeros((self._lists + 1, 4), np.uint32)
        commands[:-1, 2] = 1
        self._commands.write(commands)
        self._appended.reserve(16 * batches)

    def build(self, keys: moderngl.Buffer, history: "History") -> None:
        """Builds the pyramid from the depth drawn so far."""
        self._blocks.run(inputs={"gaps": history.closing(keys)}, buffers={"KEYS": keys, "PYRAMID": self._pyramid},
                         over=self._sizes[0], blocks=self._sizes[0])  # fmt: skip
        self._reduce.set_uniforms(levels=self._levels)
        pyramid = {"PYRAMID": self._pyramid}
        for level in range(1, len(self._sizes)):
            self._reduce.run(buffers=pyramid, over=self._sizes[level], level=level)

    def test(self, cells: moderngl.Buffer, number: int) -> None:
        """Tests the cells of a round: which are drawn now.  The last one also tests those that are
        drawn: which are drawn first in a later frame."""
        self._test.run_groups(
            -(-self._visible // _CELLS_A_GROUP), levels=self._levels, cell_count=self._visible, tally=4 * self._lists,
            number=number,
            buffers={"CELLS": cells, "PYRAMID": self._pyramid, "FLAGS": self._flags.buffer, "COMMANDS": self._commands.buffer})
        self.context.memory_barrier()

    def append(self, batches: moderngl.Buffer, bounds: np.ndarray, number: int) -> None:
        """Lists the batches of a round's visible cells.  bounds: as in batches_of."""
        buffers = {"BATCHES": batches, "APPENDED": self._appended.buffer, "FLAGS": self._flags.buffer,
                   "COMMANDS": self._commands.buffer}  # fmt: skip
        for page in range(self._pages):
            start, stop = batches_of(bounds, page, number)
            if stop > start:
                self._append.run_groups(-(-(stop - start) // _CELLS_A_GROUP), buffers=buffers, list=page * LAST + number - 1,
                                        first_batch=start, batch_count=stop - start, tally=4 * self._lists)  # fmt: skip
        self.context.memory_barrier()

    def draw(self, program: moderngl.ComputeShader, points: moderngl.Buffer, page: int, number: int, first: int) -> None:
        """Runs a pass of the rasteriser (APPENDED) on one page's list of a round, which begins at ``first``."""
        points.bind_to_storage_buffer(BINDINGS["POINTS"])
        self._appended.buffer.bind_to_storage_buffer(BINDINGS["BATCHES"])
        self._commands.buffer.bind_to_storage_buffer(BINDINGS["COMMANDS"])
        program["page"], program["first_batch"] = page * LAST + number - 1, first
        program.run_indirect(self._commands.buffer, 16 * (page * LAST + number - 1))

    @property
    def serial(self) -> int:
        """The number of the frame begun last."""
        return self._serial

    def hidden_count(self, serial: int) -> HiddenCount:
        """What was hidden in one of the last frames; waits for the GPU where it is not done with it."""
        if serial in self._hidden_counts:
            return self._hidden_counts[serial]
        words = self._ring.read(serial)
        if words is None:  # no cell was in view
            return HiddenCount(0, 0)
        return HiddenCount(int(words[-2]), int(words[-1]))

    def release(self) -> None:
        """Frees the buffers.  The tallies of the last frames stay."""
        for serial in range(max(1, self._serial - self.lag), self._serial + 1):
            with contextlib.suppress(DeviceError):  # a lost device has no tallies
                self._hidden_counts[serial] = self.hidden_count(serial)
        for resource in (self._ring, self._pyramid, self._flags.buffer, self._commands.buffer, self._appended.buffer):
            resource.release()


def batches_of(bounds: np.ndarray, page: int, number: int) -> tuple[int, int]:
    """First batch of a page and round, and the one after the last.  bounds: (pages * (LAST + 1) + 1,)."""
    place = page * (LAST + 1) + number
    return int(bounds[place]), int(bounds[place + 1])


def worthwhile(draw: "DrawList", size: tuple[int, int]) -> bool:
    """Whether a draw list is long enough, for a picture of this size, that culling saves time."""
    return draw.points >= WORTH * size[0] * size[1]


def may_hide(settings: "Settings", views: tuple[str, ...]) -> bool:
    """Whether hidden cells may be left out of these views: all of them must be behind the depth filter of preset auto."""
    return settings.filter == "auto" and "raw" not in views
