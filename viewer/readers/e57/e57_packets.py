"""Points from the middle of an E57, for previews: libe57 reads a scan from its beginning only.

After the standard (ASTM E2807): the points of a scan are a CompressedVector, a section of data packets.  Every packet holds a
piece of one bytestream per field.  Integers are packed into the fewest bits that hold their declared range, least significant
bit first, so that the bytes before a packet tell which point a stream is at.  The headers of the packets, one every 64 KiB, are
read first; then only the packets that hold the wanted points.  The checksums of the pages are left to the complete read.
Offsets are logical: they count 1020 of the 1024 bytes of a page.
"""

import struct
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...common.errors import InputError
from ..scaled_values import scaled

PAGE, PAGE_DATA = 1024, 1020
"""Bytes of a page and of the data in it, by the standard; the rest is a checksum."""
_SECTION = struct.Struct("<B7xQQQ")  # kind, length, physical offset of the data packets, of the index
_PACKET = struct.Struct("<BBHH")  # kind, flags, length - 1, number of bytestreams
_PACKET_KINDS = (0, 1, 2)  # index, data, empty
_DATA_PACKET, _VECTOR_SECTION = 1, 1
_MOST_BITS = 57  # of a value: 8 bytes read at once hold 57 bits from any bit of the first byte on
_FLOATS = {"single": ("<f4", 32), "double": ("<f8", 64)}


class UnknownPacking(Exception):
    """The points are packed in a way that this module does not decode; libe57 may."""


@dataclass(frozen=True)
class Field:
    """A field of the points.  bits: of a value, 0 where all are equal.  dtype: of floats, None of integers.

    An integer's value is (stored + minimum) * scale + offset.
    """

    name: str
    bits: int
    dtype: str | None = None
    minimum: int = 0
    scale: float = 1.0
    offset: float = 0.0


class PacketReader:
    """The points of one scan.  file: opened, and kept open by the caller.  vector: the ``points`` element in the file's XML.

    Raises UnknownPacking, and InputError where the packets cannot be followed.
    """

    def __init__(self, path: Path, file: BinaryIO, vector: ElementTree.Element):
        self._path, self._file, self._size = path, file, path.stat().st_size
        prototype = vector.find("{*}prototype")
        if prototype is None:
            raise UnknownPacking("no prototype")
        self.fields = [_field(node) for node in prototype]
        self.count = _whole(vector, "recordCount", 0)
        if self.count > most_points(self._size, sum(field.bits for field in self.fields)):
            raise self._damaged(f"{self.count:,} points do not fit into its {self._size:,} bytes")
        self._places, self._before = self._packets(_whole(vector, "fileOffset", 0))

    def _packets(self, section: int) -> tuple[np.ndarray, np.ndarray]:
        """(P, S) int64 logical offset of each stream's piece in each packet, and (P + 1, S) bytes of the stream before it."""
        kind, length, data, _ = _SECTION.unpack(self._bytes(_logical(section), _SECTION.size))
        at, end = _logical(data), _logical(section) + length
        if kind != _VECTOR_SECTION:
            raise self._damaged(f"byte {section:,} does not begin a CompressedVector")
        places, sizes, streams = [], [], len(self.fields)
        lengths = struct.Struct(f"<{streams}H")
        while at < end:
            kind, _, last, number = _PACKET.unpack(self._bytes(at, _PACKET.size))
            if kind not in _PACKET_KINDS or (last + 1) % 4:
                raise self._damaged(f"no packet begins at byte {at:,}")
            if kind == _DATA_PACKET:
                if number != streams:
                    raise self._damaged(f"a data packet has {number} bytestreams, the points {streams} fields")
                pieces = lengths.unpack(self._bytes(at + _PACKET.size, lengths.size))
                places.append(at + _PACKET.size + lengths.size)
                sizes.append(pieces)
            at += last + 1
        held = np.array(sizes, np.int64).reshape(-1, streams)
        before = np.concatenate([np.zeros((1, streams), np.int64), held.cumsum(axis=0)])
        within = np.concatenate([np.zeros((len(held), 1), np.int64), held[:, :-1].cumsum(axis=1)], axis=1)
        return np.array(places, np.int64)[:, None] + within, before

    def read(self, start: int, count: int, names: list[str]) -> dict[str, np.ndarray]:
        """Scaled values (n,) float64 of fields of points start to start + n, n the lesser of ``count`` and what is there."""
        count = max(0, min(count, self.count - start))
        streams = {field.name: (number, field) for number, field in enumerate(self.fields)}
        return {name: self._values(*streams[name], start, count) for name in names}

    def _values(self, stream: int, field: Field, start: int, count: int) -> np.ndarray:
        if field.bits == 0:
            return np.full(count, field.minimum * field.scale + field.offset)
        first, stop = start * field.bits // 8, -(-(start + count) * field.bits // 8)
        data = self._stream(stream, first, stop)
        if field.dtype:
            with np.errstate(invalid="ignore"):  # damaged files hold signalling NaN
                return np.frombuffer(data, field.dtype, count).astype(np.float64)
        padded = np.frombuffer(data + bytes(8), np.uint8)
        words = np.ndarray((len(data) + 1,), "<u8", padded, strides=(1,))  # overlapping: the 8 bytes from every byte on
        bits = np.arange(count, dtype=np.int64) * field.bits + (start * field.bits - first * 8)
        raw = words[bits >> 3] >> (bits & 7).astype(np.uint64) & np.uint64((1 << field.bits) - 1)
        return scaled(raw.astype(np.int64) + field.minimum, field.scale, field.offset)

    def _stream(self, stream: int, first: int, stop: int) -> bytes:
        """Bytes first to stop of a bytestream."""
        before = self._before[:, stream]
        if stop > before[-1]:
            raise self._damaged(f"bytestream {stream + 1} has {before[-1]:,} bytes, {stop:,} are needed")
        packet, parts = int(np.searchsorted(before, first, side="right")) - 1, []
        while first < stop:
            end = min(stop, int(before[packet + 1]))
            parts.append(self._bytes(int(self._places[packet, stream]) + first - int(before[packet]), end - first))
            first, packet = end, packet + 1
        return b"".join(parts)

    def _bytes(self, place: int, length: int) -> bytes:
        first, last = place // PAGE_DATA, (place + length - 1) // PAGE_DATA
        if first * PAGE >= self._size:
            raise self._damaged(f"byte {place:,} of its points is behind the end of the file")
        self._file.seek(first * PAGE)
        pages = self._file.read((last + 1 - first) * PAGE)
        if len(pages) < (last + 1 - first) * PAGE:
            raise self._damaged(f"its points end behind the end of the file, at page {last:,}")
        at = place - first * PAGE_DATA
        data = pages if last == first else np.frombuffer(pages, np.uint8).reshape(-1, PAGE)[:, :PAGE_DATA].tobytes()
        return data[at : at + length]

    def _damaged(self, what: str) -> InputError:
        return InputError(f"damaged: {what}", file=self._path, remedy="copy or export it again")


def most_points(size: int, bits: int) -> int:
    """Points of so many bits that a file of ``size`` bytes can hold.  Points of 0 bits, all of whose values are equal, count
    as one bit, so that a small file cannot state any number."""
    return 8 * size // max(bits, 1)


def _logical(physical: int) -> int:
    return physical // PAGE * PAGE_DATA + physical % PAGE


def bits_of(node: ElementTree.Element) -> int:
    """Bits of a value of the field that an element of the prototype declares; 0 where its size is not known."""
    try:
        return _field(node).bits
    except UnknownPacking:
        return 0


def _field(node: ElementTree.Element) -> Field:
    """The field that an element of the prototype declares.  Raises UnknownPacking for strings, structures and wide integers."""
    name, kind = node.tag.rpartition("}")[2], node.get("type")
    precision = node.get("precision", "double")
    if kind == "Float" and precision in _FLOATS:
        dtype, bits = _FLOATS[precision]
        return Field(name, bits, dtype)
    if kind not in ("Integer", "ScaledInteger"):
        raise UnknownPacking(f"{name} is a {precision} {kind}")
    low, high = _whole(node, "minimum", -(2**63)), _whole(node, "maximum", 2**63 - 1)
    bits = (high - low).bit_length()
    if low > high or bits > _MOST_BITS or max(abs(low), abs(high)) >= 2**62:
        raise UnknownPacking(f"{name} goes from {low} to {high}")
    if kind == "Integer":
        return Field(name, bits, None, low)
    try:
        return Field(name, bits, None, low, float(node.get("scale", 1)), float(node.get("offset", 0)))
    except ValueError:
        raise UnknownPacking(f"{name} has no usable scale and offset") from None


def _whole(node: ElementTree.Element, name: str, default: int) -> int:
    """An attribute that holds a whole number."""
    try:
        return int(node.get(name, default))
    except ValueError:
        raise UnknownPacking(f"{name} is {node.get(name, '')[:20]!a}") from None
