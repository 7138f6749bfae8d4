"""Decompresses LZF (Marc Lehmann's liblzf), the compression of PCD's binary_compressed form, in steps of any size.

A copy reaches at most WINDOW bytes back, so that a reader needs no more of what it has decoded, and a copy of a reader is a
place to go on from.  The package python-lzf decodes a block only as a whole, and the block of a PCD file is the whole scan.
"""

import numpy as np

from ....model.common.jit import compiled

WINDOW = 1 << 13
"""Bytes that a copy can reach back."""
LONGEST = 264
"""Bytes of the longest copy, which takes three bytes: nothing decompresses to more than MOST times its size."""
MOST = LONGEST // 3


class DamagedLzf(ValueError):
    """The compressed bytes end too early, or copy from before their beginning."""


class LzfReader:
    """Reads decompressed bytes from the beginning.  data: (n,) uint8, compressed."""

    def __init__(self, data: np.ndarray):
        self._data, self._place = data, 0
        self._out, self._at = np.empty(0, np.uint8), 0

    def copy(self) -> "LzfReader":
        """A reader that goes on from the same place."""
        made = LzfReader(self._data)
        made._place, made._out, made._at = self._place, self._out, self._at
        return made

    def read(self, count: int) -> np.ndarray:
        """The next bytes, (count,) uint8, not to be changed.  Raises DamagedLzf."""
        if len(self._out) - self._at < count:
            kept = self._out[max(0, self._at - WINDOW) :]
            self._at = min(self._at, WINDOW)
            room = np.empty(self._at + count + LONGEST, np.uint8)
            room[: len(kept)] = kept
            self._place, filled = decompress(self._data, self._place, room, len(kept), self._at + count)
            if self._place < 0 or filled < self._at + count:
                raise DamagedLzf
            self._out = room[:filled]
        self._at += count
        return self._out[self._at - count : self._at]

    def skip(self, count: int) -> None:
        """Passes over the next bytes, with little memory.  Raises DamagedLzf."""
        while count:
            step = min(count, 1 << 20)
            self.read(step)
            count -= step


@compiled(nogil=True)
def decompress(data, i, out, o, stop):
    """Goes on decompressing ``data`` (n,) uint8 at byte ``i`` into ``out`` (m,) uint8 at byte ``o``, until ``stop`` bytes are
    in it or the data ends.  Returns both places, the first -1 where the data is damaged."""
    n, m = data.shape[0], out.shape[0]
    while i < n and o < stop:
        control = np.int64(data[i])
        i += 1
        if control < 32:  # a run of literal bytes
            length = control + 1
            if i + length > n or o + length > m:
                return -1, o
            for k in range(length):
                out[o + k] = data[i + k]
            i += length
        else:  # a copy of bytes already written
            length = control >> 5
            if length == 7:
                if i >= n:
                    return -1, o
                length += np.int64(data[i])
                i += 1
            if i >= n:
                return -1, o
            source = o - ((control & 31) << 8) - np.int64(data[i]) - 1
            i += 1
            length += 2
            if source < 0 or o + length > m:
                return -1, o
            for k in range(length):
                out[o + k] = out[source + k]
        o += length
    return i, o
