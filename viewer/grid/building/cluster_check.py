"""Warns where files opened as one scene lie in different places: a picture of all of them would show none.

Frame: the files' own coordinates, taken to be shared; lengths in their units.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from ...preprocess.scan_description import ScanWarning, WarningTopic
from ...preprocess.valid_positions import is_position
from ...readers.source import Chunk, Source

_EVERY = 64  # one of so many points is examined: 16,000 of a chunk, whose percentiles are within 0.1 (standard error)
_BULK = (2.0, 98.0)  # percentiles of a chunk's points between which it lies, so that outlier points do not count
_FAR = 20.0
"""Times the larger extent of two files, as viewer.grid.scene.STATION_REACH: buildings of a campus and tiles of a town are
neighbours, local and UTM coordinates are not."""


class ClusterCheck:
    """Observes the chunks of pass 1 (``add``), then finds files that lie far from the others (``warnings``)."""

    def __init__(self, sources: Sequence[Source]):
        self._names = [source.path.name for source in sources]
        self.reset()

    def reset(self) -> None:
        """Forgets all chunks: pass 1 begins again."""
        self._parts: list[list[np.ndarray]] = [[] for _ in self._names]

    def add(self, source: int, first: int, chunk: Chunk) -> None:
        """Keeps the extent of some of a chunk's points."""
        some = np.array(chunk.xyz[-first % _EVERY :: _EVERY] if len(chunk.xyz) >= _EVERY else chunk.xyz, np.float64)
        some = some[is_position(some)]
        if len(some):
            self._parts[source].append(np.percentile(some, _BULK, axis=0))

    def warnings(self) -> list[ScanWarning]:
        """One warning where the files form several clusters, else none."""
        boxes = {number: (np.min([low for low, _ in parts], axis=0), np.max([high for _, high in parts], axis=0))
                 for number, parts in enumerate(self._parts) if parts}
        return place_warnings(boxes, self._names)


def place_warnings(boxes: Mapping[int, tuple[np.ndarray, np.ndarray]], names: Sequence[str]) -> list[ScanWarning]:
    """One warning where files form several clusters, else none.  boxes: (low, high), (3,) each, by the number of the file."""
    numbers = np.array(list(boxes), np.int64)
    lows, highs = (np.array([box[end] for box in boxes.values()], np.float64).reshape(-1, 3) for end in (0, 1))
    extents = (highs - lows).max(axis=1, initial=0.0)
    left, groups = np.arange(len(numbers)), list[list[int]]()
    while len(left):
        group, left = [int(left[0])], left[1:]
        for one in group:  # the group grows during the loop
            if not len(left):
                break
            gaps = _gaps(lows[one], highs[one], lows[left], highs[left])
            near = gaps <= _FAR * np.maximum(extents[one], extents[left])
            group += left[near].tolist()
            left = left[~near]
        groups.append(group)
    if len(groups) < 2:
        return []
    first, second = groups[0][0], groups[1][0]
    one, other = (names[numbers[number]] for number in (first, second))
    gap = float(_gaps(lows[first], highs[first], lows[[second]], highs[[second]])[0])
    far = f"{gap:,.0f}" if gap >= 10 else f"{gap:.2g}"
    text = f"{len(groups)} places, {one} lies {far} units from {other}; open each place by itself"
    return [ScanWarning(text, WarningTopic.PLACES)]


def _gaps(low: np.ndarray, high: np.ndarray, lows: np.ndarray, highs: np.ndarray) -> np.ndarray:
    """(n,) distances from a box, corners (3,), to others, corners (n, 3); 0 where they meet."""
    return np.linalg.norm(np.maximum(0.0, np.maximum(low - highs, lows - high)), axis=1)
