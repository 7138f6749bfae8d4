"""Records as columns, for formats other than their own: what the selected records hold, and the records piece by piece.

A first pass (``survey``) finds which columns there are and which values they take; writers choose types by it.
Frame: file coordinates.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ...preprocess.valid_positions import is_position
from ...readers.source import ScanInfo
from ...work.selection import Selection
from .record_stream import SourceRecords

FULL = 9
"""Decimals from which coordinates count as using all digits of their type."""
CUT_COLOURS = "16-bit colours are cut to 8 bits, their lower 8 are all 0"
_WIDE = 257
"""8-bit to 16-bit colour: 255 becomes 65535."""


@dataclass(frozen=True, eq=False)
class Piece:
    """Selected records of one source.  xyz: (n, 3) float64.  rgb: (n, 3) uint8 or uint16 or None.  scan: (n,) int64, numbers
    of the scene's scans.  columns: name -> (n,) or (n, k)."""

    source: int
    xyz: np.ndarray
    rgb: np.ndarray | None
    scan: np.ndarray
    columns: dict[str, np.ndarray]


class Stream(Protocol):
    """Selected records, piece by piece, as often as needed."""

    def pieces(self, label: str) -> Iterator[Piece]: ...

    def scan_info(self) -> list[ScanInfo]: ...


@dataclass
class Column:
    """dtype: holds the values of all sources.  width: values of a record.  low, high: of the finite values.  whole: all of them
    are whole numbers.  gaps: some are NaN, or a source has no such column."""

    dtype: np.dtype
    width: int = 1
    low: float = np.inf
    high: float = -np.inf
    whole: bool = True
    gaps: bool = False
    sources: set[int] = field(default_factory=set)

    def fits(self, low: int, high: int) -> bool:
        """Whether all values are whole numbers from ``low`` to ``high``."""
        return (
            self.whole
            and not self.gaps_in_values
            and self.width == 1
            and (self.low > self.high or (self.low >= low and self.high <= high))
        )

    gaps_in_values: bool = False

    @property
    def shares(self) -> bool:
        """Whether the values are fractions from 0 to 1, such as the intensities of PTX and of most E57."""
        return not self.whole and self.low >= 0 and self.high <= 1

    def add(self, source: int, values: np.ndarray) -> None:
        dtype = values.dtype.newbyteorder("=")
        self.dtype = np.result_type(self.dtype, dtype) if self.sources else dtype
        self.width = max(self.width, values.shape[1] if values.ndim > 1 else 1)
        self.sources.add(source)
        if values.dtype.kind == "f":
            finite = values[np.isfinite(values)]
            self.gaps_in_values |= len(finite) < values.size
            self.whole &= bool((finite == np.rint(finite)).all())
            values = finite
        if values.size:
            self.low, self.high = min(self.low, values.min().item()), max(self.high, values.max().item())


@dataclass
class Survey:
    """What the selected records hold.

    counts: by scan number.  low, high: (3,) bounds.  decimals: (3,) digits behind the point that the coordinates use, FULL
    where they use all of their type.  full: by source that uses all digits, (3,) its largest absolute coordinate on the axes
    where it does, else 0.  depth: by source, bits of its colours, 0 where it has none.  exact8: the upper 8 bits say
    all of the 16-bit colours.  shifted: they say it because the lower 8 are 0.  runs: the records of each scan follow each
    other.
    """

    count: int = 0
    counts: dict[int, int] = field(default_factory=dict)
    low: np.ndarray = field(default_factory=lambda: np.full(3, np.inf))
    high: np.ndarray = field(default_factory=lambda: np.full(3, -np.inf))
    decimals: np.ndarray = field(default_factory=lambda: np.zeros(3, int))
    full: dict[int, np.ndarray] = field(default_factory=dict)
    depth: dict[int, int] = field(default_factory=dict)
    exact8: bool = True
    shifted: bool = False
    runs: bool = True
    columns: dict[str, Column] = field(default_factory=dict)
    sources: int = 0
    _last: int = -1
    _decimals: dict[int, np.ndarray] = field(default_factory=dict)
    _largest: dict[int, np.ndarray] = field(default_factory=dict)

    def add(self, piece: Piece) -> None:
        if len(piece.xyz) == 0:
            return
        self.count += len(piece.xyz)
        turns = piece.scan[np.flatnonzero(np.diff(piece.scan, prepend=self._last))]
        for number in turns.tolist():
            self.runs &= number not in self.counts
            self.counts.setdefault(number, 0)
        self._last = int(piece.scan[-1])
        for number, count in zip(*np.unique(piece.scan, return_counts=True), strict=True):
            self.counts[int(number)] += int(count)
        self.low, self.high = np.minimum(self.low, piece.xyz.min(axis=0)), np.maximum(self.high, piece.xyz.max(axis=0))
        for axis in range(3):
            self._add_decimals(piece.source, axis, piece.xyz[:, axis])
        self.sources = max(self.sources, piece.source + 1)
        if piece.rgb is None:
            self.depth.setdefault(piece.source, 0)
        else:
            self._add_colours(piece.source, piece.rgb)
        for name, values in piece.columns.items():
            self.columns.setdefault(name, Column(values.dtype)).add(piece.source, values)

    def _add_decimals(self, source: int, axis: int, values: np.ndarray) -> None:
        own = self._decimals.setdefault(source, np.zeros(3, int))
        own[axis] = decimals_of(values, int(own[axis]))
        self.decimals[axis] = max(self.decimals[axis], own[axis])
        largest = self._largest.setdefault(source, np.zeros(3))
        largest[axis] = max(largest[axis], float(np.abs(values).max()))

    def _add_colours(self, source: int, rgb: np.ndarray) -> None:
        wide = rgb.dtype == np.uint16 and int(rgb.max()) > 255
        self.depth[source] = max(self.depth.get(source, 0), 16 if wide else 8)
        if wide and self.exact8:
            filled = bool((rgb % _WIDE == 0).all())
            self.exact8 = filled or bool((rgb & 0xFF == 0).all())
            self.shifted |= not filled

    def close(self) -> "Survey":
        """Ends the pass."""
        self.full = {source: np.where(own >= FULL, self._largest[source], 0) for source, own in self._decimals.items()}
        seen = set(self.depth)
        for column in self.columns.values():
            column.gaps = column.gaps_in_values or column.sources != seen
        return self

    @property
    def coloured(self) -> bool:
        return any(self.depth.values())

    def colours8(self, piece: Piece) -> np.ndarray:
        """(n, 3) uint8; 0 where the source has none."""
        if piece.rgb is None:
            return np.zeros(piece.xyz.shape, np.uint8)
        return (piece.rgb >> 8 if self.depth[piece.source] == 16 else piece.rgb).astype(np.uint8)

    def colours16(self, piece: Piece) -> np.ndarray:
        """(n, 3) uint16; 8-bit colours fill both bytes."""
        if piece.rgb is None:
            return np.zeros(piece.xyz.shape, np.uint16)
        return piece.rgb if self.depth[piece.source] == 16 else piece.rgb.astype(np.uint16) * _WIDE


def survey(stream: Stream) -> Survey:
    """One pass over the selected records."""
    found = Survey()
    for piece in stream.pieces("counting"):
        found.add(piece)
    return found.close()


def decimals_of(values: np.ndarray, least: int) -> int:
    """Digits behind the point that (n,) values use, at least ``least``; FULL where they use all digits of their type."""
    most = float(np.abs(values).max())
    for digits in range(least, FULL):
        factor = 10.0**digits
        slack = 8 * np.finfo(np.float64).eps * most * factor + 1e-9  # 4 roundings to float64
        if slack > 0.02:
            return FULL
        scaled = values * factor
        if np.abs(scaled - np.rint(scaled)).max() <= slack:
            return digits
    return FULL


class SourceColumns:
    """The selected records of a scene's sources as columns; those without a usable position are left out and counted."""

    def __init__(self, stream: SourceRecords):
        self._stream = stream
        self.lost = self.far = 0

    def scan_info(self) -> list[ScanInfo]:
        return self._stream.scan_info()

    def pieces(self, label: str) -> Iterator[Piece]:
        low, high = self._stream.scene.bounds
        self.lost = self.far = 0
        for source, mask, scans, records in self._stream.records(label):
            usable = is_position(records.xyz)
            self.lost += int(np.count_nonzero(~usable))
            with np.errstate(invalid="ignore"):
                near = usable & (records.xyz >= low).all(axis=1) & (records.xyz <= high).all(axis=1)
            self.far += int(np.count_nonzero(usable & ~near))
            kept = near if mask is None else near & mask
            every = kept.all()
            xyz, rgb, scan, columns = records.xyz, records.rgb, scans, records.columns
            if not every:
                xyz, rgb, scan = xyz[kept], None if rgb is None else rgb[kept], scan[kept]
                columns = {name: values[kept] for name, values in columns.items()}
            if len(xyz):
                yield Piece(source, xyz, rgb, scan, columns)


class GridColumns:
    """The points of a grid whose files are gone, as columns, with the precision of the grid."""

    def __init__(self, selection: Selection):
        self._selection = selection

    def scan_info(self) -> list[ScanInfo]:
        scans = self._selection.scene.meta.scans
        places = self._selection.scene.station_places
        found = []
        for number, scan in enumerate(scans):
            known = number < len(places) and np.isfinite(places[number]).all()
            x, y, z = places[number].tolist() if known else (0.0, 0.0, 0.0)
            found.append(ScanInfo(scan.name or f"scan {number + 1}", (x, y, z) if known else None))
        return found

    def pieces(self, label: str) -> Iterator[Piece]:
        scene = self._selection.scene
        layout = scene.attributes
        for block in self._selection.blocks(label):
            columns = {"intensity": block.intensity} if layout.low is not None else {}
            if layout.has_classes or (self._selection.marks is not None and self._selection.marks.reclassifies):
                columns["classification"] = block.classification
            yield Piece(0, block.xyz, block.rgb, block.station.astype(np.int64), columns)
