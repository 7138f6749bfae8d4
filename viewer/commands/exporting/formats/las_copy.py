"""LAS to LAS, record by record: every dimension, extra byte and flag of a point, and every variable-length record, as bytes.

Several files become one where their point records have the same layout: coordinates are then whole numbers of the finest scale,
which keeps each value exactly.  Other files go the way of columns (las_writer).
"""

import io
import struct
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ....common.errors import InputError
from ....common.rigid_transform import moved_points
from ....readers.las.las_source import LasSource
from ....readers.moved_source import NORMALS
from ..crs_records import Reference
from ..losses import Losses
from ..output_file import output_file
from ..record_stream import SourceRecords
from .las_layout import (
    EXTRA_BYTES,
    LASZIP,
    PROJECTION,
    WAVEFORM_PACKETS,
    LasLayout,
    Record,
    Tally,
    copy_extended,
    patched,
    read_layout,
    vlr,
    with_classes,
)
from .las_scales import common_scale, rounded_coordinates, whole_coordinates

_WKT_BIT = 1 << 4
_CHECKED = (9, 10)
"""Point formats whose waveform fields lazrs 0.8 confuses where scanner channels alternate; they are decoded again."""
_FIRST = 50_000
"""Records that are compressed and decoded again before any other is read: a chunk of LAZ."""
_CHANNEL = 4  # bit of the classification flags at which the scanner channel begins
_COPC = (("copc", 1), ("copc", 1000))


def can_copy(stream: SourceRecords) -> bool:
    """Whether all sources are LAS files whose records have the same layout and whose coordinates have a common scale."""
    if not all(isinstance(source, LasSource) for source in stream.files):
        return False
    layouts = [read_layout(source.path) for source in stream.files]
    if len(layouts) == 1:
        return not any(stream.moves) or common_scale(layouts, stream.moves) is not None
    first = layouts[0]
    same = all(
        (lay.version, lay.point_format, lay.length, lay.extra_bytes)
        == (first.version, first.point_format, first.length, first.extra_bytes)
        for lay in layouts
    )
    return same and not first.waveforms and common_scale(layouts, stream.moves) is not None


class _Facts:
    """What the files together need: which have 8-bit colours in 16-bit fields, and which number tells their points apart."""

    def __init__(self, stream: SourceRecords, layouts: list[LasLayout], losses: Losses):
        self.shade: list[int] = [1] * len(layouts)
        self.source_ids: list[int] = [0] * len(layouts)
        if len(layouts) == 1 or stream.colours is not None:
            return
        largest, ids = [0] * len(layouts), False
        with stream.meter("looking at the files") as meter:
            for number, source in enumerate(stream.files):
                assert isinstance(source, LasSource)
                if number in stream.skipped:
                    meter.update(stream.skipped[number])
                    continue
                for chunk, records in source.native_chunks():
                    ids |= bool(records["point_source_id"].any())
                    largest[number] = max(largest[number], 0 if chunk.rgb is None else int(chunk.rgb.max(initial=0)))
                    meter.update(len(records))
        if max(largest) > 255:
            self.shade = [257 if 0 < value <= 255 else 1 for value in largest]
            names = [source.path.name for source, shade in zip(stream.files, self.shade, strict=True) if shade > 1]
            if names:
                losses.add(
                    f"8-bit colours in 16-bit fields are multiplied by 257 beside 16-bit colours, in {', '.join(names[:3])}"
                )
        if not ids and len(layouts) < 65536:
            stated = [struct.unpack_from("<H", lay.header, 4)[0] for lay in layouts]
            usable = all(stated) and len(set(stated)) == len(stated)
            self.source_ids = stated if usable else list(range(1, len(layouts) + 1))


def copy_las(path: Path, stream: SourceRecords, reference: Reference, losses: Losses) -> int:
    """Writes the selected records; returns how many.  path: LAZ where its name says so."""
    layouts = [read_layout(source.path) for source in stream.files]
    compressed = path.suffix.lower() == ".laz"
    _check_waveforms(stream, layouts, compressed)
    facts = _Facts(stream, layouts, losses)
    moved = any(stream.moves)
    common = common_scale(layouts, stream.moves) if len(layouts) > 1 or moved else None
    if moved and common is not None:
        _tell_moved(layouts, common[0], losses)
    header, vlrs, evlrs = _parts(layouts, reference, common, losses)
    first, tally = layouts[0], Tally.empty()
    with output_file(path) as out:
        writer: Any = None
        lazrs: Any = import_module("lazrs")  # compiled, without type declarations
        described = _compression(lazrs, first) if compressed else None
        if described is not None:
            vlrs = [*vlrs, vlr(*LASZIP, described.record_data(), "http://laszip.org")]
        offset = len(header) + sum(len(record.raw) for record in vlrs) + len(first.gap)
        out.write(header + b"".join(record.raw for record in vlrs) + first.gap)
        if described is not None:
            writer = lazrs.ParLasZipCompressor(out, described)
        for records in _selected(stream, layouts, facts, common):
            tally.add(records)
            if writer is None:
                out.write(records.tobytes())
            else:
                writer.compress_many(np.frombuffer(records.tobytes(), np.uint8))
        if writer is not None:
            writer.done()
            if first.point_format in _CHECKED:
                _check(out, offset, described, _selected(stream, layouts, facts, common), first)
        place, waveforms = out.seek(0, 2), 0
        for source, record in evlrs:
            waveforms = out.tell() if record.key == WAVEFORM_PACKETS else waveforms
            out.write(record.raw) if record.length == 0 else copy_extended(record, source, out)
        counted = sum(record.key != WAVEFORM_PACKETS or header[25] >= 4 for _, record in evlrs)
        out.seek(0)
        out.write(
            patched(
                header, tally, offset=offset, vlrs=len(vlrs), compressed=compressed, evlrs=(place, counted), waveforms=waveforms
            )
        )
    return tally.count


def _check_waveforms(stream: SourceRecords, layouts: list[LasLayout], compressed: bool) -> None:
    """Raises InputError where lazrs decodes the first records of point formats 9 and 10, which are in several scanner channels,
    wrongly: those of the file, or those that it would write.  Before the rest is read."""
    for source, layout in zip(stream.files, layouts, strict=True):
        packed = source.format != "LAS"
        if layout.point_format not in _CHECKED or not (packed or compressed):
            continue
        assert isinstance(source, LasSource)
        _, records = next(source.native_chunks())
        records = records[:_FIRST]
        if packed and len(np.unique(records["classification_flags"] >> _CHANNEL & 3)) > 1:
            raise InputError(f"waveform fields of point format {layout.point_format} with several scanner channels are not "
                             "decoded right here", file=layout.path,
                             remedy="unpack it with LAStools (laszip -i NAME.laz -o NAME.las) and export that")
        if compressed:
            lazrs: Any = import_module("lazrs")
            described, made = _compression(lazrs, layout), io.BytesIO()
            compressor = lazrs.LasZipCompressor(made, described)
            compressor.compress_many(np.frombuffer(records.tobytes(), np.uint8))
            compressor.done()
            _check(made, 0, described, iter([records]), layout)


def _check(out: BinaryIO, offset: int, described: Any, expected: Iterator[np.ndarray], layout: LasLayout) -> None:
    """Raises InputError where the compressed points are not decoded as they were."""
    lazrs: Any = import_module("lazrs")
    out.seek(offset)
    decompressor = lazrs.LasZipDecompressor(out, described.record_data())
    for records in expected:
        found = np.empty(records.nbytes, np.uint8)
        decompressor.decompress_many(found)
        if found.tobytes() != records.tobytes():
            raise InputError(f"point format {layout.point_format} with alternating scanner channels is not compressed "
                             "without loss here", file=layout.path, remedy="give --out a name that ends in .las")


def _compression(lazrs: Any, layout: LasLayout) -> Any:
    standard = {0: 20, 1: 28, 2: 26, 3: 34, 4: 57, 5: 63, 6: 30, 7: 36, 8: 38, 9: 59, 10: 67}
    try:
        return lazrs.LazVlr.new_for_compression(layout.point_format, layout.length - standard[layout.point_format])
    except (lazrs.LazrsError, KeyError):
        raise InputError(f"point format {layout.point_format} cannot be compressed here", file=layout.path,
                         remedy="give --out a name that ends in .las") from None


def _selected(stream: SourceRecords, layouts: list[LasLayout], facts: _Facts, common) -> Iterator[np.ndarray]:
    running = 0
    with stream.meter("writing") as meter:
        for number, source in enumerate(stream.files):
            assert isinstance(source, LasSource)
            if number in stream.skipped:
                running += stream.skipped[number]
                meter.update(stream.skipped[number])
                continue
            transform = stream.moves[number]
            for chunk, records in source.native_chunks():
                scans = stream.numbers.of(number, running, chunk.scan, len(records))
                xyz = chunk.xyz if transform is None else moved_points(transform, chunk.xyz)
                mask = stream.mask(running, xyz, scans, chunk.classification)
                if (classes := stream.classes(running, len(records), chunk.classification)) is not None:
                    records = with_classes(records, classes, layouts[number])
                if stream.colours is not None and chunk.rgb is not None:
                    records = records.copy()
                    for axis, name in enumerate(("red", "green", "blue")):
                        records[name] = stream.colours[running : running + len(records), axis].astype(np.uint16) * 257
                running += len(records)
                found = records if mask is None else records[mask]
                if common is not None and len(found):
                    if transform is None:
                        found = whole_coordinates(found.copy(), layouts[number], *common)
                    else:
                        kept = xyz if mask is None else xyz[mask]
                        found = rounded_coordinates(found.copy(), kept, layouts[number], *common)
                    if facts.source_ids[number]:
                        found["point_source_id"] = facts.source_ids[number]
                    if facts.shade[number] > 1:
                        for name in ("red", "green", "blue"):
                            found[name] *= facts.shade[number]
                yield found
                meter.update(len(records))


def _tell_moved(layouts: list[LasLayout], scales: np.ndarray, losses: Losses) -> None:
    """Names what a motion does to records besides their places."""
    losses.add(f"coordinates of moved scans are rounded to {scales[0]:g} file units")
    extra = b"".join(record.raw for lay in layouts for record in lay.vlrs if record.key == EXTRA_BYTES)
    if any(name.encode() in extra for names in NORMALS for name in names[:1] if len(name) > 2):
        losses.add("normals in extra bytes keep their directions, although their scan is turned")
    if any(lay.waveforms for lay in layouts):
        losses.add("waveforms keep their directions, although their scan is turned")


def _parts(
    layouts: list[LasLayout], reference: Reference, common, losses: Losses
) -> tuple[bytes, list[Record], list[tuple[Path, Record]]]:
    """Header, variable-length records, and extended ones with their files."""
    first = layouts[0]
    left_out = {LASZIP, *_COPC}
    if any(record.key in _COPC for lay in layouts for record in (*lay.vlrs, *lay.evlrs)):
        losses.add("the octree of COPC is not copied, all its points are")
    header = bytearray(first.header)
    vlrs, evlrs = list[Record](), list[tuple[Path, Record]]()
    own = reference.records_from
    replaced = own is None or any(lay.path != own for lay in layouts[:1])
    for lay in layouts:
        for record in lay.vlrs:
            if record.key in left_out or (record.user == PROJECTION and (replaced or lay is not first)):
                continue
            if lay is first or (record.key != EXTRA_BYTES and all(record.raw != other.raw for other in vlrs)):
                vlrs.append(record)
        for record in lay.evlrs:
            if record.key in left_out or (record.user == PROJECTION and (replaced or lay is not first)):
                continue
            evlrs.append((lay.path, record))
    if replaced:
        vlrs += [vlr(PROJECTION, number, data) for number, data in reference.las_records]
        if header[25] >= 4:
            flags = struct.unpack_from("<H", header, 6)[0]
            wkt = any(number == 2112 for number, _ in reference.las_records)
            struct.pack_into(
                "<H", header, 6, flags | _WKT_BIT if wkt else flags & ~_WKT_BIT if reference.las_records else flags
            )
    if common is not None:
        struct.pack_into("<3d", header, 131, *common[0].tolist())
        struct.pack_into("<3d", header, 155, *common[1].tolist())
        if len({lay.header[4:6] for lay in layouts}) > 1:
            struct.pack_into("<H", header, 4, 0)
        if len({lay.header[6] & 1 for lay in layouts}) > 1:
            losses.add(
                "the files count GPS time differently (seconds of the week, standard time); the values are copied as they are"
            )
    if first.waveforms and struct.unpack_from("<H", first.header, 6)[0] & 4:
        losses.add("waveforms are in a .wdp file beside the scan, which is not copied")
    return bytes(header), vlrs, evlrs
