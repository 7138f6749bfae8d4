"""The parts of a LAS file as bytes: header, variable-length records, and what follows the points.

laspy reads and writes these parts too, but normalises them.  A copy of a file keeps its bytes; only counts, bounds and places
are written anew (LAS specification 1.0 to 1.5).
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ....common.errors import InputError
from ....readers.scaled_values import scaled

LASZIP = ("laszip encoded", 22204)
EXTRA_BYTES = ("LASF_Spec", 4)
PROJECTION = "LASF_Projection"
WAVEFORM_PACKETS = ("LASF_Spec", 65535)
_VLR = struct.Struct("<H16sHH32s")
_EVLR = struct.Struct("<H16sHQ32s")
_WAVEFORM_FORMATS = (4, 5, 9, 10)
_COMPRESSED = 0x80
_BLOCK = 1 << 24
_MOST_LEGACY_CLASS = 31
"""Of point formats 0 to 5, which have 5 bits for a class and flags in the 3 above."""
"""Bytes copied at a time."""


@dataclass(frozen=True)
class Record:
    """A variable-length record.  raw: its header and data; of an extended one the header only.  place, length: of an extended
    record in its file, bytes, header included."""

    user: str
    number: int
    raw: bytes
    place: int = 0
    length: int = 0

    @property
    def key(self) -> tuple[str, int]:
        return self.user, self.number

    @property
    def data(self) -> bytes:
        return self.raw[_VLR.size :]

    @property
    def description(self) -> str:
        head = self.raw[: _EVLR.size if self.length else _VLR.size]
        return _text(head[-32:])


@dataclass(frozen=True)
class LasLayout:
    """header: the header's bytes, with those of later versions and of the user.  vlrs, evlrs: in file order; a waveform record
    of LAS 1.3, which is not counted there, is among ``evlrs``.  gap: bytes between the records and the points."""

    path: Path
    header: bytes
    vlrs: tuple[Record, ...]
    gap: bytes
    evlrs: tuple[Record, ...]

    @property
    def version(self) -> tuple[int, int]:
        return self.header[24], self.header[25]

    @property
    def point_format(self) -> int:
        return self.header[104] & 0x3F

    @property
    def length(self) -> int:
        """Bytes of a point record."""
        return struct.unpack_from("<H", self.header, 105)[0]

    @property
    def waveforms(self) -> bool:
        return self.point_format in _WAVEFORM_FORMATS

    @property
    def scales(self) -> np.ndarray:
        return np.array(struct.unpack_from("<3d", self.header, 131))

    @property
    def offsets(self) -> np.ndarray:
        return np.array(struct.unpack_from("<3d", self.header, 155))

    @property
    def extra_bytes(self) -> bytes:
        """The description of the extra dimensions."""
        return next((record.data for record in self.vlrs if record.key == EXTRA_BYTES), b"")

    @property
    def projection(self) -> tuple[Record, ...]:
        """The records that state the coordinate reference system."""
        return tuple(record for record in (*self.vlrs, *self.evlrs) if record.user == PROJECTION)


def read_layout(path: Path) -> LasLayout:
    """The layout of a file whose header viewer.readers.las.las_source has checked."""
    size = path.stat().st_size
    with path.open("rb") as file:
        head = file.read(100)
        header_size, offset = struct.unpack_from("<HI", head, 94)
        file.seek(0)
        start = file.read(offset)
        header, at, vlrs = start[:header_size], header_size, []
        for _ in range(struct.unpack_from("<I", header, 100)[0]):
            if at + _VLR.size > len(start):
                break
            _, user, number, length, _ = _VLR.unpack_from(start, at)
            if at + _VLR.size + length > len(start):
                break
            vlrs.append(Record(_text(user), number, start[at : at + _VLR.size + length]))
            at += _VLR.size + length
        return LasLayout(path, header, tuple(vlrs), start[at:], tuple(_evlrs(file, header, size)))


def _evlrs(file: BinaryIO, header: bytes, size: int) -> Iterator[Record]:
    places = set()
    if header[25] >= 4 and len(header) >= 247:
        place, count = struct.unpack_from("<QI", header, 235)
        for _ in range(count):
            if (record := _extended(file, place, size)) is None:
                break
            places.add(place)
            yield record
            place += record.length
    if header[25] >= 3 and len(header) >= 235:
        place = struct.unpack_from("<Q", header, 227)[0]
        if place and place not in places and (record := _extended(file, place, size)) and record.key == WAVEFORM_PACKETS:
            yield record


def _extended(file: BinaryIO, place: int, size: int) -> Record | None:
    file.seek(min(place, size))
    raw = file.read(_EVLR.size)
    if len(raw) < _EVLR.size:
        return None
    _, user, number, length, _ = _EVLR.unpack(raw)
    return Record(_text(user), number, raw, place, _EVLR.size + length) if place + _EVLR.size + length <= size else None


def _text(raw: bytes) -> str:
    return raw.split(b"\0")[0].decode("latin-1")


def vlr(user: str, number: int, data: bytes, description: str = "") -> Record:
    """A new variable-length record.  data: at most 65535 bytes."""
    head = _VLR.pack(0, user.encode("latin-1"), number, len(data), description.encode("latin-1", "replace")[:32])
    return Record(user, number, head + data)


def copy_extended(record: Record, source: Path, out: BinaryIO) -> None:
    """Writes an extended record, a block at a time."""
    with source.open("rb") as file:
        file.seek(record.place)
        left = record.length
        while left:
            block = file.read(min(left, _BLOCK))
            if not block:
                raise OSError(f"{source}: ends within a record")
            out.write(block)
            left -= len(block)


def with_classes(records: np.ndarray, classes: np.ndarray, layout: LasLayout) -> np.ndarray:
    """Records, a structured array, with other classes, (n,) uint8; flags beside them stay.  Raises InputError where the point
    format has no such class."""
    made = records.copy()
    if "classification_flags" in (records.dtype.names or ()):  # point formats 6 to 10
        made["classification"] = classes
        return made
    if (most := int(classes.max(initial=0))) > _MOST_LEGACY_CLASS:
        raise InputError(f"point format {layout.point_format} has classes 0 to {_MOST_LEGACY_CLASS}, a region was given class "
                         f"{most}", file=layout.path, remedy="give it another class, or export to PLY")
    made["raw_classification"] = records["raw_classification"] & ~np.uint8(_MOST_LEGACY_CLASS) | classes
    return made


@dataclass
class Tally:
    """What a header states of its points.  returns: (16,) number of points by return.  low, high: (3,) whole numbers."""

    count: int
    returns: np.ndarray
    low: np.ndarray
    high: np.ndarray

    @staticmethod
    def empty() -> "Tally":
        return Tally(0, np.zeros(16, np.int64), np.full(3, 2**31 - 1, np.int64), np.full(3, -(2**31), np.int64))

    def add(self, points: np.ndarray) -> None:
        """points: structured array of LAS records."""
        if len(points) == 0:
            return
        bits = points["bit_fields"] & (15 if "classification_flags" in (points.dtype.names or ()) else 7)
        self.returns += np.bincount(bits, minlength=16)[:16]
        for axis, name in enumerate("XYZ"):
            self.low[axis] = min(self.low[axis], int(points[name].min()))
            self.high[axis] = max(self.high[axis], int(points[name].max()))
        self.count += len(points)


def patched(header: bytes, tally: Tally, *, offset: int, vlrs: int, compressed: bool, evlrs: tuple[int, int],
            waveforms: int) -> bytes:  # fmt: skip
    """The header with counts, bounds and places of a new file.

    Bounds that differ from those in ``header`` by less than a step keep its spelling.  offset: byte at which the points begin.
    evlrs: place and number of extended records.  waveforms: place of the waveform record, 0 where there is none.
    """
    made = bytearray(header)
    minor, point_format = made[25], made[104] & 0x3F
    struct.pack_into("<II", made, 96, offset, vlrs)
    made[104] = point_format | (_COMPRESSED if compressed else 0)
    legacy = tally.count if (minor < 4 or point_format < 6) and tally.count < 2**32 else 0
    returns = [int(n) for n in tally.returns[1:]]
    struct.pack_into("<6I", made, 107, legacy, *(returns[:5] if legacy else [0] * 5))
    scales, offsets = (np.array(struct.unpack_from("<3d", made, at)) for at in (131, 155))
    if tally.count:
        bounds = scaled(np.stack([tally.high, tally.low], axis=1), scales[:, None], offsets[:, None])
        stated = np.array(struct.unpack_from("<6d", made, 179)).reshape(3, 2)
        with np.errstate(invalid="ignore"):
            same = np.abs(bounds - stated) < np.abs(scales[:, None])
        struct.pack_into("<6d", made, 179, *np.where(same, stated, bounds).ravel().tolist())
    else:
        struct.pack_into("<6d", made, 179, *([0.0] * 6))
    if minor >= 3 and len(made) >= 235:
        struct.pack_into("<Q", made, 227, waveforms)
    if minor >= 4 and len(made) >= 375:
        struct.pack_into("<QIQ15Q", made, 235, *(evlrs if evlrs[1] else (0, 0)), tally.count, *returns)
    return bytes(made)
