"""Which scans the files hold, and which scan each point is of: stated by the files, or inferred from the order of points."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..readers.source import Chunk, ScanInfo, Source

MOST_NUMBERS = 256
"""Scans that the 8 bits of a packed point tell apart; all later ones share the last number."""


@dataclass(frozen=True, eq=False)
class ScanTable:
    """scans: of each source.

    turns: by source that was split into stations, (stations - 1,) ascending running numbers, over all sources, of the points
    with which the second and later stations begin.  counts: points by (source, scan) of these sources.
    """

    scans: tuple[tuple[ScanInfo, ...], ...]
    turns: dict[int, np.ndarray] = field(default_factory=dict)
    counts: dict[tuple[int, int], int] = field(default_factory=dict)

    def numbers(self, source: int, first: int, chunk: Chunk) -> np.ndarray:
        """(n,) uint8 scan numbers of a chunk's points.  first: running number, over all sources, of its first point."""
        if isinstance(chunk.scan, np.ndarray):
            return chunk.scan
        before = sum(len(scans) for scans in self.scans[:source])
        if source not in self.turns:
            return np.full(len(chunk.xyz), min(before + chunk.scan, MOST_NUMBERS - 1), np.uint8)
        station = np.searchsorted(self.turns[source], np.arange(first, first + len(chunk.xyz)), side="right")
        return np.minimum(before + station, MOST_NUMBERS - 1).astype(np.uint8)


def stated_scans(sources: Sequence[Source]) -> ScanTable:
    """The scans as the files state them."""
    return ScanTable(tuple(tuple(source.scans) for source in sources))
