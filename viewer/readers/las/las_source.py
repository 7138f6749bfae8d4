"""LAS, LAZ and COPC through laspy and lazrs, a chunk at a time.

The header is checked here before laspy reads it: laspy allocates memory for a damaged record count.  Colour has 16 bits;
whether they hold 8-bit values is decided over the whole file when the grid is built (viewer.preprocess.point_colour).
"""

import struct
from collections.abc import Iterator
from functools import partial, reduce
from operator import or_
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from ...common.errors import InputError
from .. import crs
from ..record_blocks import RecordBlocks, even_blocks
from ..sampling import FEWEST_ALIGNED, bit_reversed, run_starts, sampled_nodes
from ..scaled_values import scaled
from ..source import CHUNK, Chunk, Records, ScanInfo, Source, surplus_warning
from .copc_nodes import CopcNodes, read_nodes
from .las_conversion import chunk_of_records
from .las_decoding import decoding
from .las_records import records_of
from .laz_chunks import checked_points
from .laz_points import ALL, FIELDS, LazPoints

_BLOCK = 128 << 20
"""Bytes of records that are read at once; a record has 20 to 65,535."""
_PIECE = 1 << 16
"""Points that are decoded at a time where one column is wanted: a chunk of LAZ has 50,000 where nothing else is stated."""
_OF_CHUNK = ("xyz", "rgb", "intensity", "classification", "point_source_id")
"""What a chunk of points consists of."""
_MOST_DECODED = 1_000_000
"""Points decoded for a sample of a file with few chunks: about a second on one core."""


class LasSource(Source):
    """One .las, .laz or .copc.laz file.  Raises InputError where the header is damaged."""

    def __init__(self, path: Path):
        super().__init__(path, "LAS", scans=[ScanInfo(path.stem)])
        self._counted = _check_header(path)
        self._laz: LazPoints | None = None
        self._blocks: RecordBlocks | None = None
        self._blocks_lock = Lock()
        with self._open() as reader:
            header = self._header = reader.header
            self.count = int(header.point_count)
            compressed = header.are_points_compressed
            records = list(header.vlrs) + list(header.evlrs or [])
            more = self._check_chunks(header) if compressed else self._beyond(header)
        copc = any(record.user_id == "copc" for record in records)
        self.format = ("COPC" if copc else "LAZ") if compressed else "LAS"
        if not (np.isfinite(header.scales).all() and np.isfinite(header.offsets).all() and np.all(header.scales != 0)):
            raise InputError(f"coordinate scale {header.scales} is not usable; the header is damaged", file=path)
        (self.crs, self.units, self.metres_per_unit), heights = _reference(records)
        self.heights = heights
        """Unit of heights, where it is stated."""
        self.warnings += crs.height_warning(path.name, self.units, self.metres_per_unit, heights)
        if more > 0:
            self.warnings.append(surplus_warning(path, self.count))

    def stated_bounds(self) -> np.ndarray:
        """(2, 3): lowest and highest coordinates by the header."""
        return np.array([self._header.mins, self._header.maxs], np.float64)

    def _open(self):
        import laspy

        with decoding(lambda why: InputError(f"not readable as LAS/LAZ: {why}", file=self.path,
                                             remedy="copy or export it again")):
            reader = laspy.open(self.path)
        if reader.header.point_count == 0:  # only the field of earlier versions is filled in
            reader.header.point_count = self._counted
        return reader

    def _beyond(self, header) -> int:
        """The number of points for which there is room after those that the header counts, before the next section."""
        after = [self.path.stat().st_size, header.start_of_waveform_data_packet_record or 0]
        after.append(header.start_of_first_evlr if header.number_of_evlrs else 0)
        end = header.offset_to_point_data + header.point_count * header.point_format.size
        return (min((place for place in after if place >= end), default=end) - end) // header.point_format.size

    def _check_chunks(self, header) -> int:
        """The number of further chunks after the points that the header counts."""
        described = [record.record_data_bytes() for record in header.vlrs if record.record_id == 22204]
        self._laz, more = checked_points(self.path, described[0] if described else b"", offset=header.offset_to_point_data,
                                         length=header.point_format.size, count=header.point_count)  # fmt: skip
        return more

    def chunks(self) -> Iterator[Chunk]:
        """Yields xyz, rgb (uint16), intensity and class as stored."""
        return (chunk for _, chunk in self._read(CHUNK, _OF_CHUNK))

    def record_chunks(self) -> Iterator[Records]:
        """See Source.  native: a structured array of the point format's layout."""
        for points, chunk in self._read(CHUNK):
            yield records_of(points, chunk)

    def column_chunks(self, name: str) -> Iterator[Records]:
        for points, chunk in self._read(_PIECE, ("xyz", name)):
            yield records_of(points, chunk, name)

    def native_chunks(self) -> Iterator[tuple[Chunk, np.ndarray]]:
        """Yields chunks, and their records as a structured array of the point format's layout."""
        for points, chunk in self._read(CHUNK):
            yield chunk, points.array

    def _read(self, most: int, only: tuple[str, ...] = ()) -> Iterator[tuple[Any, Chunk]]:
        """Yields the points as laspy holds them, and as a chunk of ``most`` points.  only: the fields that are wanted; the
        values of others mean nothing."""
        done, outside = 0, False
        # one step of rounding on either side: some writers round the bounds, some the points
        with np.errstate(invalid="ignore", over="ignore"):  # of a damaged header; no comparison with NaN holds
            low, high = self._header.mins - self._header.scales, self._header.maxs + self._header.scales
        names = set(self._header.point_format.dimension_names)
        if only:
            names &= {*only, *(("red", "green", "blue") if "rgb" in only else ())}
        fields = reduce(or_, (FIELDS.get(name, ALL) for name in only)) if only else ALL
        blocks = self._blocks_of(max(1, min(most, _BLOCK // self._header.point_format.size)), fields, only == _OF_CHUNK)
        while done < (self.count or 0):
            with decoding(partial(self._truncated, done)):
                points = next(blocks, None)
            if points is None or len(points) == 0:
                raise self._truncated(done)
            done += len(points)
            if only in ((), _OF_CHUNK):
                chunk, (lowest, highest) = chunk_of_records(points.array, self._header.scales, self._header.offsets)
            else:
                chunk = _chunk(points, names)
                lowest, highest = chunk.xyz.min(axis=0), chunk.xyz.max(axis=0)
            outside |= bool((lowest < low).any() or (highest > high).any())
            yield points, chunk
        if outside:
            text = f"{self.path.name}: has points outside the bounds in its header, it may be damaged"
            if text not in self.warnings:  # once, however often the points are read
                self.warnings.append(text)

    def _blocks_of(self, most: int, fields: int, reused: bool) -> Iterator[Any]:
        """Yields all points as laspy holds them, up to ``most`` at a time.  fields, reused: see LazPoints."""
        if self._laz is not None:
            yield from map(self._as_points, self._laz.blocks(most, fields, reused=reused))
            return
        with self._open() as reader:
            yield from reader.chunk_iterator(most)

    def _as_points(self, records: bytearray | np.ndarray) -> Any:
        import laspy

        header = self._header
        array = np.frombuffer(records, header.point_format.dtype())
        return laspy.ScaleAwarePointRecord(array, header.point_format, header.scales, header.offsets)

    def _between(self, start: int, stop: int) -> Any:
        """Points start to stop as laspy holds them."""
        with decoding(partial(self._truncated, start)):
            if self._laz is not None:
                points = self._as_points(self._laz.read(start, stop))
            else:
                with self._open() as reader:
                    reader.seek(start)
                    points = reader.read_points(stop - start)
        if len(points) < stop - start:
            raise self._truncated(start + len(points))
        return points

    def records(self, numbers: np.ndarray) -> Records:
        """See Source: by chunks of a compressed file, else by seeking.  Decoded chunks are kept."""
        with self._blocks_lock:
            if self._blocks is None:
                self._blocks = self._made_blocks()
        return self._blocks.take(numbers)

    @property
    def has_quick_records(self) -> bool:
        return self._chunk_points <= _MOST_DECODED

    @property
    def _chunk_points(self) -> int:
        """Points of the largest chunk of a compressed file; else 1."""
        return 1 if self._laz is None else int(self._laz.points.max())

    def _made_blocks(self) -> RecordBlocks:
        count, names = self.count or 0, set(self._header.point_format.dimension_names)
        starts = even_blocks(count)
        if self._laz is not None and self._chunk_points <= _MOST_DECODED:
            starts = np.append(0, self._laz.points.cumsum())

        def read(block: int) -> Records:
            points = self._between(int(starts[block]), int(starts[block + 1]))
            return records_of(points, _chunk(points, names))

        return RecordBlocks(starts, read)

    def sample(self, points: int, run: int) -> Iterator[Chunk]:
        """See Source.  Compressed points can be read from the beginning of a chunk only, so every run begins there.  Where
        there are few chunks, long runs are thinned.  Of COPC files the upper levels are the sample."""
        if self.format == "COPC" and (nodes := read_nodes(self.path, self.count or 0)):
            return self._upper_levels(nodes, points)
        return self._sampled(points, run)

    def _upper_levels(self, nodes: CopcNodes, points: int) -> Iterator[Chunk]:
        for node, step in sampled_nodes(nodes.level, nodes.points, points):
            yield self.node_chunk(nodes, node, step)

    def node_chunk(self, nodes: CopcNodes, node: int, step: int = 1) -> Chunk:
        """The points of one node of a COPC file, or every ``step``-th of them.  Raises InputError where they are damaged."""
        count, place, held = (int(column[node]) for column in (nodes.points, nodes.place, nodes.bytes))
        if self._laz is None or count * self._laz.length > 2 * _BLOCK:
            raise self._truncated(0, f"a chunk of {count:,} points is larger than any program writes")
        with decoding(partial(self._truncated, 0)):
            found = self._as_points(self._laz.chunk(place, held, count))
        return _chunk(found[::step], set(self._header.point_format.dimension_names))

    def _sampled(self, points: int, run: int) -> Iterator[Chunk]:
        names = set(self._header.point_format.dimension_names)
        for start, count, step in self._runs(points, run):
            yield _chunk(self._between(start, start + count)[::step], names)

    def _runs(self, points: int, run: int) -> Iterator[tuple[int, int, int]]:
        """Yields first point, number of points and step of the runs of a sample."""
        count = self.count or 0
        chunk = self._chunk_points
        if chunk > 1 and count < FEWEST_ALIGNED * chunk:
            starts = np.arange(0, count, chunk)
            read = min(chunk, _MOST_DECODED // len(starts))
            step = max(1, min(count, read * len(starts)) // points)
            for start in starts[bit_reversed(len(starts))].tolist():
                yield start, min(read, count - start), step
            return
        if chunk > 1:
            run = min(max(run, points * chunk // max(count, 1)), chunk)
        for start in run_starts(count, points, run, chunk).tolist():
            yield start, min(run, count - start), 1

    def _truncated(self, done: int, why: str = "") -> InputError:
        reason = f" ({why})" if why else ""
        return InputError(f"truncated or damaged: {done:,} of {self.count:,} points could be read{reason}", file=self.path,
                          remedy="copy or export it again")


def _chunk(points, names: set[str]) -> Chunk:
    """The points of laspy, with colours and intensities as stored."""
    xyz = np.empty((len(points), 3))
    for axis, name in enumerate("XYZ"):
        xyz[:, axis] = scaled(np.asarray(points[name]), points.scales[axis], points.offsets[axis])
    colours = [np.asarray(points[c]) for c in ("red", "green", "blue") if c in names]
    rgb = np.stack(colours, axis=1) if len(colours) == 3 else None
    intensity = np.array(points["intensity"], np.uint16) if "intensity" in names else None
    station = np.array(points["point_source_id"]) if rgb is not None else None
    return Chunk(xyz, rgb, intensity, station=station, classification=np.array(points["classification"], np.uint8))


def _check_header(path: Path) -> int:
    """The number of points: by the field of 64 bits where it is filled in.  Raises InputError where the header is damaged."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(375)
    if len(head) < 227:
        raise InputError(f"truncated in its header ({size} bytes)", file=path, remedy="copy or export it again")
    major, minor = head[24], head[25]
    header_size, offset, records, point_format, length, count = struct.unpack_from("<HIIBHI", head, 94)
    compressed = bool(point_format & 0xC0)
    if (major, minor) >= (1, 4) and len(head) >= 255:
        count = struct.unpack_from("<Q", head, 247)[0] or count
    if major != 1 or minor > 5:
        raise InputError(f"LAS version {major}.{minor} is not known; versions 1.0 to 1.5 are read", file=path)
    if minor >= 4 and len(head) >= 255:
        _check_extended(path, size, *struct.unpack_from("<QI", head, 235))
    if header_size < 227 or offset < header_size or records * 54 > offset - header_size:
        raise InputError(f"damaged header ({header_size} bytes, {records} records before byte {offset})", file=path)
    if count == 0:
        raise InputError("holds no points (its header says 0)", file=path, remedy="export it again")
    if offset >= size:
        raise InputError(f"truncated: 0 of {count:,} points could be read", file=path, remedy="copy or export it again")
    if length == 0:
        raise InputError("its header is damaged (point record of 0 bytes)", file=path)
    readable = (size - offset) // length
    if not compressed and readable < count:
        raise InputError(f"truncated: {readable:,} of {count:,} points could be read", file=path,
                         remedy="copy or export it again")
    return count


def _check_extended(path: Path, size: int, place: int, number: int) -> None:
    """Checks the records behind the points: where they end beyond the file, laspy would create up to 2**32 empty ones."""
    with path.open("rb") as file:
        for _ in range(number):
            file.seek(min(place + 20, size))
            place += 60 + int.from_bytes(file.read(8), "little")
            if place > size:
                raise InputError(f"truncated: the last of its {number:,} extended records ends beyond its {size:,} bytes",
                                 file=path, remedy="copy or export it again")


def _reference(records) -> tuple[crs.Reference, crs.Length | None]:
    """The reference system of x and y, and the unit of heights where it is stated."""
    keys: dict[int, int] = {}
    spans: dict[int, tuple[int, int]] = {}
    text, best, heights = "", (None, "unknown", None), None
    for record in records:
        if record.user_id.strip("\0 ") != "LASF_Projection":
            continue
        data = record.record_data_bytes()
        if record.record_id == 2112:
            best, heights = crs.from_wkt(wkt := data.decode("utf-8", "replace")), crs.height_unit(wkt)
        elif record.record_id == 34735:
            for key, location, length, value in struct.iter_unpack("<4H", data[8 : len(data) // 8 * 8]):
                if location == 0:
                    keys[key] = value
                elif location == 34737:
                    spans[key] = (value, length)
        elif record.record_id == 34737:
            text = data.decode("latin-1")
    if best[0] is None and (keys or spans):
        best = crs.from_geokeys(keys, text, spans)
    return best, heights or crs.height_unit_of_geokeys(keys)
