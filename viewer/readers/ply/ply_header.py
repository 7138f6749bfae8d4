"""The header of a PLY file: its elements, and the properties of a row of each."""

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ...common.errors import InputError
from ...common.text import whole_number
from ..source import LONGEST_HEADER_LINE

TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "long": "i8", "ulong": "u8",
    "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "int64": "i8",
    "uint64": "u8", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_MOST_LINES = 10_000  # of a header: over a hundred times those of Gaussian splats, which have 62 properties


@dataclass(frozen=True)
class Property:
    """One value of a row, or with ``length_type`` a list of values.  Types are NumPy's, without byte order."""

    name: str
    type: str
    length_type: str | None = None


@dataclass(frozen=True)
class Element:
    """``count`` rows of ``properties``."""

    name: str
    count: int
    properties: tuple[Property, ...]

    @property
    def has_lists(self) -> bool:
        return any(p.length_type for p in self.properties)


@dataclass(frozen=True)
class Header:
    """order: "<", ">" or "" for ascii.  data: byte at which the first element begins.  comments: their texts."""

    order: str
    elements: tuple[Element, ...]
    data: int
    comments: tuple[str, ...] = ()


def read_header(path: Path, file: BinaryIO) -> Header:
    """Reads up to and including ``end_header``.  Raises InputError naming the first line that is not valid."""
    order: str | None = None
    elements: list[tuple[str, int, list[Property]]] = []
    comments: list[str] = []
    for number in range(1, _MOST_LINES):
        line = file.readline(LONGEST_HEADER_LINE)
        if not line.endswith(b"\n"):
            raise InputError(f"truncated in its header (line {number})", file=path, remedy="copy or export it again")
        words = line.decode("latin-1").split()
        match words:
            case ["ply"] if number == 1:
                pass
            case ["comment", *_]:
                comments.append(line.decode("latin-1").strip()[len("comment") :].strip())
            case [] | ["obj_info", *_]:
                pass
            case ["format", name, *_] if name in ORDERS:
                order = ORDERS[name]
            case ["element", name, count] if (number_of := whole_number(count)) is not None:
                elements.append((name, number_of, []))
            case ["property", "list", length, kind, name] if elements and _is_count(length) and kind in TYPES:
                elements[-1][2].append(Property(name, TYPES[kind], TYPES[length]))
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1][2].append(Property(name, TYPES[kind]))
            case ["end_header"] if order is not None:
                return Header(order, tuple(Element(n, c, tuple(p)) for n, c, p in elements), file.tell(),
                              tuple(comments))
            case _:
                text = ascii(" ".join(words)[:60])
                raise InputError(f"PLY header line {number} not understood: {text}", file=path, remedy="export it again")
    raise InputError("PLY header without an end", file=path, remedy="export it again")


def _is_count(kind: str) -> bool:
    """Whether lengths of lists can be of this type; floating-point numbers may be infinite or NaN."""
    return TYPES.get(kind, "f")[0] != "f"
