"""Records of E57 as the file stores them: every field of a scan's points, raw, through libe57.

pye57's buffers take 64-bit integers only as ``longlong``: NumPy's int64, of the same size, is read as if it had 32 bits.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..scaled_values import scaled
from .e57_nodes import is_number, library

BLOCK = 1 << 18
"""Records read at a time: 30 fields take 63 MB as float64."""
PIECE = 1 << 16
"""Records read at a time where one column is wanted."""
OWN = "pg"
"""Prefix of the extension in which pointglass writes columns for which E57 has no field; they are read by their own names."""
_COORDINATES = ("cartesianX", "cartesianY", "cartesianZ", "sphericalRange", "sphericalAzimuth", "sphericalElevation")
_PLACED = (*_COORDINATES, "cartesianInvalidState", "sphericalInvalidState", "colorRed", "colorGreen", "colorBlue",
           "isColorInvalid", "isIntensityInvalid")  # fmt: skip
"""Fields that are in ``Records.xyz`` and ``Records.rgb``, or say that a value is missing."""
_INTEGERS = (np.uint8, np.int8, np.uint16, np.int16, np.uint32, np.int32)


@dataclass(frozen=True)
class RawField:
    """name: path within the prototype.  dtype: of the stored values.  scale, offset: of scaled integers, else None.
    kind: the smallest type that holds the values."""

    name: str
    dtype: np.dtype
    kind: np.dtype
    scale: float | None = None
    offset: float = 0.0

    def scaled(self, raw: np.ndarray) -> np.ndarray:
        """The values that ``raw`` stands for, in the smallest type that holds them."""
        return raw.astype(self.kind) if self.scale is None else scaled(raw, self.scale, self.offset)


def fields_of(structure, prefix: str = "", only: str | None = None) -> tuple[list[RawField], list[str]]:
    """The numeric leaves of a prototype, and the paths of its other leaves (texts, which pye57 does not read).
    only: the one column that is wanted, besides what places and colours a record."""
    libe57 = library()
    found: list[RawField] = []
    others: list[str] = []
    for index in range(structure.childCount()):
        node = structure[index]
        name = prefix + node.elementName()
        if isinstance(node, libe57.StructureNode):
            inner, more = fields_of(node, f"{name}/", only)
            found += inner
            others += more
        elif is_number(node) and (only is None or name in _PLACED or name.removeprefix(f"{OWN}:") == only):
            found.append(_field(libe57, name, node))
        else:
            others.append(name)
    return found, others


def _field(libe57: Any, name: str, node) -> RawField:
    if isinstance(node, libe57.FloatNode):
        dtype = np.dtype(np.float32 if node.precision() == libe57.E57_SINGLE else np.float64)
        return RawField(name, dtype, dtype)
    if isinstance(node, libe57.ScaledIntegerNode):
        return RawField(name, np.dtype(np.longlong), np.dtype(np.float64), float(node.scale()), float(node.offset()))
    low, high = node.minimum(), node.maximum()
    kind = next((k for k in _INTEGERS if np.iinfo(k).min <= low and high <= np.iinfo(k).max), np.int64)
    return RawField(name, np.dtype(np.longlong), np.dtype(kind))


def buffers_of(file, fields: list[RawField], arrays: dict[str, np.ndarray], capacity: int):
    """libe57's buffers over ``arrays``, for reading from or writing to ``file`` without conversion or scaling."""
    libe57 = library()
    buffers = libe57.VectorSourceDestBuffer()
    for field in fields:
        buffers.append(libe57.SourceDestBuffer(file, field.name, arrays[field.name], capacity, False, False))
    return buffers


def arrays_for(fields: list[RawField], capacity: int) -> dict[str, np.ndarray]:
    return {field.name: np.empty(capacity, field.dtype) for field in fields}


def raw_blocks(file, points, fields: list[RawField], arrays: dict[str, np.ndarray]) -> Iterator[int]:
    """Fills ``arrays`` with the records of a CompressedVector, block by block; yields how many.  Ends early where the file is
    truncated."""
    reader = points.reader(buffers_of(file, fields, arrays, len(next(iter(arrays.values())))))
    try:
        while n := reader.read():
            yield n
    finally:
        if reader.isOpen():
            reader.close()


def raw_records(file, number: int, count: int, only: str | None) -> Iterator[tuple[int, list[RawField], dict[str, np.ndarray]]]:
    """Yields blocks of the ``count`` records of a scan: how many, their fields, and these as stored.  only: as in fields_of."""
    points = file.root()["data3D"][number]["points"]
    fields, _ = fields_of(library().StructureNode(points.prototype()), only=only)
    arrays = arrays_for(fields, min(BLOCK if only is None else PIECE, count))
    for n in raw_blocks(file, points, fields, arrays):
        yield n, fields, {name: values[:n] for name, values in arrays.items()}


def columns_of(fields: list[RawField], raw: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Columns of valid records for ``Records``: fields besides coordinates and colour; NaN where an intensity is marked as
    invalid."""
    columns = {field.name.removeprefix(f"{OWN}:"): field.scaled(raw[field.name]) for field in fields
               if field.name not in _PLACED}  # fmt: skip
    missing = raw.get("isIntensityInvalid")
    if missing is not None and "intensity" in columns and missing.any():
        values = columns["intensity"].astype(np.float32 if columns["intensity"].dtype.itemsize <= 4 else np.float64)
        values[missing != 0] = np.nan
        columns["intensity"] = values
    return columns
