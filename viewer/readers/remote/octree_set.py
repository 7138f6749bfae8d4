"""Several octrees at addresses under one numbering of their nodes, which are read in one order.  Frame: the files'."""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ..source import Chunk
from .address import address_in
from .octree_view import OctreeNodes, OctreeView, most_whole, octree_view


class OctreeSet:
    """nodes: those of the first octree, then those of the others.  size: bytes of all."""

    def __init__(self, octrees: Sequence[OctreeView]):
        self.octrees = tuple(octrees)
        self._ends = np.cumsum([len(one.nodes.levels) for one in octrees])
        tree = np.repeat(np.arange(len(octrees)), np.diff(self._ends, prepend=0))
        columns = {column.name: np.concatenate([getattr(one.nodes, column.name) for one in octrees])
                   for column in fields(OctreeNodes) if column.name != "tree"}
        self.nodes = OctreeNodes(**columns, tree=tree)
        self.size = sum(one.size for one in octrees)

    @property
    def host(self) -> str:
        """Where they lie, for people."""
        hosts = list(dict.fromkeys(one.address.host for one in self.octrees))
        return hosts[0] if len(hosts) == 1 else f"{len(hosts)} servers"

    def tree_of(self, number: int) -> int:
        """The number of the octree of a node."""
        return int(np.searchsorted(self._ends, number, "right"))

    def fetch(self, numbers: np.ndarray) -> None:
        """As OctreeView.fetch, of nodes of any of the octrees."""
        for tree, own in self.by_tree(numbers):
            self.octrees[tree].fetch(own)

    def chunks(self, numbers: np.ndarray) -> dict[int, Chunk]:
        """The points of nodes that were fetched, by the number of their octree.  Raises InputError where they are damaged."""
        return {tree: self.octrees[tree].chunk(own) for tree, own in self.by_tree(numbers)}

    def by_tree(self, numbers: np.ndarray) -> list[tuple[int, np.ndarray]]:
        """For each octree with such nodes: its number, and the numbers of the nodes in it, in their order."""
        trees = np.searchsorted(self._ends, numbers, "right")
        first = np.concatenate([[0], self._ends[:-1]])
        return [(tree, numbers[trees == tree] - first[tree]) for tree in np.unique(trees).tolist()]


def octrees_in(paths: Sequence[Path]) -> tuple[OctreeSet | None, list[Path]]:
    """The octrees of which only some nodes are read, None where there are none, and the scans that are read whole: files of
    this machine, small ones, those without an octree, and those that cannot be read, which opening them reports."""
    views, whole = [], []
    for path in dict.fromkeys(paths):
        found = _octree_at(path)
        (whole.append(path) if found is None else views.append(found))
    return OctreeSet(views) if views else None, whole


def _octree_at(path: Path) -> OctreeView | None:
    if (address := address_in(path)) is None:
        return None
    try:
        return octree_view(address, most_whole())
    except InputError:
        return None
