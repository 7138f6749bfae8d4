"""The records of a scene's files, read again, and which of them are selected.

Numbers of points are running numbers: positions in the order in which the sources' ``chunks`` yield points, over all sources.
Frame: file coordinates.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError, Option
from ...common.progress import progress
from ...grid.place.hidden_grids import is_shared
from ...grid.place.joined_points import JoinedPoints
from ...grid.records.point_records import identity_of
from ...picture.clip import contains, may_contain
from ...preprocess.scan_description import RecordOrigin, ScanSummary
from ...readers.class_codes import class_codes
from ...readers.source import Records, ScanInfo, Source
from ...work.selection import BLOCK

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...work.selection import Selection

_ROUNDED = 1 + 1e-6
"""Factor of a cell's side: coordinates at its border are rounded."""
_LAST = 255
"""Scan number that all later scans share in a grid of 8 bits a scan."""


@dataclass(frozen=True, eq=False)
class ScanNumbers:
    """Which scan of the scene each record is of.

    before: (S,) number of the first scan of each source.  turns: by source that was split into stations, ascending running
    numbers of the points with which its second and later stations begin.  first: (S,) running number of each source's first
    point; only needed for ``turns``.
    """

    before: list[int]
    turns: dict[int, np.ndarray] = field(default_factory=dict)

    def of(self, source: int, first: int, scan: int | np.ndarray, count: int) -> np.ndarray:
        """(count,) int64.  first: running number of the first record.  scan: as in Chunk."""
        if source in self.turns:
            numbers = np.arange(first, first + count)
            return self.before[source] + np.searchsorted(self.turns[source], numbers, side="right")
        return np.broadcast_to(np.asarray(scan, np.int64) + self.before[source], count)


def scan_numbers(scene: "Scene", sources: list[Source]) -> ScanNumbers:
    """Which scans of the scene belong to which source; from ``Scene.meta``."""
    known, scans = scene.meta.records or RecordOrigin(), scene.meta.scans
    if len(known.scans) == len(sources):
        before = np.concatenate([[0], np.cumsum(known.scans)[:-1]]).astype(int).tolist()
        return ScanNumbers(before, {source: np.array(turns, np.int64) for source, turns in known.turns.items()})
    before, turns, at, running = [], {}, 0, 0
    for number, source in enumerate(sources):
        before.append(at)
        stations = 0
        while (
            at + stations < len(scans) and scans[at + stations].inferred and _is_station(scans[at + stations], stations)
        ):
            stations += 1
        counts = [scan.count for scan in scans[at : at + (stations or len(source.scans))]]
        if stations:
            turns[number] = running + np.cumsum(counts)[:-1]
        running += sum(counts)
        at += stations or len(source.scans)
    return ScanNumbers(before, turns)


def _is_station(scan: ScanSummary, index: int) -> bool:
    return scan.name.endswith(f", station {index + 1}")


def sources_of(scene: "Scene", columns: str | None = None) -> list[Source]:
    """The readers of a scene's files, at their places.  columns: as for SourceRecords.  Raises InputError where one cannot be
    read."""
    from ...readers.formats import open_sources
    from ...readers.moved_source import moves_at

    paths = [Path(path) for path in scene.meta.sources]
    origin = scene.meta.records or RecordOrigin()
    live = list(scene.live) if not paths or len(scene.live) == len(paths) else []  # points in memory have no file
    return live or open_sources(paths, columns or origin.columns, moves_at(paths, origin.moves))


class SourceRecords:
    """The selected records of the sources of a scene.  Raises InputError where a source cannot be read."""

    def __init__(self, selection: "Selection", columns: str | None = None, *, matched: bool = False):
        from ...readers.moved_source import unmoved

        self.selection, self.scene = selection, selection.scene
        self.sources: list[Source] = sources_of(self.scene, columns)
        self.files: list[Source] = [unmoved(source)[0] for source in self.sources]
        """The readers of the files themselves."""
        self.moves = [unmoved(source)[1] for source in self.sources]
        """The transformation of each, None where it stays."""
        self.numbers = scan_numbers(self.scene, self.sources)
        self._ghosts = self._hidden_ghosts()
        self.colours = _shown_colours(self.scene) if matched and self.scene.matched else None
        """(N, 3) uint8 by running number, with matched exposures; None where those of the files are written."""

    @cached_property
    def skipped(self) -> dict[int, int]:
        """The records of each source, by its number, of which the clips leave no point: it need not be read.  Of places only,
        where each file has cells of its own."""
        points, records = self.scene.points, self.scene.records
        if records is None or not isinstance(points, JoinedPoints) or points.table.grids != len(self.sources):
            return {}
        if self.scene.meta.dropped.stray:  # those lie in no cell
            return {}
        half = self.scene.cell_size / 2
        centres = self.scene.cell_min + half
        held = may_contain(self.selection.clips, centres, half * _ROUNDED)
        held &= may_contain(self.selection.within, centres, half * _ROUNDED)
        of_grid = np.logical_or.reduceat(held, np.cumsum([0, *points.table.cells[:-1]]))
        return {number: int(records.first[number + 1] - records.first[number]) for number in np.flatnonzero(~of_grid).tolist()}

    @property
    def everything(self) -> bool:
        """Whether nothing is left out."""
        return self.selection.everything

    @property
    def count(self) -> int | None:
        """Records of all sources, as their headers state them; None where one does not."""
        counts = [source.count for source in self.sources]
        return None if None in counts else sum(count or 0 for count in counts)

    def scan_info(self) -> list[ScanInfo]:
        """Name and position of each scan of the scene."""
        return [ScanInfo(scan.name or f"scan {number}", scan.position) for number, scan in enumerate(self.scene.meta.scans, 1)]

    def records(self, label: str) -> Iterator[tuple[int, np.ndarray | None, np.ndarray, Records]]:
        """Yields (source, mask, scan numbers, records) of all pieces of all sources, with progress; mask as of :meth:`mask`."""
        running = 0
        with self.meter(label) as meter:
            for number, source in enumerate(self.sources):
                for found in source.record_chunks():
                    records = self._coloured(found, running)
                    scans = self.numbers.of(number, running, records.scan, len(records.xyz))
                    own = records.columns.get("classification")
                    mask = self.mask(running, records.xyz, scans, own)
                    if (classes := self.classes(running, len(records.xyz), own)) is not None:
                        records = replace(records, columns={**records.columns, "classification": classes})
                    yield number, mask, scans, records
                    running += len(records.xyz)
                    meter.update(len(records.xyz))

    def _coloured(self, records: Records, first: int) -> Records:
        """The records with matched exposures, where these are written and the records have colours."""
        if self.colours is None or records.rgb is None:
            return records
        return replace(records, rgb=self.colours[first : first + len(records.xyz)])

    def meter(self, label: str):
        return progress(self.count or 0, label, "point")

    def classes(self, first: int, count: int, own: np.ndarray | None) -> np.ndarray | None:
        """(count,) uint8: the present classes of records; None where no point has been classified anew.  first: running number
        of the first record.  own: (count,) classes in the file, None where it has none."""
        marks = self.selection.marks
        if marks is None or not marks.reclassifies:
            return None
        return marks.classes(marks.of_record[first : first + count], None if own is None else class_codes(own))

    def mask(self, first: int, xyz: np.ndarray, scans: np.ndarray, own: np.ndarray | None) -> np.ndarray | None:
        """(n,) bool: which records are selected; None: all.  first: running number of the first.  scans: (n,) of each.
        own: (n,) classes in the file, None where it has none."""
        if self.everything:
            return None
        chosen = self.selection
        hidden = [number for number in chosen.hidden if self.scene.marked is None or number != self.scene.marked.station]
        kept = contains(chosen.clips, xyz) & contains(chosen.within, xyz)
        codes = None if chosen.marks is None else chosen.marks.of_record[first : first + len(xyz)]
        kept &= chosen.allows(codes, lambda: None if own is None else class_codes(own))
        if hidden:
            kept &= ~(np.isin(scans, hidden) | ((scans > _LAST) & (_LAST in hidden and not is_shared(self.scene))))
        if len(self._ghosts):
            low, high = np.searchsorted(self._ghosts, (first, first + len(xyz)))
            kept[self._ghosts[low:high] - first] = False
        return kept

    def _hidden_ghosts(self) -> np.ndarray:
        """Ascending running numbers of passers-by that are hidden."""
        marked = self.scene.marked
        if marked is None or marked.station not in self.selection.hidden:
            return np.empty(0, np.int64)
        records = self.scene.records
        if records is None:
            raise InputError("hidden passers-by cannot be left out: this grid does not tell which points of the file they are",
                             remedy="convert the scan again, or show them")
        return np.sort(records.numbers(marked.numbers))


def why_gone(scene: "Scene") -> str | None:
    """Why the files of a scene cannot be read again; None where they can."""
    read = (scene.meta.records or RecordOrigin()).files
    files = [(path, state) for path, *state in read] if read else [(path, None) for path in scene.meta.sources]
    for path, state in files:
        try:
            _, *now = identity_of(Path(path))
        except OSError as error:
            return f"{Path(path).name} cannot be read ({error.strerror or error})"
        if state is not None and now != state:
            return f"{Path(path).name} has changed since the grid was built"
    return None if files or scene.live else "the points were not read from files"


def _shown_colours(scene: "Scene") -> np.ndarray:
    """(N, 3) uint8, by running number: the colours of the grid; 0 for records that the grid leaves out."""
    from ...grid.build_scene import in_memory
    from ...grid.scene import colours, packed

    if scene.records is None:
        raise InputError("this grid does not tell which points of the file its colours belong to",
                         option=Option("--exposures", "matched"),
                         remedy="convert the scan again, or export the colours of the file")
    found = in_memory("colours", (int(scene.records.first[-1]), 3), np.uint8)
    found[:] = 0
    for start in range(0, scene.count, BLOCK):
        rows = slice(start, min(start + BLOCK, scene.count))
        found[scene.records.numbers(rows)] = colours(packed(scene, rows))
    return found
