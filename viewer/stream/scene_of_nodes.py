"""A scene of some nodes of octrees: what of scans at addresses was read so far, and the grids of the files beside them.

Frame: file coordinates."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...model.appearance.spacing import median_spacing
from ..grid.build_scene import in_memory, stated_facts
from ..readers.source import CHUNK, Chunk, Source

if TYPE_CHECKING:
    from ..grid.density_layers import Lattice
    from ..grid.place.open_place import PlaceGrids
    from ..grid.scene import Scene
    from ..readers.remote.octree_view import OctreeNodes, OctreeView

_CUBES, _QUERIES, _ENOUGH = 6, 256, 64
"""Leaves in which spacing is measured, chosen in proportion to their points; points of each, and those that it has at least."""


class _SomeNodes(Source):
    """Points of some nodes of a scan, with the facts of the whole.  of: the whole.  points: how many."""

    def __init__(self, of: Source, points: int):
        super().__init__(of.path, of.format, points, of.units, of.metres_per_unit, of.crs, of.precision, list(of.scans),
                         crs_text=of.crs_text)


class NodesInMemory(_SomeNodes):
    """parts: the points, one part or more."""

    worth_keeping = False

    def __init__(self, of: Source, parts: Sequence[Chunk]):
        self._parts = [part for part in parts if len(part.xyz)]
        super().__init__(of, sum(len(part.xyz) for part in parts))

    def chunks(self) -> Iterator[Chunk]:
        """Yields the points of the parts."""
        for part in self._parts:
            for first in range(0, len(part.xyz), CHUNK):
                rows = slice(first, first + CHUNK)
                rgb, intensity, station, classes = (
                    None if values is None else values[rows]
                    for values in (part.rgb, part.intensity, part.station, part.classification))
                yield Chunk(part.xyz[rows], rgb, intensity, part.scan, 0, station, classes)


class FetchedNodes(_SomeNodes):
    """Nodes that were fetched, decoded as they are walked over: any number of them.  numbers: (k,) of nodes of ``octree``."""

    def __init__(self, octree: "OctreeView", numbers: np.ndarray):
        self._octree, self._numbers = octree, numbers
        super().__init__(octree.source, int(octree.nodes.points[numbers].sum()))

    def chunks(self) -> Iterator[Chunk]:
        """Yields the points, of some nodes at a time."""
        ends = np.cumsum(self._octree.nodes.points[self._numbers])
        for some in np.split(self._numbers, np.flatnonzero(np.diff(ends // CHUNK)) + 1):
            if len(some):
                yield self._octree.chunk(some)


def scene_of_octrees(sources: Sequence[Source], *, spacing: float = 0.0, match: bool = True,
                     beside: "PlaceGrids | None" = None) -> "Scene":
    """The scene of points of some nodes of each of several scans.  spacing: of all points of the scans, file units; 0: that of
    these.  match: as for viewer.grid.open_scene.open_scene.  beside: grids of files that are read whole.

    Exposures, missing colour and noise are estimated of these points alone, of each scan by itself.  Cells have the size of
    those of the files, or as the scan with most points asks for.  Raises InputError where no point is valid."""
    if len(sources) == 1 and beside is None:
        return _scene_of(sources[0], spacing, match)
    from ..grid.place.measured_place import joined_in_memory, scene_of_grids

    made, size = _with_common_cells(sources, spacing, match, beside.scenes[0].cell_size if beside is not None else None)
    if beside is not None and size != beside.scenes[0].cell_size:
        from ..grid.place.relaid_grid import with_cells

        again = [with_cells(scene, folder, size) for scene, folder in zip(beside.scenes, beside.folders, strict=True)]
        beside = replace(beside, scenes=[scene for scene, _ in again], folders=[folder for _, folder in again])
    scenes = [made[number] for number in range(len(sources))]
    return joined_in_memory(scenes) if beside is None else scene_of_grids(beside.scenes, beside.folders, match=match,
                                                                           more=scenes)


def _with_common_cells(sources: Sequence[Source], spacing: float, match: bool, size: float | None
                       ) -> "tuple[dict[int, Scene], float]":
    """A scene for each scan, by its number, and the size of the cells of all.  size: the size wanted; None: as the scan with
    most points asks for.  It is larger where a scan is too wide for such cells."""
    from ..grid.density_layers import Lattice, TooWideForCells

    made: dict[int, Scene] = {}
    for number in sorted(range(len(sources)), key=lambda number: -(sources[number].count or 0)):
        try:
            made[number] = _scene_of(sources[number], spacing, match, Lattice(size))
        except TooWideForCells as wide:
            return _with_common_cells(sources, spacing, match, wide.cell_size)
        size = made[number].cell_size
    assert size is not None
    return made, size


def _scene_of(source: Source, spacing: float, match: bool, lattice: "Lattice | None" = None) -> "Scene":
    """The scene of one.  lattice: of a scene of several."""
    from ..grid.building.two_passes import build_grid
    from ..preprocess.point_colour import Colours

    known = replace(stated_facts([source]), match=match)
    scene = build_grid([source], colours=Colours([source], match=match), allocate=in_memory, known=known, lattice=lattice)
    return replace(scene, spacing=spacing) if spacing > 0 else scene


def finest_spacing(nodes: "OctreeNodes", numbers: np.ndarray, parts_of: Callable[[int], Iterable[Chunk]]) -> float:
    """Median spacing where all points of the scan are there, file units; 0.0 where that is nowhere.  A scene of which far parts
    are coarse would take their spacing for the scan's, and fill other holes.

    numbers: (k,) of the nodes that are there.  parts_of: of the number of a leaf, the points of nodes with all those in its
    cube."""
    leaves = numbers[nodes.leaves[numbers]]
    if not len(leaves):
        return 0.0
    share = np.cumsum(nodes.points[leaves])
    found = []
    for leaf in leaves[np.searchsorted(share, (np.arange(_CUBES) + 0.5) / _CUBES * share[-1])].tolist():
        low, high = nodes.low[leaf], nodes.low[leaf] + nodes.sides[leaf]
        inside = [part.xyz[((part.xyz >= low) & (part.xyz <= high)).all(axis=1)] for part in parts_of(leaf)]
        points = np.concatenate([np.zeros((0, 3)), *inside])
        if len(points) > _ENOUGH:
            found.append(median_spacing(points, samples=_QUERIES))
    return float(np.median(found)) if found else 0.0
