"""Several octrees at addresses under one numbering of their nodes, which are read in one order.  Frame: the files'."""

from collections.abc import Sequence
from dataclasses import fields

import numpy as np

from ..source import Chunk
from .octree_view import OctreeNodes, OctreeView


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

    def fetch(self, numbers: np.ndarray) -> None:
        """As OctreeView.fetch, of nodes of any of the octrees."""
        for tree, own in self._by_tree(numbers):
            self.octrees[tree].fetch(own)

    def chunks(self, numbers: np.ndarray) -> dict[int, Chunk]:
        """The points of nodes that were fetched, by the number of their octree.  Raises InputError where they are damaged."""
        return {tree: self.octrees[tree].chunk(own) for tree, own in self._by_tree(numbers)}

    def _by_tree(self, numbers: np.ndarray) -> list[tuple[int, np.ndarray]]:
        """For each octree with such nodes: its number, and the numbers of the nodes in it, in their order."""
        trees = np.searchsorted(self._ends, numbers, "right")
        first = np.concatenate([[0], self._ends[:-1]])
        return [(tree, numbers[trees == tree] - first[tree]) for tree in np.unique(trees).tolist()]
