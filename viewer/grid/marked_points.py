"""Points of a scene that show another station number than the grid stores: ghosts (viewer.work.ghosts).

The number is put in when packed points are read, for the GPU and for tools alike; neither the cache nor a memory map changes.
"""

from dataclasses import dataclass

import numpy as np

_STATION = np.uint32(24)  # bits below the station number in the third word of a packed point (viewer.grid.scene)
_REST = np.uint32(0x00FFFFFF)


@dataclass(frozen=True, eq=False)
class MarkedPoints:
    """numbers: (M,) int64, ascending, of the points.  station: the number that they show."""

    numbers: np.ndarray
    station: int

    def mark_run(self, packed: np.ndarray, start: int) -> None:
        """Marks ``packed``, (n, 3) uint32, in place, which are the points from number ``start`` on."""
        first, last = np.searchsorted(self.numbers, (start, start + len(packed)))
        self._mark(packed, self.numbers[first:last] - start)

    def marked(self, packed: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """A copy of ``packed``, (n, 3) uint32, which are the points ``numbers``, (n,) int, marked."""
        packed = packed.copy()
        self._mark(packed, self.holds(numbers))
        return packed

    def holds(self, numbers: np.ndarray) -> np.ndarray:
        """(n,) bool: which of the points ``numbers`` are marked."""
        if len(self.numbers) == 0:
            return np.zeros(len(numbers), bool)
        at = np.minimum(np.searchsorted(self.numbers, numbers), len(self.numbers) - 1)
        return self.numbers[at] == numbers

    def _mark(self, packed: np.ndarray, which: np.ndarray) -> None:
        packed[which, 2] = packed[which, 2] & _REST | np.uint32(self.station) << _STATION
