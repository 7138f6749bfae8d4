"""The header of a PCD file: the fields of its points, their number, and how they are stored."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...common.errors import InputError
from ...common.text import whole_number
from ..source import LONGEST_HEADER_LINE

_KINDS = {"F": (4, 8), "U": (1, 2, 4, 8), "I": (1, 2, 4, 8)}
_DATA = ("ascii", "binary", "binary_compressed")
_MOST_LINES = 100  # of a header: ten entries, and comments
_MOST_VALUES = 1 << 16  # of one field: over thirty times PCL's longest descriptor, ShapeContext1980


@dataclass(frozen=True)
class Field:
    """``count`` values of ``type``, NumPy's, without byte order."""

    name: str
    type: str
    count: int


@dataclass(frozen=True)
class Header:
    """dtype: of one point in the binary form, without names for padding.  offset: byte at which the points begin.
    lines: of text before them.  viewpoint: position x, y, z and quaternion w, x, y, z; None where there is none."""

    fields: tuple[Field, ...]
    points: int
    data: str
    dtype: np.dtype
    offset: int
    lines: int
    viewpoint: tuple[float, ...] | None


def read_header(path: Path, file: BinaryIO) -> Header:
    """Reads up to and including the DATA line.  Raises InputError naming the first line that is not valid."""
    stated: dict[str, list[str]] = {}
    for number in range(1, _MOST_LINES):
        line = file.readline(LONGEST_HEADER_LINE)
        if not line.endswith(b"\n"):
            raise InputError(f"truncated in its header (line {number})", file=path, remedy="copy or export it again")
        words = line.decode("latin-1").split()
        if not words or words[0].startswith("#"):
            continue
        stated[words[0].upper()] = words[1:]
        if words[0].upper() == "DATA":
            return _header(path, stated, file.tell(), number)
    raise InputError("PCD header without a DATA line", file=path, remedy="export it again")


def _header(path: Path, stated: dict[str, list[str]], offset: int, lines: int) -> Header:
    names = [name.lower() for name in stated.get("FIELDS", stated.get("COLUMNS", []))]
    if not names:
        raise InputError("PCD header without FIELDS", file=path, remedy="export it again")
    sizes, kinds = stated.get("SIZE", ["4"] * len(names)), stated.get("TYPE", ["F"] * len(names))  # defaults of version 0.5
    counts = stated.get("COUNT", ["1"] * len(names))
    fields: list[Field] = []
    for i, name in enumerate(names):
        try:
            size, kind, count = whole_number(sizes[i]), kinds[i].upper(), whole_number(counts[i])
        except IndexError:
            raise InputError(f"its header has no SIZE, TYPE or COUNT for field {name!r}", file=path,
                             remedy="export it again") from None
        if size not in _KINDS.get(kind, ()) or count is None or count > _MOST_VALUES:
            shown = ascii(f"SIZE {sizes[i]} TYPE {kinds[i]} COUNT {counts[i]}"[:60])
            raise InputError(f"field {name!r} cannot be of {shown}; the header is damaged, export it again", file=path)
        if count:  # drivers write padding of no bytes
            fields.append(Field(name, f"{kind.lower()}{size}", count))
    points = _points(path, stated)
    data = (stated["DATA"] or [""])[0].lower()
    if data not in _DATA:
        raise InputError(f"DATA {data[:30]!a} is not known", file=path, remedy=f"save it as one of {', '.join(_DATA)}")
    unlike = dict.fromkeys(field.name for field in fields if field.name != "_")
    if sum(field.name != "_" for field in fields) != len(unlike):
        raise InputError(f"its header names a field twice ({', '.join(names)[:80]})", file=path, remedy="export it again")
    return Header(tuple(fields), points, data, _dtype(fields), offset, lines, _viewpoint(stated.get("VIEWPOINT")))


def _points(path: Path, stated: dict[str, list[str]]) -> int:
    """POINTS, or in older files WIDTH times HEIGHT; both must agree."""
    numbers = {key: whole_number(" ".join(stated[key])) for key in ("POINTS", "WIDTH", "HEIGHT") if key in stated}
    if wrong := next((key for key, value in numbers.items() if value is None), None):
        shown = ascii(" ".join(stated[wrong])[:30])
        raise InputError(f"{wrong} {shown} is not a whole number; its header is damaged, export it again", file=path)
    found = {key: value for key, value in numbers.items() if value is not None}
    size = found["WIDTH"] * found.get("HEIGHT", 1) if "WIDTH" in found else None
    points = found.get("POINTS", size)
    if points is None:
        raise InputError("PCD header without POINTS", file=path, remedy="export it again")
    if size is not None and size != points:
        raise InputError(f"POINTS {points:,} is not WIDTH times HEIGHT, {size:,}; its header is damaged, export again",
                         file=path)
    return points


def _dtype(fields: list[Field]) -> np.dtype:
    offsets, at = [], 0
    for field in fields:
        offsets.append(at)
        at += int(field.type[1]) * field.count
    kept = [(field, offset) for field, offset in zip(fields, offsets) if field.name != "_"]
    formats = [f"({field.count},)<{field.type}" if field.count > 1 else f"<{field.type}" for field, _ in kept]
    return np.dtype({"names": [field.name for field, _ in kept], "formats": formats, "offsets": [offset for _, offset in kept],
                     "itemsize": at})  # fmt: skip


def _viewpoint(words: list[str] | None) -> tuple[float, ...] | None:
    try:
        found = tuple(float(word) for word in words or ())
    except ValueError:
        return None
    return found if len(found) == 7 and all(map(math.isfinite, found)) else None
