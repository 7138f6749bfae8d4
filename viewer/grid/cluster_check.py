"""Files opened as one scene that are no one place: told which lies where, for in a picture of both neither would be seen.

Frame: the files' own coordinates, taken to be shared; lengths in their units.
"""

import numpy as np

from viewer.preprocess.positions import is_position
from viewer.readers.source import Chunk, Source

_EVERY = 64  # points, of which one is looked at
_STRAY = (2.0, 98.0)  # percentiles of a file's points between which it lies
_FAR = 20.0  # times the larger extent of two files: a campus, or tiles of a town, are neighbours from file to file


class Apart:
    """Takes note of chunks (``add``), then says which files lie far from the others (``said``)."""

    def __init__(self, sources: list[Source]):
        self._names = [source.path.name for source in sources]
        self.forget()

    def forget(self) -> None:
        """Begins pass 1 anew."""
        self._parts: list[list[np.ndarray]] = [[] for _ in self._names]

    def add(self, source: int, first: int, chunk: Chunk) -> None:
        """Keeps some of a chunk's points."""
        some = np.array(chunk.xyz[-first % _EVERY :: _EVERY] if len(chunk.xyz) >= _EVERY else chunk.xyz, np.float64)
        some = some[is_position(some)]
        if len(some):
            self._parts[source].append(np.percentile(some, _STRAY, axis=0))

    def said(self) -> list[str]:
        """The warning, or none."""
        boxes = {number: (np.min([low for low, _ in parts], axis=0), np.max([high for _, high in parts], axis=0))
                 for number, parts in enumerate(self._parts) if parts}
        left, groups = list(boxes), []
        while left:
            group = [left.pop(0)]
            for one in group:  # which grows meanwhile
                near = [other for other in left if _gap(boxes[one], boxes[other]) <= _FAR * _extent(boxes[one], boxes[other])]
                group += near
                left = [other for other in left if other not in near]
            groups.append(group)
        if len(groups) < 2:
            return []
        one, other = (self._names[group[0]] for group in groups[:2])
        gap = _gap(boxes[groups[0][0]], boxes[groups[1][0]])
        far = f"{gap:,.0f}" if gap >= 10 else f"{gap:.2g}"
        return [f"the files are of {len(groups)} places, {one} lies {far} units from {other}; open each place by itself"]


def _gap(a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray]) -> float:
    """Between two boxes (low, high), 0 where they meet."""
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(a[0] - b[1], b[0] - a[1]))))


def _extent(*boxes: tuple[np.ndarray, np.ndarray]) -> float:
    """Of the largest of boxes along an axis."""
    return max(float((high - low).max()) for low, high in boxes)
