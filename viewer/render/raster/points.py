"""The scene's packed points on the GPU: a pool of slots, a chunk of points each, in pages no larger than a storage block.

A scene that fits its budget has a slot for each chunk, chunk c in slot c; chunks of a larger one are loaded and evicted as
needed.  The first picture waits for the coarse layers only, of a larger scene for what it needs of them.  An exact picture
waits for all points it needs, in rounds that each fit the pool; a moving one is drawn with the resident points, and more
arrive, coarse chunks first, a limited number of bytes a frame.

Point p of chunk c = p // chunk_points is in page slot_of_chunk[c] // slots_per_page, at the index
(slot_of_chunk[c] % slots_per_page) * chunk_points + p % chunk_points.  Neighbouring chunks need not be neighbours there,
so a run of points is cut at multiples of chunk_points first and into batches then.
"""

import contextlib
import logging
from collections.abc import Callable
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import DeviceError, InputError, Option, is_opengl_error
from ...common.text import bytes_text
from ...grid.scene import CHUNK
from ...stream.chunk_reader import READ_AHEAD, ChunkReader
from ...stream.chunk_source import POINT_BYTES, ChunkError
from ...stream.joined_chunks import chunks_of
from ...stream.residency import OVERVIEW, Residency, Round, opening_chunks, overview_chunks
from ..device.context import describe_device
from ..device.gpu_buffers import Uploads
from ..device.gpu_memory import point_budget
from ..device.shader import BATCH

if TYPE_CHECKING:
    import moderngl

    from ...grid.scene import Scene

UPLOAD = 32 << 20
"""Bytes uploaded in a frame of a moving picture at most: 2 of its 17 ms at the nominal 15.75 GB/s of PCIe 3.0 x16."""
UPLOAD_SECONDS = 0.008
"""Seconds after which a frame of a moving picture uploads no more, one chunk at least: half of a frame at 60 frames/s."""
LEAST_SLOTS = 16
"""Slots of a pool at least, so that two of them can be pinned (Residency) and rounds do not get too many."""
SOFTWARE_PAGE = 32 << 20
"""Bytes of a page in software OpenGL, where allocation zeroes the memory: pages are small and allocated when first needed."""
_TAIL = BATCH * POINT_BYTES

log = logging.getLogger(__name__)


class PointPages:
    """Owns the point buffers.

    storage_limit: bytes of a storage block.  software: OpenGL runs on the processor (None: ask).
    budget: bytes all buffers together may take; None: a share of what the device has free (viewer.render.device.gpu_memory).
    read_ahead: bytes of main memory for prefetched chunks.  upload: bytes uploaded in a frame while streaming.  overview:
    points that a first picture waits for at most, where all fit.  wake: called on another thread when a chunk has arrived.
    Raises InputError where the points cannot be read or the budget is too small, DeviceError where there is no memory.

    After each ``prepare``, in points of the draw list: ``missing``, still loading; ``left_out``, more than the pool holds;
    ``lost``, unreadable.  ``problem``: the first thing that went wrong while streaming, in one line, or None.  ``budget``,
    ``budget_source``: bytes, and where they come from.  ``short``: the device refused memory, and the budget was halved.
    """

    def __init__(
        self,
        context: "moderngl.Context",
        scene: "Scene",
        storage_limit: int,
        *,
        budget: int | None = None,
        software: bool | None = None,
        read_ahead: int = READ_AHEAD,
        chunk_points: int = CHUNK,
        upload: int = UPLOAD,
        overview: int = OVERVIEW,
        wake: Callable[[], None] = lambda: None,
    ):
        most = (storage_limit - _TAIL) // POINT_BYTES
        self.chunk_points = min(chunk_points, 1 << max(most.bit_length() - 1, 0))
        chunk_bytes = self.chunk_points * POINT_BYTES
        self.slots_per_page = max(1, most // self.chunk_points)
        software = describe_device(context).software if software is None else software
        if software:
            self.slots_per_page = max(1, min(self.slots_per_page, SOFTWARE_PAGE // chunk_bytes))
        self.budget, self.budget_source = (budget, "as asked for") if budget is not None else point_budget(
            context, software=software)
        total = len(scene.points)
        wanted = self._slots_for(total)
        self._context = context
        self.buffers: list[moderngl.Buffer] = []
        self._uploads = Uploads(context, staged=not software)
        self._upload_limit = max(1, upload // chunk_bytes)
        self.missing = self.left_out = self.lost = 0
        self.problem: str | None = None
        self._reader = ChunkReader(chunks_of(scene, self.chunk_points), memory=read_ahead, wake=wake)
        try:
            slots = wanted if software else self._allocated(total, wanted)
            self.short = slots < wanted
            whole = slots * self.chunk_points >= total
            pinned = 0 if whole else overview_chunks(scene, slots, self.chunk_points)
            self.residency = Residency(total, slots, chunk_points=self.chunk_points, pinned=pinned)
            self._bad = np.zeros(self.residency.chunks, bool)
            nothing = np.empty(0, np.int64)
            self.residency.need(nothing, nothing)  # loads the compiled loop now, not in the first frame
            self._whole = Round(0, total, np.arange(self.residency.chunks))
            self._wanted = nothing  # chunks of the last draw list of a moving picture, ascending
            self._grow(1)
            self._opening, ahead = not whole, opening_chunks(scene, self.chunk_points, overview) if whole else 0
            self.load(Round(0, total, self._whole.chunks[:ahead]))
        except BaseException:
            self.release()
            raise

    def _slots_for(self, total: int) -> int:
        """Slots for a scene of ``total`` points within the budget.  Raises InputError where it is too small for any."""
        chunk_bytes, slots = self.chunk_points * POINT_BYTES, -(-total // self.chunk_points)
        if total * POINT_BYTES + slots // self.slots_per_page * _TAIL <= self.budget:
            return slots
        slots = min(self.budget // chunk_bytes, slots - 1)
        if slots < LEAST_SLOTS:
            raise InputError(f"{bytes_text(self.budget)} for points on the GPU: expected "
                             f"{bytes_text(LEAST_SLOTS * chunk_bytes)} at least", remedy=("raise ", Option("--gpu-memory")))
        return slots

    def _allocated(self, total: int, slots: int) -> int:
        """Makes the pages of ``slots``; where the device refuses, the budget is halved.  Returns the slots there are now.

        Half, and not as much as was just possible: the pictures and the network need memory after this.
        Raises DeviceError where there is no memory for the least that is needed.
        """
        while not self._make_pages(total, slots):
            if slots <= LEAST_SLOTS:
                raise DeviceError("the GPU has no memory left for the points",
                                  remedy=("close other programs or lower ", Option("--gpu-memory")))
            half = min(self.budget, total * POINT_BYTES) // 2
            refused, self.budget = self.budget, max(half, LEAST_SLOTS * self.chunk_points * POINT_BYTES)
            self.budget_source = "halved, the GPU refused more"
            slots = self._slots_for(total)
            log.warning("The GPU refused memory for points (budget %s); continuing with %s", bytes_text(refused),
                        bytes_text(self.budget))
        return slots

    def _make_pages(self, total: int, slots: int) -> bool:
        """Makes the pages of ``slots``; False where the device has no memory for them, and none is left then."""
        _ = self._context.error  # an earlier error is not of these pages
        for _page in range(0, slots, self.slots_per_page):
            try:
                self._make_page(total, slots)
                refused = self._context.error != "GL_NO_ERROR"
            except Exception as error:
                if not is_opengl_error(error):
                    raise
                refused = True
            if refused:
                while self.buffers:
                    self.buffers.pop().release()
                return False
        return True

    def _make_page(self, total: int, slots: int) -> None:
        """The next page, for the next of ``slots`` slots of a scene of ``total`` points."""
        first = len(self.buffers) * self.slots_per_page
        points = min(self.slots_per_page, slots - first) * self.chunk_points
        whole = slots * self.chunk_points >= total
        if whole:  # no more than the scene; and one batch more, for a rasteriser that cuts batches from a run's start
            points = min(points + BATCH, total - first * self.chunk_points)
        self.buffers.append(self._context.buffer(reserve=points * POINT_BYTES, dynamic=not whole))

    @property
    def slot_of_chunk(self) -> np.ndarray:
        """(C,) int32: the slot of each chunk, -1 where it is absent.  Changes with prepare and load."""
        return self.residency.slot_of_chunk

    @property
    def nbytes(self) -> int:
        """Bytes of all buffers."""
        return sum(buffer.size for buffer in self.buffers)

    @property
    def arrived(self) -> bool:
        """Whether chunks are waiting for the next ``prepare`` to upload them."""
        return self._reader.arrived

    @property
    def pending(self) -> bool:
        """Whether points of the last draw list are still loading."""
        return self.missing > 0

    @property
    def staging(self) -> int:
        """Bytes of main memory that hold chunks being loaded."""
        return self._reader.memory

    @property
    def approximations(self) -> list[str]:
        """Points that the last prepared picture lacks, in words."""
        reasons = []
        asked = max(1, int(self.residency.tally.sum()))
        if self.missing:
            reasons.append(f"{_share(self.missing / asked)} of the points still loading")
        if self.left_out:
            reasons.append(f"{_share(self.left_out / asked)} of the points beyond the memory for points")
        if self.lost:
            reasons.append(f"{_share(self.lost / asked)} of the points cannot be read")
        return reasons

    def prepare(self, first: np.ndarray, count: np.ndarray, *, streaming: bool = False) -> list[Round]:
        """The rounds in which a draw list is drawn (first, count: (R,) int64, runs of points): ``load`` one, draw its part.

        streaming: one round, of which the chunks that are there are drawn (the others have no slot); the rest is read
        in the background.  Otherwise every point is drawn, in as many rounds as the pool asks for.
        """
        self.missing = self.left_out = self.lost = 0
        residency = self.residency
        if residency.complete:
            return [self._whole]
        needed = residency.need(first, count)
        if not streaming:
            self._grow(residency.reach(needed))  # before the rounds, during which the buffers must not change
            return residency.rounds(needed)
        wanted = residency.fitting(needed[~self._bad[needed]])
        if self._opening:
            self._opening = False
            with contextlib.suppress(ChunkError):  # of which is told when that chunk is received
                self.load(Round(0, residency.points, wanted[wanted < residency.pinned]))
        self._wanted = wanted
        self._receive(wanted)
        there, tally = residency.slot_of_chunk >= 0, residency.tally
        self.lost = int(tally[self._bad & ~there].sum())
        self.missing = int(tally[wanted[~(there | self._bad)[wanted]]].sum())
        self.left_out = int(tally[~there].sum()) - self.lost - self.missing
        return [Round(0, residency.points, needed[:0])]

    def _grow(self, slots: int) -> None:
        """Allocates the pages of the first ``slots`` slots."""
        while len(self.buffers) * self.slots_per_page < slots:
            self._make_page(self.residency.points, self.residency.slots)

    def load(self, part: Round) -> None:
        """Brings the chunks of a round into the pool and waits for them.  Raises InputError where one cannot be read."""
        chunks, slots = self.residency.plan(part.chunks)
        if len(chunks) == 0:
            return
        place = dict(zip(chunks.tolist(), slots.tolist(), strict=True))
        self._reader.request(chunks)
        for chunk, points in self._reader.arrivals(wait=True):
            self._put(chunk, place[chunk], points)
        self._rest()

    def load_all(self) -> None:
        """Waits for every point, where there is a slot for each, so that timed frames load nothing."""
        if self.residency.holds_all:
            self.load(self._whole)

    @property
    def idle(self) -> bool:
        """Whether nothing is being read and :meth:`take_in` would request more."""
        return self._reader.left == 0 and not self._bad[self.residency.absent_of_kept()].all()

    def take_in(self, seconds: float = UPLOAD_SECONDS) -> bool:
        """Between two frames: uploads arrived chunks, as many as a frame may, for about ``seconds`` seconds, and requests
        for what the last draw list lacks, then for all others, where there is a slot for each, or those that are pinned.

        Returns whether more is waiting.
        """
        wanted = self._wanted
        wanted = np.concatenate([wanted, np.setdiff1d(self.residency.absent_of_kept(), wanted, assume_unique=True)])
        self._receive(wanted[~self._bad[wanted]], seconds)
        return self.arrived

    def _receive(self, wanted: np.ndarray, seconds: float = UPLOAD_SECONDS) -> None:
        """Uploads arrived chunks among ``wanted``, as many as a frame may, and requests those still missing."""
        residency = self.residency
        chunks, slots = residency.plan(wanted)
        self._reader.request(chunks)
        free = iter(slots.tolist())
        left, until = self._upload_limit, perf_counter() + seconds
        while left > 0:
            try:
                for chunk, points in self._reader.arrivals(left):
                    self._put(chunk, chunk if residency.holds_all else next(free), points)
                    left -= 1
                    if perf_counter() > until:
                        break
                break
            except ChunkError as error:
                self._bad[error.chunk] = True
                self.problem = self.problem or str(error)
                left -= 1
        self._rest()

    def _rest(self) -> None:
        """Closes the reader once nothing is left to read."""
        if self.residency.complete:
            self._reader.close()

    def _put(self, chunk: int, slot: int, points: np.ndarray) -> None:
        self._grow(slot + 1)
        page, place = divmod(slot, self.slots_per_page)
        self._uploads.write(self.buffers[page], points, place * self.chunk_points * POINT_BYTES)
        if page > 0 and place == 0 and self.residency.holds_all:
            self._uploads.write(self.buffers[page - 1], points[:BATCH], self.size * POINT_BYTES)
        self.residency.place(chunk, slot)

    @property
    def size(self) -> int:
        """Points in a full page, without those repeated at its end."""
        return self.slots_per_page * self.chunk_points

    def release(self) -> None:
        self._reader.close()
        for buffer in self.buffers:
            buffer.release()
        self.buffers.clear()
        self._uploads.release()


def _share(part: float) -> str:
    return f"{part:.0%}" if part >= 0.01 else "under 1 %"
