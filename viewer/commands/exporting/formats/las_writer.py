"""Columns to LAS 1.4 or LAZ: coordinates as decimal numbers of the source's resolution, further columns as dimensions.

A column that fits a standard dimension of LAS becomes that one; others become extra dimensions with their own type.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..columns import FULL, Column, Piece, Stream, Survey
from ..crs_records import Reference
from ..losses import Losses
from ..output_file import output_file
from .las_layout import PROJECTION, Record

_REACH = 2**31 - 8
"""Largest whole number of a LAS coordinate, with room for rounding."""
_FEWEST, _FLOAT32 = 3, 2.0**-24
"""Decimals of a coordinate at least; relative resolution of single-precision coordinates."""
_FULL_METRES, _FULL_DEGREES = 7, 9
"""Decimals for coordinates that use all digits of double precision: a tenth of a micrometre, a tenth of a millimetre on the
Earth's surface."""
_STANDARD = {
    "intensity": (0, 65535), "return_number": (0, 15), "number_of_returns": (0, 15), "synthetic": (0, 1), "key_point": (0, 1),
    "withheld": (0, 1), "overlap": (0, 1), "scanner_channel": (0, 3), "scan_direction_flag": (0, 1),
    "edge_of_flight_line": (0, 1), "classification": (0, 255), "user_data": (0, 255), "scan_angle": (-32768, 32767),
    "point_source_id": (0, 65535),
}  # fmt: skip
"""Dimensions of point formats 6 to 8 that hold whole numbers, and their ranges."""
_WAVEFORM = ("wavepacket_index", "wavepacket_offset", "wavepacket_size", "return_point_wave_location", "x_t", "y_t", "z_t")
_ANGLE_STEP = 0.006
"""Degrees of a step of ``scan_angle``; ``scan_angle_rank`` of earlier formats is in degrees."""
_WIDEST = 3
"""Values of an extra dimension, at most."""
_LONGEST = 32
"""Bytes of a dimension's name."""
_SPELLINGS = {
    "gpstime": "gps_time", "time": "gps_time", "timegps": "gps_time", "scalargpstime": "gps_time",
    **{name.replace("_", ""): name for name in _STANDARD if name != "scan_angle"},
}  # fmt: skip
"""Dimension by the spelling of a column's name in other formats: lower case, letters and digits only."""


def write_las(path: Path, stream: Stream, found: Survey, reference: Reference, losses: Losses, *, precision: float,
              degrees: bool = False, standard_time: bool = False, records: Sequence[Record] = ()) -> None:  # fmt: skip
    """LAS 1.4 or, by the suffix, LAZ.  precision: relative resolution of the source's coordinates.  standard_time: see
    has_standard_time.  records: variable-length records besides those of the reference system and of the points."""
    import laspy

    scales, offsets = coordinate_steps(found, precision, degrees, losses)
    plan = _Plan(found, losses)
    header = laspy.LasHeader(point_format=8 if "nir" in plan.standard else 7 if found.coloured else 6, version="1.4")
    header.scales, header.offsets = scales, offsets
    header.generating_software = "pointglass"
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType(int(standard_time))
    for name, data in reference.las_records:
        header.vlrs.append(laspy.VLR(PROJECTION, name, record_data=data))
        header.global_encoding.wkt |= name == 2112
    header.vlrs.extend(laspy.VLR(record.user, record.number, record.description, record.data) for record in records)
    for name, column in plan.extra.items():
        kind = f"{column.width}{column.dtype.str[1:]}" if column.width > 1 else column.dtype
        header.add_extra_dim(laspy.ExtraBytesParams(name, kind, description=plan.descriptions.get(name, "")))
    compressed = path.suffix.lower() == ".laz"
    with output_file(path) as file, laspy.open(file, mode="w", header=header, closefd=False, do_compress=compressed) as writer:
        for piece in stream.pieces("writing"):
            points = laspy.ScaleAwarePointRecord.zeros(len(piece.xyz), header=header)
            for axis, name in enumerate("XYZ"):
                points[name] = np.rint((piece.xyz[:, axis] - offsets[axis]) / scales[axis]).astype(np.int32)
            if found.coloured:
                points.red, points.green, points.blue = found.colours16(piece).T
            plan.fill(points, piece)
            writer.write_points(points)


def has_standard_time(paths: list[Path]) -> bool:
    """Whether the times of the LAS files among these are adjusted standard GPS time, and not seconds of a week."""
    heads = []
    for path in paths:
        if path.is_file():
            with path.open("rb") as file:
                heads.append(file.read(8))
    flags = [head[6] & 1 for head in heads if head.startswith(b"LASF")]
    return bool(flags) and all(flags)


def coordinate_steps(found: Survey, precision: float, degrees: bool, losses: Losses) -> tuple[np.ndarray, np.ndarray]:
    """(scales, offsets), (3,) each: powers of ten that hold the coordinates' decimals, or the finest that 32 bits reach."""
    scales, offsets, rounded, cut = np.empty(3), np.empty(3), 0.0, 0.0
    for axis in range(3):
        low, high = float(found.low[axis]), float(found.high[axis])
        digits = max(int(found.decimals[axis]), _FEWEST)
        if digits >= FULL:
            digits = _FULL_DEGREES if degrees else _FULL_METRES
            if precision >= _FLOAT32:  # the source whose values are smallest has the finest ones
                near = min((largest[axis] for largest in found.full.values() if largest[axis]), default=0.0)
                digits = int(np.ceil(-np.log10(max(near, 1e-6) * _FLOAT32))) + 1
            else:  # more digits than steps of LAS are usefully made for
                cut = 10.0**-digits
        digits = max(min(digits, 12), 0)
        wanted = digits
        while not _reaches(low, high, digits):
            digits -= 1
        if digits < wanted:
            rounded = max(rounded, 10.0**-digits)
        scales[axis], offsets[axis] = float(f"1e{-digits}"), _offset(low, high, digits)
    if rounded:
        losses.add(f"coordinates are rounded to {rounded:g}, the finest step with which 32 bits reach so far")
    elif cut:
        losses.add(f"coordinates are rounded to {cut:g}")
    return scales, offsets


def _offset(low: float, high: float, digits: int) -> float:
    near = np.floor(low)
    if (high - near) * 10.0**digits <= _REACH:
        return float(near)
    return float(np.rint((low + high) / 2))


def _reaches(low: float, high: float, digits: int) -> bool:
    offset = _offset(low, high, digits)
    return max(high - offset, offset - low) * 10.0**digits <= _REACH


class _Plan:
    """Which column becomes which dimension."""

    def __init__(self, found: Survey, losses: Losses):
        self.standard: dict[str, str] = {}  # dimension -> column
        self.extra: dict[str, Column] = {}
        self._extra_of: dict[str, tuple[str, int | None]] = {}  # dimension -> column, and one of its values or None
        self.descriptions: dict[str, str] = {}
        self._stretch: tuple[float, float] | None = None
        columns = dict(found.columns)
        for name in _WAVEFORM:  # without the waveforms they say nothing
            columns.pop(name, None)
        self._ranks = columns.pop("scan_angle_rank", None) is not None
        own = _spelled(columns)
        if (name := own.get("gps_time")) is not None and columns[name].width == 1:
            self.standard["gps_time"] = name
            del columns[name]
        if "nir" in columns and columns["nir"].fits(0, 65535) and found.coloured:
            self.standard["nir"] = "nir"
            del columns["nir"]
        for dimension, (low, high) in _STANDARD.items():
            name = own.get(dimension)
            if name is not None and columns[name].fits(low, high):
                self.standard[dimension] = name
                del columns[name]
        self._numbered = self._needs_numbers(found, columns)
        for name, column in columns.items():
            for element in range(column.width) if column.width > _WIDEST else [None]:
                self._add_extra(name, column, element)
        if (column := columns.get("intensity")) is not None and column.high >= column.low:
            low, high = self._stretch = (0.0, 1.0) if column.shares else (column.low, column.high)
            step = (high - low) / 65535
            losses.add(
                f"intensities {column.low:g} to {column.high:g} are no whole numbers of 16 bits: they are kept in the extra "
                f"dimension {next(made for made, of in self._extra_of.items() if of[0] == 'intensity')}, and the standard one "
                f"holds (intensity - {low:g}) / {step:g}"
            )

    def _needs_numbers(self, found: Survey, columns: dict[str, Column]) -> bool:
        """Whether the number of the scan becomes the point source id: no source has such ids, or all of them are 0 and there
        are several scans."""
        column = found.columns.get(self.standard.get("point_source_id", "point_source_id"))
        if "point_source_id" in columns:
            return False  # kept as an extra dimension
        return max(found.counts, default=0) < 65535 and (column is None or (column.high <= 0 and len(found.counts) > 1))

    def _add_extra(self, column_name: str, column: Column, element: int | None) -> None:
        """element: one value of a column that is too wide for a dimension; None: the column."""
        name = (column_name if element is None else f"{column_name}_{element}").replace(":", "_")  # laspy writes no colons
        taken = {known.lower() for known in (*_STANDARD, *self.extra, "x", "y", "z", "gps_time", "red", "green", "blue", "nir")}
        made = name if name.lower() not in taken else f"{name}_value"
        made, number = _cut(made, ""), 1
        while made.lower() in taken:
            number += 1
            made = _cut(name, f"_{number}")
        dtype = column.dtype
        if dtype.kind not in "iuf":
            dtype = np.dtype(np.uint8)
        if dtype == np.float16:
            dtype = np.dtype(np.float32)
        if dtype.itemsize > 8:
            dtype = np.dtype(np.float64)
        self.extra[made] = Column(dtype, column.width if element is None else 1)
        self._extra_of[made] = column_name, element
        if made != name:
            self.descriptions[made] = name.encode()[:_LONGEST].decode("utf-8", "ignore")

    def fill(self, points: Any, piece: Piece) -> None:
        """Sets the dimensions of a piece."""
        for name, column in self.standard.items():
            if column in piece.columns:
                values = piece.columns[column]
                whole = name != "gps_time" and values.dtype.kind == "f"  # of text; packed dimensions take no fractions
                points[name] = np.rint(values).astype(np.int64) if whole else values
        for name, (column, element) in self._extra_of.items():
            if column in piece.columns:
                values = piece.columns[column]
                points[name] = values if element is None else values[:, element]
            elif self.extra[name].dtype.kind == "f":  # of another file
                width = self.extra[name].width
                points[name] = np.full(len(piece.xyz) if width == 1 else (len(piece.xyz), width), np.nan)
        if self._ranks and "scan_angle_rank" in piece.columns:
            points["scan_angle"] = np.rint(piece.columns["scan_angle_rank"] / _ANGLE_STEP).astype(np.int16)
        if self._numbered:
            points["point_source_id"] = piece.scan + 1
        ones = np.ones(len(piece.xyz), np.uint8)
        for name in ("return_number", "number_of_returns"):
            if self.standard.get(name, name) not in piece.columns:
                points[name] = ones
        if self._stretch is not None and "intensity" in piece.columns:
            low, high = self._stretch
            share = (np.asarray(piece.columns["intensity"], np.float64) - low) / ((high - low) or 1.0)
            points["intensity"] = np.rint(np.nan_to_num(np.clip(share, 0, 1), nan=0.0) * 65535).astype(np.uint16)


def _spelled(columns: dict[str, Column]) -> dict[str, str]:
    """Standard dimension -> the column that its name means; the one with its own name first."""
    found = {}
    for name in columns:
        dimension = _SPELLINGS.get("".join(c for c in name.lower() if c.isalnum()))
        if dimension is not None and dimension not in columns:
            found.setdefault(dimension, name)
    return found | {name: name for name in (*_STANDARD, "gps_time") if name in columns}


def _cut(name: str, ending: str) -> str:
    """A name of at most _LONGEST bytes."""
    return name.encode()[: _LONGEST - len(ending)].decode("utf-8", "ignore") + ending
