"""The scene of known cameras: of octrees at addresses only the nodes are fetched that their pictures show.

A node is left out where the points of its parent lie at most FINEST_PX apart in all pictures (viewer.stream.nodes_in_view):
each picture has at least two points a pixel where the scan has as many, and all points of the scan where its nodes are read
down to the leaves.  Noise, spacing, exposures, missing colour and the size of cells are those of the points that are read, so
that filled pictures are not equal to the byte, and holes may be filled otherwise.  The same cameras make the same scene, in
each process.

Of three filled pictures of street_corner.laz at 240x180, one differs from that of all points by the noise (32 dB, and 56 with
the noise map of all points; the spacing changes 3), and one by the directions that count as closed, 1,039 in place of 1,080 of
1,536: a part is background there and filled otherwise (24 dB; under 1 more if the coarsest levels are read everywhere).

Frame: file coordinates.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import InputError
from ..common.failures import tell
from ..common.text import bytes_text, count_text, counted
from ..picture.camera import Camera
from ..readers.remote.octree_set import OctreeSet, octrees_in
from ..readers.remote.remote_object import ChangedFileError
from .nodes_in_view import nodes_in_view
from .scene_of_nodes import FetchedNodes, finest_spacing, scene_of_octrees

if TYPE_CHECKING:
    from ..common.workers.worker_choice import Workers
    from ..grid.scene import Scene
    from ..readers.moved_source import Moves
    from ..readers.source import Chunk

_WORTH = 0.9
"""Share of the bytes from which on all are fetched: the grid of the whole is kept, that of some nodes is not."""


def open_scene_for(paths: Sequence[Path], cameras: Sequence[Camera], *, cache: bool = True, match: bool = True,
                   columns: str | None = None, moves: "Moves | None" = None, workers: "Workers | None" = None,
                   say: bool = True) -> "Scene":
    """The scene of scans for pictures of ``cameras``, at the sizes at which they are rendered; no cameras: for any pictures.

    Of COPC, EPT and Potree at addresses that are too large to be fetched whole (POINTGLASS_REMOTE_WHOLE_MB) only what the
    cameras see is read.  Others: as for viewer.grid.open_scene.open_scene, also what is raised.  say: a line says how much is
    read."""
    from ..grid.open_scene import open_scene

    for last in (False, True):
        octrees, others = octrees_in(paths) if cameras and not moves else (None, [])
        numbers = _seen(octrees, cameras) if octrees is not None else np.zeros(0, np.int64)
        if octrees is None or (others and not cache) or octrees.nodes.bytes[numbers].sum() > _WORTH * octrees.size:
            break
        try:
            return _scene_of(octrees, numbers, others, cameras, match=match, columns=columns, say=say)
        except ChangedFileError:
            if last:
                raise InputError(f"{octrees.octrees[0].address.text}: changes while it is read",
                                 remedy="try again later") from None
    return open_scene(paths, cache=cache, match=match, columns=columns, moves=moves, workers=workers)


def _seen(octrees: OctreeSet, cameras: Sequence[Camera]) -> np.ndarray:
    """Numbers of the nodes that any of the cameras sees, ascending."""
    seen = np.zeros(len(octrees.nodes.levels), bool)
    for camera in cameras:
        for numbers in nodes_in_view(octrees.nodes, camera, points=int(octrees.nodes.points.sum())):
            seen[numbers] = True
    return np.flatnonzero(seen)


def _scene_of(octrees: OctreeSet, numbers: np.ndarray, others: Sequence[Path], cameras: Sequence[Camera], *, match: bool,
              columns: str | None, say: bool) -> "Scene":
    from ..grid.open_scene import grids_of

    nodes, by_tree = octrees.nodes, octrees.by_tree(numbers)
    for tree, own in by_tree:
        address = octrees.octrees[tree].address
        octrees.octrees[tree].fetch(own, f"fetching {address.name} from {address.host}")
    if say:
        held = int(nodes.bytes[numbers].sum())
        tell(f"{', '.join(one.address.name for one in octrees.octrees)}: {bytes_text(held)} of {bytes_text(octrees.size)} "
             f"({held / octrees.size:.2g} of it) are read, which {counted(len(cameras), 'picture')} can show: "
             f"{count_text(int(nodes.points[numbers].sum()))} of {count_text(int(nodes.points.sum()))} points")

    def parts_of(leaf: int) -> "list[Chunk]":
        level, cell = nodes.levels[leaf], nodes.cells[leaf]
        up = np.maximum(level - nodes.levels[numbers], 0)
        chain = (nodes.levels[numbers] <= level) & (nodes.cells[numbers] == cell >> up[:, None]).all(axis=1)
        if nodes.tree is not None:
            chain &= nodes.tree[numbers] == nodes.tree[leaf]
        return [*octrees.chunks(numbers[chain]).values()]

    spacing = finest_spacing(nodes, numbers, parts_of)
    sources = [FetchedNodes(octrees.octrees[tree], own) for tree, own in by_tree]
    return scene_of_octrees(sources, spacing=spacing, match=match,
                            beside=grids_of(others, match=match, columns=columns) if others else None)
