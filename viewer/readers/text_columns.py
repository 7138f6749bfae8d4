"""The columns of a text file of points: named by a person, else by the file's header, else recognised by their values.

Columns are named x y z (coordinates), r g b (colour), i (intensity), c (class) and - (anything else: normals, time, ...).
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import InputError
from .text_rows import BLANKS, TextRows, has_decimal_comma, quoted

COLUMNS = "xyzrgbic"
OTHER = "-"
LEICA_COLUMNS = {3: "xyz", 4: "xyzi", 6: "xyzrgb", 7: "xyzirgb"}
"""Columns of a row of PTS and PTX, by its number of fields."""
LEAST_ROW = 6
"""Bytes of the shortest row, "0 0 0" and its end."""
_NAMES = {
    "x": ("x", "easting", "east", "xcoord", "xcoordinate", "coordx", "posx", "pointx", "cartesianx"),
    "y": ("y", "northing", "north", "ycoord", "ycoordinate", "coordy", "posy", "pointy", "cartesiany"),
    "z": ("z", "elevation", "height", "altitude", "zcoord", "zcoordinate", "coordz", "posz", "pointz", "cartesianz"),
    "r": ("r", "red", "rf", "colorred", "diffusered"), "g": ("g", "green", "gf", "colorgreen", "diffusegreen"),
    "b": ("b", "blue", "bf", "colorblue", "diffuseblue"),
    "i": ("i", "intensity", "scalarintensity", "reflectance", "scalarreflectance", "amplitude"),
    "c": ("c", "class", "classification", "scalarclassification"),
}  # fmt: skip
_COLUMN_OF = {name: column for column, names in _NAMES.items() for name in names}
_UNIT = re.compile(r"[\[(][^\])]*[\])]")
_MOST_HEADERS = 100  # lines before the first row; chosen by hand
_SAMPLE_BYTES = 1 << 18  # read at the beginning, in the middle and at the end to recognise columns; chosen by hand
_UNIT_LENGTH = 0.01  # largest error of a normal's length; chosen by hand: files have two digits or more


@dataclass(frozen=True)
class Layout:
    """columns: a letter per field.  delimiter: between fields, BLANKS for blanks and tabs.  headers: lines before the rows."""

    columns: str
    delimiter: str = BLANKS
    headers: int = 0

    def target(self, wanted: str) -> list[int]:
        """For each field its index in ``wanted``, -1 for fields that are not wanted."""
        return [wanted.find(column) if column != OTHER else -1 for column in self.columns]


def named_columns(path: Path, text: str) -> str:
    """The columns named by ``--columns``, a letter each.  Raises InputError where they are not valid."""
    columns = [word.strip().lower() for word in text.split(",")]
    if wrong := next((word for word in columns if word not in (*COLUMNS, OTHER)), None):
        raise InputError(f"{path}: --columns {text}: {wrong!r} is none of {', '.join(COLUMNS)} and - (for any other)")
    joined = "".join(columns)
    twice = next((column for column in COLUMNS if joined.count(column) > 1), None)
    if twice or not set("xyz") <= set(joined) or len(set("rgb") & set(joined)) not in (0, 3):
        why = f"{twice} stands there twice" if twice else "x, y and z are needed, and of r, g, b all or none"
        raise InputError(f"{path}: --columns {text}: {why}; name every column of the file once, such as x,y,z,i,r,g,b,-")
    return joined


def recognise(path: Path, given: str | None = None) -> Layout:
    """The layout of a text file of points.  given: its columns by ``named_columns``.

    Raises InputError where it holds no rows of numbers, or the columns cannot be recognised.
    """
    headers: list[str] = []
    with path.open("rb") as file:
        text = TextRows(path, file)
        while (line := text.line()) is not None and len(headers) <= _MOST_HEADERS:
            delimiter = _delimiter(path, line)
            fields = _fields(line, delimiter)
            numbers = [word for word in fields if word and _number(word) is not None]
            if len(numbers) >= 3 and (given or numbers[0] == fields[0]):
                break
            headers.append(line)
        else:
            shown = f", it begins with {quoted(headers[0])}" if headers else ""
            raise InputError(f"{path}: holds no rows of numbers{shown}; a row is x y z, and i, r g b if known")
    before = text.line_number - 1
    if given is not None:
        if len(fields) != len(given):
            raise InputError(f"{path}: --columns names {len(given)} columns, but a row has {len(fields)}: {quoted(line)}; name "
                             "every column, those of no use as -")  # fmt: skip
        return Layout(given, delimiter, before)
    if named := next((found for header in reversed(headers) if (found := _by_names(header, delimiter, len(fields)))), None):
        return Layout(named, delimiter, before)
    if headers and len(_words(headers[-1], delimiter)) == len(fields):
        raise _unknown(path, f"its header {quoted(headers[-1])} names no x, y, z")
    return Layout(_by_values(path, delimiter, len(fields), before), delimiter, before)


def _delimiter(path: Path, line: str) -> str:
    if has_decimal_comma(line):
        raise InputError(f"{path}: has numbers with a decimal comma: {quoted(line)}; export it with decimal points")
    return next((mark for mark in ";," if line.count(mark) >= 2), BLANKS)


def _fields(line: str, delimiter: str) -> list[str]:
    if delimiter == BLANKS:
        return line.split()
    return [word.strip() for word in line.strip().removesuffix(delimiter).split(delimiter)]


def _numbers(fields: list[str]) -> list[float] | None:
    """The fields as numbers, empty fields as NaN; None where a field is not a number."""
    found = [_number(word) for word in fields]
    return None if None in found else [value for value in found if value is not None]


def _number(word: str) -> float | None:
    try:
        return float(word.strip("\"'")) if word else float("nan")
    except ValueError:
        return None


def _words(header: str, delimiter: str) -> list[str]:
    """The names in a header, without units in brackets; the header may be a comment."""
    words = [_UNIT.sub("", word) for word in _fields(header.lstrip("#/ \t"), delimiter)]
    return [word for word in words if word] if delimiter == BLANKS else words


def _by_names(header: str, delimiter: str, count: int) -> str | None:
    """The columns that a header names; None where it does not name ``count`` columns with x, y and z."""
    words = _words(header, delimiter)
    if len(words) != count:
        return None
    columns = [_COLUMN_OF.get(re.sub(r"[^a-z0-9]", "", word.lower()), OTHER) for word in words]
    columns = [OTHER if column in columns[:i] else column for i, column in enumerate(columns)]
    if not {"r", "g", "b"} <= set(columns):
        columns = [OTHER if column in "rgb" else column for column in columns]
    return "".join(columns) if {"x", "y", "z"} <= set(columns) else None


def _by_values(path: Path, delimiter: str, count: int, headers: int) -> str:
    """Recognises columns by their values: x y z come first; three of unit length are normals; three integers to 255 (or else
    65535), or shares of 1, are a colour; a single remaining column is the intensity."""
    table = _sample(path, delimiter, count, headers)
    columns = ["x", "y", "z", *[""] * (count - 3)]
    windows = range(3, count - 2)
    normals = [at for at in windows if _are_normals(table[:, at : at + 3])]
    if normals:
        columns[normals[0] : normals[0] + 3] = [OTHER] * 3
    colours = [at for at in windows if not any(columns[at : at + 3]) and _are_colours(table[:, at : at + 3])]
    narrow = [at for at in colours if table[:, at : at + 3].max() <= 255]
    colours = narrow if len(narrow) == 1 else colours
    if len(colours) > 1:
        raise _unknown(path, f"{count} columns in which the colour may be columns {colours[0] + 1} to {colours[0] + 3} or "
                             f"{colours[-1] + 1} to {colours[-1] + 3}")  # fmt: skip
    if colours:
        columns[colours[0] : colours[0] + 3] = "rgb"
    left = [at for at, column in enumerate(columns) if not column]
    if len(left) > 1:
        raise _unknown(path, f"{count} columns and no header that names them")
    if left:
        columns[left[0]] = "i"
    return "".join(columns)


def _are_normals(values: np.ndarray) -> bool:
    with np.errstate(invalid="ignore", over="ignore"):
        lengths = np.sqrt((values**2).sum(axis=1))
        near = np.abs(lengths - 1) < _UNIT_LENGTH
    return bool(near.mean() > 0.9 and (values % 1 != 0).any())  # some writers omit the normals of some points


def _are_colours(values: np.ndarray) -> bool:
    if not np.isfinite(values).all() or values.min() < 0:
        return False
    return bool((values % 1 == 0).all() and values.max() <= 65535) or bool(values.max() <= 1)


def _sample(path: Path, delimiter: str, count: int, headers: int) -> np.ndarray:
    """(n, count) float64: rows from the beginning, the middle and the end of a file."""
    size, rows = path.stat().st_size, []
    with path.open("rb") as file:
        for place in sorted({0, max(0, size // 2), max(0, size - _SAMPLE_BYTES)}):
            file.seek(place)
            lines = file.read(_SAMPLE_BYTES).decode("latin-1").split("\n")
            whole = lines[headers if place == 0 else 1 : len(lines) if place + _SAMPLE_BYTES >= size else -1]
            found = (_numbers(_fields(line, delimiter)) for line in whole)
            rows += [row for row in found if row is not None and len(row) == count]
    if not rows:
        raise InputError(f"{path}: holds no two rows with the same number of values; a row is x y z, and i, r g b if known")
    return np.array(rows)


def _unknown(path: Path, why: str) -> InputError:
    return InputError(f"{path}: {why}; say what its columns are, such as --columns x,y,z,i,r,g,b,- (i: intensity, c: class, -: "
                      "anything else)")  # fmt: skip
