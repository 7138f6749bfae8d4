"""Checksums of packed points, written with a grid and checked whenever a chunk is read."""

import zlib
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from .scene import CHUNK

if TYPE_CHECKING:
    from .scene import Scene


def checksum(points: np.ndarray) -> int:
    """CRC-32 of packed points (n, 3) uint32 as they lie in memory.  Releases the interpreter's lock."""
    return zlib.crc32(points.data)


def head_edges(offsets: np.ndarray, layers: int) -> np.ndarray:
    """(S + 1,) int64 numbers of the points at which parts of a grid's first chunk begin and end: the ends of its layers there.

    Each part has a checksum of its own: of a place of many grids a view from afar needs a few hundred points of each, and would
    read 768 KiB of each to check them.  offsets: as in Scene.
    """
    stop = min(CHUNK, int(offsets[-1]))
    return np.unique(np.minimum(offsets[:: max((len(offsets) - 1) // layers, 1)], stop))


def head_checksums(points: np.ndarray, offsets: np.ndarray, layers: int) -> list[int]:
    """The checksums of the parts of the first chunk (:func:`head_edges`)."""
    return [checksum(points[first:stop]) for first, stop in pairwise(head_edges(offsets, layers).tolist())]


@dataclass(frozen=True, eq=False)
class CheckedParts:
    """The parts of a grid's points that are checked as a whole.  edges: (S + 1,) int64 numbers of the points at which they
    begin and end.  sums: (S,) of each, CRC-32."""

    edges: np.ndarray
    sums: np.ndarray


def checked_parts(scene: "Scene") -> CheckedParts:
    """The chunks of a grid on disk, of which the first is in parts where their checksums are known."""
    sums = np.asarray(scene.checksums)
    edges = np.minimum(np.arange(len(sums) + 1) * CHUNK, scene.count)
    head, known = head_edges(scene.offsets, scene.layers), scene.head_checksums
    if known is None or len(known) != len(head) - 1 or not len(sums):
        return CheckedParts(edges, sums)
    return CheckedParts(np.concatenate([head, edges[2:]]), np.concatenate([np.array(known, np.int64), sums[1:]]))
