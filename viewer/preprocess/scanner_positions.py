"""Scanner positions of files that do not state them, inferred from the order of the points where that is possible.

Pass 1 keeps stretches of points in file order (``add``); :mod:`viewer.preprocess.scan_lines` finds the stations in them; the
result (``solve``) splits such a file into one scan per station, so that pass 2 numbers its points by station as it does those
of a file that states its scans.  Three registered rooms written as plain PLY gain 2.3 to 3.4 dB by it, as much as by the poses
of an E57.  A place scanned from a single station gains nothing, and nothing is changed.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from ...model.common.scanner_positions import station_positions_of, stations_differ
from ..readers.source import Chunk, ScanInfo, Source
from .scan_lines import WINDOW, Station, find_stations
from .scan_table import ScanTable, stated_scans
from .valid_positions import is_position

MOST_STRETCHES = 2048
"""Stretches kept of a file, up to twice as many: 50 MB."""


class StationInference:
    """Observes the chunks of pass 1 (``add``), then splits sources into stations (``solve``)."""

    def __init__(self, sources: Sequence[Source]):
        self._sources = sources
        self.reset()

    def reset(self) -> None:
        """Forgets all chunks: pass 1 begins again."""
        self._source, self._stride = -1, WINDOW  # the source that is being read, and how far apart its stretches begin
        self._kept: list[tuple[int, np.ndarray]] = []
        self._first, self._points = dict[int, int](), dict[int, int]()
        self._found: dict[int, tuple[list[Station], np.ndarray]] = {}

    def add(self, source: int, first: int, chunk: Chunk) -> None:
        """Keeps some of a chunk's points.  first: running number of its first point, over all sources."""
        scans = self._sources[source].scans
        if len(scans) != 1 or scans[0].position is not None or isinstance(chunk.scan, np.ndarray):
            return
        if source != self._source:
            self._close()  # one file's stretches at a time: there may be hundreds of files
            self._source, self._stride = source, WINDOW
        at = first - self._first.setdefault(source, first)
        self._points[source] = at + len(chunk.xyz)
        starts = range(-at % self._stride, len(chunk.xyz) - WINDOW + 1, self._stride)
        windows = [np.array(chunk.xyz[start : start + WINDOW], np.float64) for start in starts]
        if windows:  # all are tested at once: one by one takes five times as long
            usable = is_position(np.concatenate(windows)).reshape(-1, WINDOW).all(axis=1)
            self._kept += [(at + starts[i], windows[i]) for i in np.flatnonzero(usable).tolist()]
        while len(self._kept) > 2 * MOST_STRETCHES:
            self._stride *= 2
            self._kept = [(place, window) for place, window in self._kept if place % self._stride == 0]

    def _close(self) -> None:
        """Finds the stations of the source that was read last, and frees its stretches."""
        kept, self._kept = self._kept, []
        if kept and (stations := find_stations(np.stack([window for _, window in kept]))):
            self._found[self._source] = stations, np.array([place for place, _ in kept], np.int64)

    def solve(self) -> ScanTable:
        """Ends pass 1.  Returns the scans of the files, with one scan per station where stations were found and differ."""
        self._close()
        found, stated = self._found, stated_scans(self._sources)
        positions = [scan.position for number, scans in enumerate(stated.scans) if number not in found for scan in scans]
        inferred = [station.position.tolist() for stations, _ in found.values() for station in stations]
        if not stations_differ(station_positions_of([*positions, *inferred])):
            return stated
        scans, turns, counts = list(stated.scans), {}, {}
        for number, (stations, at) in found.items():
            name = stated.scans[number][0].name
            scans[number] = tuple(_inferred(f"{name}, station {i}", station) for i, station in enumerate(stations, 1))
            between = [(at[before.last] + WINDOW + at[after.first]) // 2 for before, after in pairwise(stations)]
            starts = np.array(between, np.int64)
            turns[number] = self._first[number] + starts
            sizes = np.diff(np.append(starts, self._points[number]), prepend=0)
            counts |= {(number, scan): int(size) for scan, size in enumerate(sizes)}
        return ScanTable(tuple(scans), turns, counts)


def _inferred(name: str, station: Station) -> ScanInfo:
    x, y, z = station.position.tolist()
    return ScanInfo(name, (x, y, z), inferred=True)
