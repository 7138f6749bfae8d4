"""Reads the chunks of a scene of several grids: the pieces of a chunk come from the files of these grids, each checked once.

A chunk of such a scene holds points of many grids where layers are coarse.  Checksums are those of the grids' own chunks, and
of the layers in the first one: such a part is read whole and checked when a point of it is first needed; then only what is
needed is read.  Files are opened for each piece, which takes some 10 us: a place has more files than a process may keep open.
"""

import threading
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..common.errors import InputError
from ..grid.npy_column import start_of
from ..grid.place.joined_points import JoinedPoints
from ..grid.scene import CHUNK
from .chunk_source import POINT_BYTES, ChunkError, ChunkFile, ChunkSource

if TYPE_CHECKING:
    from ..grid.scene import Scene


class JoinedChunks:
    """As ChunkSource, for a scene whose points are a JoinedPoints.  May be used from several threads."""

    def __init__(self, scene: "Scene", chunk_points: int = CHUNK):
        self.points: Any = scene.points
        self.chunk_points = chunk_points
        self._marked = scene.marked
        self.count = len(scene.points)
        self.chunks = -(-self.count // chunk_points)
        self.chunk_bytes = chunk_points * POINT_BYTES
        self._checked = [np.zeros(len(parts.sums), bool) for parts in self.points.checked]
        self._starts: dict[int, int] = {}
        self._scratch = threading.local()

    def read(self, chunk: int, into: np.ndarray) -> np.ndarray:
        """See ChunkSource."""
        first = chunk * self.chunk_points
        points, at = into[: min(self.chunk_points, self.count - first)], 0
        for grid, start, count in self.points.table.runs(first, first + len(points)):
            part = points[at : at + count]
            try:
                self._read(grid, start, part)
            except InputError as error:
                raise ChunkError(str(error), chunk) from None
            self.points.changes[grid].apply(part)
            at += count
        if self._marked is not None:
            self._marked.mark_run(points, first)
        return points

    def _read(self, grid: int, start: int, into: np.ndarray) -> None:
        """The points of a grid from number ``start`` on, as they are stored, checked."""
        path = self.points.files[grid]
        if not isinstance(path, Path):  # in memory
            into[:] = path[start : start + len(into)]
            return
        parts, checked = self.points.checked[grid], self._checked[grid]
        edges, part = parts.edges, int(np.searchsorted(parts.edges, start, side="right")) - 1
        with ChunkFile(path, self._start_of(grid)) as file:
            stop, at = start + len(into), start
            while at < stop:
                number, base = part, int(edges[part])
                part, end = part + 1, min(stop, int(edges[part + 1]))
                if checked[number]:
                    while end < stop and checked[part]:
                        part, end = part + 1, min(stop, int(edges[part + 1]))
                    file.read(at, into[at - start : end - start], base // CHUNK)
                else:
                    whole = self._room(int(edges[part]) - base)
                    file.read(base, whole, base // CHUNK, int(parts.sums[number]))
                    checked[number] = True
                    into[at - start : end - start] = whole[at - base : end - base]
                at = end

    def _room(self, points: int) -> np.ndarray:
        """An array for a chunk of a grid, one for each thread."""
        if not hasattr(self._scratch, "points"):
            self._scratch.points = np.empty((CHUNK, 3), np.uint32)
        return self._scratch.points[:points]

    def _start_of(self, grid: int) -> int:
        """The byte of a grid's file at which its points begin."""
        if grid not in self._starts:
            self._starts[grid] = start_of(self.points.files[grid])
        return self._starts[grid]

    def close(self) -> None:
        """Nothing is open between two chunks."""


def chunks_of(scene: "Scene", chunk_points: int = CHUNK) -> ChunkSource | JoinedChunks:
    """What reads the chunks of a scene, of one grid or of several."""
    return JoinedChunks(scene, chunk_points) if isinstance(scene.points, JoinedPoints) else ChunkSource(scene, chunk_points)
