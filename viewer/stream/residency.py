"""Residency and eviction: which chunks of a scene are in the slots of a pool, which a picture needs, which are evicted.

Bookkeeping by array operations only: no OpenGL and no reading.  Chunk c is the points [c * chunk_points, (c + 1) *
chunk_points) of the scene.  Points are ordered by layer, so a lower number is never finer, and where slots are short, low
numbers come first.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import InputError
from ..grid.scene import CHUNK

if TYPE_CHECKING:
    from ..grid.scene import Scene

OVERVIEW = 1 << 22
"""Points of the coarse layers that stay in the pool, as far as they fit: two per pixel of a 1920x1080 picture, 50 MB."""
PINNED_SHARE = 8
"""One slot in so many is pinned at most: a picture that needs several rounds needs at most 8/7 of them, 14 % more.  It limits
only pools of less than 8 OVERVIEW points, 400 MB.  With 4 it would be a third more rounds, with 16 half of the overview."""
_UNITS = {"": 1, "k": 1 << 10, "m": 1 << 20, "g": 1 << 30, "t": 1 << 40}


@dataclass(frozen=True)
class Round:
    """A part of a picture whose chunks fit into the pool together.

    start, stop: the points of the scene that it covers.  chunks: (n,) int64, ascending, the needed chunks among these.
    """

    start: int
    stop: int
    chunks: np.ndarray


class Residency:
    """The state of a pool of ``slots`` for a scene of ``points`` points.

    A pool that has a slot for every chunk holds chunk c in slot c and evicts none.
    slot_of_chunk: (C,) int32, -1 where absent.  chunk_of_slot: (S,) int32, -1 where empty.  last_used: (C,) int64, the
    number of the last plan that needed a chunk.  The first ``pinned`` chunks are never evicted once they are loaded.
    """

    def __init__(self, points: int, slots: int, *, chunk_points: int = CHUNK, pinned: int = 0):
        self.points, self.chunk_points = points, chunk_points
        self._shift = chunk_points.bit_length() - 1
        if chunk_points != 1 << self._shift:
            raise ValueError(f"{chunk_points} points a chunk: expected a power of two")
        self.chunks = -(-points // chunk_points)
        self.slots = min(slots, self.chunks)
        self.pinned = min(pinned, self.slots)
        self.room = self.slots - self.pinned
        if self.room < 1 and self.slots < self.chunks:
            raise ValueError(f"{slots} slots, {pinned} of them pinned: nothing could be loaded")
        self.slot_of_chunk = np.full(self.chunks, -1, np.int32)
        self.chunk_of_slot = np.full(self.slots, -1, np.int32)
        self.last_used = np.zeros(self.chunks, np.int64)
        self.stamp = 0
        self.absent = self.chunks
        """Number of chunks that are in no slot."""
        self.tally = np.zeros(self.chunks, np.int64)
        """Points of each chunk that the last draw list needs."""

    @property
    def holds_all(self) -> bool:
        """Whether every chunk has a slot of its own."""
        return self.slots == self.chunks

    @property
    def complete(self) -> bool:
        """Whether every chunk is loaded, chunk c in slot c."""
        return self.absent == 0

    def absent_of_kept(self) -> np.ndarray:
        """Ascending numbers of the absent chunks that are loaded at rest, whatever a picture needs: all, where there is a slot
        for each, else those that are pinned."""
        return np.flatnonzero(self.slot_of_chunk[: self.chunks if self.holds_all else self.pinned] < 0)

    def need(self, first: np.ndarray, count: np.ndarray) -> np.ndarray:
        """Ascending numbers of the chunks that hold runs of points.  first, count: (R,) int64, in any order."""
        from .chunk_kernels import tally_chunks

        self.tally[:] = 0
        tally_chunks(first, count, self._shift, self.tally)
        return np.flatnonzero(self.tally)

    def fitting(self, needed: np.ndarray) -> np.ndarray:
        """The coarsest of the ascending chunks ``needed``, as many as the pool can hold at once."""
        return needed[: int(np.searchsorted(needed, self.pinned)) + self.room]

    def plan(self, needed: np.ndarray, limit: int | None = None) -> tuple[np.ndarray, np.ndarray]:
        """(chunks to load, slots to load them into), for a picture of the ascending chunks ``needed``.

        Coarse chunks come first, at most ``limit`` of them.  Slots are empty ones, then those whose chunk is the least recently
        needed (the finer of two), never those of chunks needed now.  The state changes only by :meth:`place`.
        """
        self.stamp += 1
        self.last_used[needed] = self.stamp
        missing = needed[self.slot_of_chunk[needed] < 0]
        missing = missing[:limit]
        if self.holds_all or not len(missing):
            return missing, missing
        slots = np.flatnonzero(self.chunk_of_slot < 0)[: len(missing)]
        if len(slots) < len(missing):
            held = self.chunk_of_slot.astype(np.int64)
            loose = np.flatnonzero((held >= self.pinned) & (self.last_used[held] < self.stamp))
            age = self.last_used[held[loose]] * self.chunks + (self.chunks - 1 - held[loose])
            slots = np.concatenate([slots, loose[np.argsort(age)[: len(missing) - len(slots)]]])
        return missing[: len(slots)], slots

    def place(self, chunk: int, slot: int) -> None:
        """Records that ``chunk`` has replaced the former chunk in ``slot``."""
        before = self.chunk_of_slot[slot]
        if before >= 0:
            self.slot_of_chunk[before] = -1
        self.absent += int(before >= 0) - int(self.slot_of_chunk[chunk] < 0)
        self.chunk_of_slot[slot] = chunk
        self.slot_of_chunk[chunk] = slot

    def reach(self, needed: np.ndarray) -> int:
        """How many slots, from the first on, must be allocated for the ascending chunks ``needed``, or for those that fit."""
        if self.holds_all:
            return int(needed[-1]) + 1 if len(needed) else 0
        absent = int(np.count_nonzero(self.slot_of_chunk[needed] < 0))
        return min(self.slots, int(np.count_nonzero(self.chunk_of_slot >= 0)) + absent)

    def rounds(self, needed: np.ndarray) -> list[Round]:
        """Parts of the scene, in order and without a gap, of which the chunks of ``needed`` (ascending) fit into the pool.

        Each needed chunk is in exactly one part.  A pass over the depths from first to last and one over the colours from last
        to first share the round at the turn, and nothing is loaded between them.
        """
        ahead = int(np.searchsorted(needed, self.pinned))
        parts = max(1, -(-(len(needed) - ahead) // self.room)) if not self.holds_all else 1
        cuts = [0, *(ahead + self.room * part for part in range(1, parts)), len(needed)]
        edges = [0, *(int(needed[cut]) * self.chunk_points for cut in cuts[1:-1]), self.points]
        return [Round(edges[i], edges[i + 1], needed[cuts[i] : cuts[i + 1]]) for i in range(parts)]


def overview_chunks(scene: "Scene", slots: int, chunk_points: int = CHUNK) -> int:
    """How many of the first chunks are pinned: those of the coarse layers that hold OVERVIEW points together, or those that
    fit."""
    return min(-(-scene.coarse_points(OVERVIEW) // chunk_points), slots // PINNED_SHARE)


def opening_chunks(scene: "Scene", chunk_points: int = CHUNK, points: int = OVERVIEW) -> int:
    """How many of the first chunks a first picture waits for, where all chunks will be loaded: those of the coarsest layer, and
    of the next ones while they hold at most ``points`` points together."""
    return -(-scene.coarse_points_within(points) // chunk_points)


def byte_count(text: str, option: str) -> int:
    """Bytes from ``512M``, ``4G``, ``1.5 GiB``: units of 1024.  Raises InputError naming the option."""
    plain = text.strip().lower().removesuffix("ib").removesuffix("b").strip()
    number, unit = (plain[:-1], plain[-1:]) if plain[-1:].isalpha() else (plain, "")
    try:
        value = float(number) * _UNITS[unit]
        if not 1 <= value < 1 << 60:
            raise ValueError
        return int(value)
    except (ValueError, KeyError):
        raise InputError("expected a size such as 512M or 4G", option=option, value=text) from None
