"""Octrees at addresses (COPC, EPT, Potree) of which only those nodes are read that somebody looks at.

What was read lies in the copy in the cache folder, which keeps to the limit of all copies.  The copy is locked for one request
after the other, so that other processes can use it between them.  Frame: the file's.
"""

import os
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property, reduce
from itertools import chain
from operator import add
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import usable_processors
from ...common.errors import InputError
from ..las.copc_nodes import CopcNodes, read_nodes
from ..source import Chunk, Source
from .address import Address
from .copy_folders import alone, bytes_on_disk, folder_of, limit_bytes, make_room, use
from .fetch import describe
from .local_copy import LocalCopy
from .octree_fetch import octree_at, octree_parts
from .remote_object import ChangedFileError, RemoteObject

if TYPE_CHECKING:
    from .folder_copy import FolderCopy
    from .octree_parts import OctreeParts

_SPAN = 128
"""Points along a node's side where the file does not state their spacing, as most writers have it."""


_WHOLE_MB = 64.0


def most_whole() -> int:
    """Bytes up to which an octree is fetched whole, ten seconds at 50 Mbit/s: POINTGLASS_REMOTE_WHOLE_MB, or 64 MB."""
    text = os.environ.get("POINTGLASS_REMOTE_WHOLE_MB", "")
    try:
        return int(1e6 * (float(text) if text else _WHOLE_MB))
    except (ValueError, OverflowError):
        raise InputError(f"POINTGLASS_REMOTE_WHOLE_MB is {text!r}: expected a number of megabytes") from None


@dataclass(frozen=True, eq=False)
class OctreeNodes:
    """The nodes that hold points.  levels, points, bytes: (n,) int64; bytes of EPT and Potree 1 are estimates.  cells: (n, 3)
    int64, places among the cubes of a level.  low: (n, 3) lowest corners of the cubes, sides: (n,) lengths, spacing: (n,) of
    the points; float64, file units.  tree: (n,) int64 number of the octree, of several; None: there is one."""

    levels: np.ndarray
    cells: np.ndarray
    points: np.ndarray
    bytes: np.ndarray
    low: np.ndarray
    sides: np.ndarray
    spacing: np.ndarray
    tree: np.ndarray | None = None

    @cached_property
    def leaves(self) -> np.ndarray:
        """(n,) bool: nodes without children; with all above them, all points in their cubes are there."""
        tree = np.zeros_like(self.levels) if self.tree is None else self.tree
        rows = np.column_stack([tree, self.levels, self.cells])
        parents = np.column_stack([tree, rows[:, 1] - 1, rows[:, 2:] >> 1])
        found = np.unique(np.concatenate([rows, parents]), axis=0, return_inverse=True)[1].reshape(-1)
        return ~np.isin(found[: len(rows)], found[len(rows) :])


class OctreeView:
    """nodes: what there is.  source: what the file says of itself.  size: bytes of all.  Subclasses implement ``fetch`` and
    ``_read``."""

    def __init__(self, address: Address, nodes: OctreeNodes, source: Source, size: int):
        self.address, self.nodes, self.source, self.size = address, nodes, source, size

    def fetch(self, numbers: np.ndarray, label: str | None = None) -> None:
        """Reads nodes, (k,) numbers, from the address, as far as they are not in the copy.  label: of the progress; None: none.

        Raises ChangedFileError; InputError (UnreachableError: it may pass) where they cannot be had or the disk is full."""
        raise NotImplementedError

    def chunk(self, numbers: np.ndarray) -> Chunk:
        """The points of nodes that were fetched.  Raises InputError where they are damaged."""
        return _joined([*self._read(numbers)])

    def _read(self, numbers: np.ndarray) -> Iterable[Chunk]:
        raise NotImplementedError

    def _must_empty(self, more: int) -> bool:
        """Makes room in the cache for ``more`` bytes.  Whether this copy has to give up what it holds for that."""
        held = bytes_on_disk(folder_of(self.address))
        make_room(self.address, held + more)
        return held > 0 and held + more > limit_bytes()


def octree_view(address: Address, most_whole: int) -> OctreeView | None:
    """The octree at an address; None for other files, and for those that are there or of which at most ``most_whole`` bytes are
    missing: they are fetched whole.  Reads its hierarchy.  Raises InputError where it cannot be had."""
    if (octree := octree_at(address)) is not None:
        copy, parts = octree_parts(octree)
        if copy.complete or parts.size <= most_whole or parts.cube is None or parts.cells is None:
            return None
        return _FolderView(octree, copy, parts)

    def read(copy: LocalCopy) -> OctreeView | None:
        if copy.complete or not (count := describe(copy)) or (nodes := read_nodes(copy.path, count)) is None:
            return None
        few = (1 - copy.share) * copy.remote.size <= most_whole
        return None if few or not nodes.side > 0 else _CopcView(address, copy.remote, copy.path, nodes)

    return use(address, lambda home, remote: LocalCopy(home, address.name, remote), read)


class _CopcView(OctreeView):
    def __init__(self, address: Address, remote: RemoteObject, path: Path, nodes: CopcNodes):
        from ..las.las_source import LasSource

        self._remote, self._copc, self._las = remote, nodes, LasSource(path)
        cubes = _nodes(nodes.level, nodes.points, nodes.bytes, nodes.cell, nodes.low, nodes.side, nodes.spacing)
        super().__init__(address, cubes, self._las, remote.size)

    def fetch(self, numbers: np.ndarray, label: str | None = None) -> None:
        numbers = numbers[np.argsort(self._copc.place[numbers])]
        first, held = self._copc.place[numbers], self._copc.bytes[numbers]
        with alone(self.address):
            copy = LocalCopy(folder_of(self.address), self.address.name, self._remote)
            if self._must_empty(int(held.sum())):
                copy.empty()
                describe(copy)
            copy.fetch(zip(first.tolist(), (first + held).tolist(), strict=True), label)
            os.utime(copy.path, (self._remote.modified, self._remote.modified))  # what is made of it is found again by it

    def _read(self, numbers: np.ndarray) -> Iterable[Chunk]:
        with ThreadPoolExecutor(usable_processors(), "pointglass nodes") as pool:
            return [*pool.map(lambda node: self._las.node_chunk(self._copc, node), numbers.tolist())]


class _FolderView(OctreeView):
    def __init__(self, address: Address, copy: "FolderCopy", parts: "OctreeParts"):
        from ..formats import open_source
        from .octree_parts import upper_octree

        assert parts.cube is not None and parts.cells is not None
        self._copy, self._parts = copy, parts
        self._root = np.flatnonzero(parts.levels == parts.levels.min())
        with alone(address):
            parts.fetch(copy, self._root)
        sizes = np.diff(parts.runs, axis=1)[:, 0] if parts.runs is not None else (
            parts.points * (parts.size / max(parts.points.sum(), 1))).astype(np.int64)  # fmt: skip
        cubes = _nodes(parts.levels, parts.points, sizes, parts.cells, parts.cube[:3], float(parts.cube[3]), parts.spacing)
        super().__init__(address, cubes, open_source(upper_octree(copy, parts, self._root)), parts.size)

    def fetch(self, numbers: np.ndarray, label: str | None = None) -> None:
        with alone(self.address):
            if not self._copy.is_current():
                raise ChangedFileError
            if self._must_empty(int(self.nodes.bytes[numbers].sum())):
                self._parts.empty(self._copy)
                self._parts.fetch(self._copy, self._root)
            self._parts.fetch(self._copy, np.sort(numbers), label)

    def _read(self, numbers: np.ndarray) -> Iterable[Chunk]:
        from ..octree.potree2 import Potree2Source

        if isinstance(self.source, Potree2Source):
            return chain.from_iterable(map(self.source.node_chunks, numbers.tolist()))
        return self._of_files(numbers)

    def _of_files(self, numbers: np.ndarray) -> Iterator[Chunk]:
        from ..column_source import ColumnSource
        from ..formats import open_source
        from .octree_parts import linked_octree

        with linked_octree(self._copy, self._parts, numbers) as entry:
            source = open_source(entry)
            if isinstance(source, ColumnSource) and isinstance(self.source, ColumnSource):
                source.take_ranges(self.source)
            yield from source.chunks()


def _nodes(levels: np.ndarray, points: np.ndarray, held: np.ndarray, cells: np.ndarray, low: np.ndarray, side: float,
           spacing: float) -> OctreeNodes:
    sides = side / 2.0**levels
    finest = (spacing if spacing > 0 else side / _SPAN) / 2.0**levels
    return OctreeNodes(levels, cells, points, held, low + cells * sides[:, None], sides, finest)


def _joined(chunks: list[Chunk]) -> Chunk:
    """Points of one source behind each other; what only some have is left out."""
    def column(name: str) -> np.ndarray | None:
        parts = [getattr(chunk, name) for chunk in chunks]
        return None if any(part is None for part in parts) else np.concatenate(parts)

    xyz = np.concatenate([np.zeros((0, 3)), *(chunk.xyz for chunk in chunks)])
    invalid = reduce(add, (chunk.invalid for chunk in chunks), 0)
    return Chunk(xyz, column("rgb") if chunks else None, column("intensity") if chunks else None, 0, invalid,
                 column("station") if chunks else None, column("classification") if chunks else None)
