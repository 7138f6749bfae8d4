"""A scene in memory of some nodes of an octree: what of a scan at an address was read so far.  Frame: file coordinates."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from ..grid.build_scene import in_memory, stated_facts
from ..readers.source import CHUNK, Chunk, Source

if TYPE_CHECKING:
    from ..grid.scene import Scene


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


def scene_of_nodes(of: Source, parts: Sequence[Chunk], *, match: bool = True) -> "Scene":
    """The scene of points of some nodes.  of: the whole scan.  match: as for viewer.grid.open_scene.open_scene.

    Exposures, missing colour and noise are estimated of these points alone.  Raises InputError where none is valid."""
    from ..grid.building.two_passes import build_grid
    from ..preprocess.point_colour import Colours

    sources: list[Source] = [NodeSource(of, parts)]
    known = replace(stated_facts(sources), match=match)
    return build_grid(sources, colours=Colours(sources, match=match), allocate=in_memory, known=known)
