"""A scene in memory of some nodes of an octree: what of a scan at an address was read so far.  Frame: file coordinates."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...model.appearance.spacing import median_spacing
from ..grid.build_scene import in_memory, stated_facts
from ..readers.source import CHUNK, Chunk, Source

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..readers.remote.octree_view import OctreeNodes

_CUBES, _QUERIES, _ENOUGH = 6, 256, 64
"""Leaves in which spacing is measured, chosen in proportion to their points; points of each, and those that it has at least."""


class NodeSource(Source):
    """Points of some nodes of a scan, with the facts of the whole.  of: the whole.  parts: the points, one part or more."""

    worth_keeping = False

    def __init__(self, of: Source, parts: Sequence[Chunk]):
        self._parts = [part for part in parts if len(part.xyz)]
        super().__init__(of.path, of.format, sum(len(part.xyz) for part in parts), of.units, of.metres_per_unit, of.crs,
                         of.precision, list(of.scans), crs_text=of.crs_text)

    def chunks(self) -> Iterator[Chunk]:
        """Yields the points of the parts."""
        for part in self._parts:
            for first in range(0, len(part.xyz), CHUNK):
                rows = slice(first, first + CHUNK)
                rgb, intensity, station, classes = (
                    None if values is None else values[rows]
                    for values in (part.rgb, part.intensity, part.station, part.classification))
                yield Chunk(part.xyz[rows], rgb, intensity, part.scan, 0, station, classes)


def scene_of_nodes(of: Source, parts: Sequence[Chunk], *, spacing: float = 0.0, match: bool = True) -> "Scene":
    """The scene of points of some nodes.  of: the whole scan.  spacing: of all its points, file units; 0: that of these.
    match: as for viewer.grid.open_scene.open_scene.

    Exposures, missing colour and noise are estimated of these points alone.  Raises InputError where none is valid."""
    from ..grid.building.two_passes import build_grid
    from ..preprocess.point_colour import Colours

    sources: list[Source] = [NodeSource(of, parts)]
    known = replace(stated_facts(sources), match=match)
    scene = build_grid(sources, colours=Colours(sources, match=match), allocate=in_memory, known=known)
    return replace(scene, spacing=spacing) if spacing > 0 else scene


def finest_spacing(nodes: "OctreeNodes", numbers: np.ndarray, parts: Sequence[Chunk]) -> float:
    """Median spacing where all points of the scan are there, file units; 0.0 where that is nowhere.  A scene of which far parts
    are coarse would take their spacing for the scan's, and fill other holes.

    numbers: (k,) of the nodes that ``parts`` are the points of."""
    leaves = numbers[nodes.leaves[numbers]]
    if not len(leaves):
        return 0.0
    share = np.cumsum(nodes.points[leaves])
    found = []
    for leaf in leaves[np.searchsorted(share, (np.arange(_CUBES) + 0.5) / _CUBES * share[-1])].tolist():
        low, high = nodes.low[leaf], nodes.low[leaf] + nodes.sides[leaf]
        inside = [part.xyz[((part.xyz >= low) & (part.xyz <= high)).all(axis=1)] for part in parts]
        points = np.concatenate([np.zeros((0, 3)), *inside])
        if len(points) > _ENOUGH:
            found.append(median_spacing(points, samples=_QUERIES))
    return float(np.median(found)) if found else 0.0
