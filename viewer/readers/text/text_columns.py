"""The columns of a text file of points: named by a person, else by the file's header, else recognised by their values.

Columns are named x y z (coordinates), r g b (colour), i (intensity), c (class) and - (anything else: normals, time, ...).
"""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.errors import InputError, Option
from ...common.text import counted
from .text_header import OTHER, columns_named, header_words, names_angles, words_of
from .text_numbers import decimal_mark, number
from .text_rows import BLANKS, TextRows, has_decimal_comma, line_feeds, quoted
from .text_values import columns_by_values, unknown_columns
from .utf16 import open_text, size_of

COLUMNS = "xyzrgbic"
LEICA_COLUMNS = {3: "xyz", 4: "xyzi", 6: "xyzrgb", 7: "xyzirgb"}
"""Columns of a row of PTS and PTX, by its number of fields."""
LEAST_ROW = 6
"""Bytes of the shortest row, "0 0 0" and its end."""
_MOST_HEADERS = 100  # lines before the first row: ten times the longest header of the formats here, that of PTX
_SAMPLE_BYTES = 1 << 18  # read at the beginning, in the middle and at the end to recognise columns: 1,300 rows of 200 bytes
_FIRST_ROWS = 50  # rows that tell delimiter and decimal mark: a mark that one row in two has by chance is in all with 2**-50
_QUOTED = re.compile(r'"[^"]*"')
_WORDS = re.compile(r'(?:"[^"]*")+[^\s"]*|\S+')


@dataclass(frozen=True)
class Layout:
    """columns: a letter per field.  delimiter: between fields, BLANKS for blanks and tabs.  headers: lines before the rows.
    decimal: the mark before a fraction.  rest: the last field, which is not wanted, ends with its line, blanks in it or not.
    notes: what a person should know about how the columns were recognised.  degrees: the header calls x and y longitude and
    latitude.  words: the name of each field in the header; empty where there is none."""

    columns: str
    delimiter: str = BLANKS
    headers: int = 0
    decimal: str = "."
    rest: bool = False
    notes: tuple[str, ...] = ()
    degrees: bool = False
    words: tuple[str, ...] = ()

    def target(self, wanted: str) -> list[int]:
        """For each field its index in ``wanted``, -1 for fields that are not wanted."""
        return [wanted.find(column) if column != OTHER else -1 for column in self.columns]


def named_columns(path: Path, text: str) -> str:
    """The columns named by ``--columns``, a letter each.  Raises InputError where they are not valid."""
    columns = [word.strip().lower() for word in text.split(",")]
    if wrong := next((word for word in columns if word not in (*COLUMNS, OTHER)), None):
        raise InputError((Option("--columns"), f" {text}: {wrong!r} is none of {', '.join(COLUMNS)} and - (for any other)"),
                         file=path)
    joined = "".join(columns)
    twice = next((column for column in COLUMNS if joined.count(column) > 1), None)
    if twice or not set("xyz") <= set(joined) or len(set("rgb") & set(joined)) not in (0, 3):
        why = f"{twice} stands there twice" if twice else "x, y and z are needed, and of r, g, b all or none"
        raise InputError((Option("--columns"), f" {text}: {why}"), file=path,
                         remedy="name every column of the file once, such as x,y,z,i,r,g,b,-")
    return joined


def recognise(path: Path, given: str | None = None) -> Layout:
    """The layout of a text file of points.  given: its columns by ``named_columns``.

    Raises InputError where it holds no rows of numbers, or the columns cannot be recognised.
    """
    headers, before, lines = _beginning(path)
    if not lines:
        shown = f", it begins with {quoted(headers[0])}" if headers else ""
        raise InputError(f"holds no rows of numbers{shown}; a row is x y z, and i, r g b if known", file=path)
    delimiter, decimal = separators(lines)
    counts = [len(fields_of(line, delimiter)) for line in lines]
    count = counts[0] + (delimiter != BLANKS and lines[0].rstrip().endswith(delimiter) and counts[0] + 1 in counts)
    if given is not None:
        rest = given[-1] == OTHER and len(given) < max(counts)
        if count != len(given) and not rest:
            raise InputError((Option("--columns"), f" names {len(given)} columns, but a row has {count}: {quoted(lines[0])}"),
                             file=path, remedy="name every column, those of no use as -")  # fmt: skip
        words = next((found for header in reversed(headers) if (found := words_of(header, delimiter, len(given)))), ())
        return Layout(given, delimiter, before, decimal, rest, words=words)
    named, title = next(((found, header) for header in reversed(headers)
                         if (found := columns_named(header, delimiter, count))), (None, ""))  # fmt: skip
    if named is None and headers and any(len(words) == count for words in header_words(headers[-1], delimiter)[:2]):
        raise unknown_columns(path, f"its header {quoted(headers[-1])} names no x, y, z")
    if named is not None:
        rest = named[-1] == OTHER and max(counts) > count
        degrees, words = names_angles(title, delimiter, named), words_of(title, delimiter, count, named)
        return Layout(named, delimiter, before, decimal, rest, degrees=degrees, words=words)
    if max(counts) > min(counts) and _ends_with_words(lines, delimiter, min(counts), decimal):
        count = min(counts)
    if count < 3:  # the first row was told by other marks than the rows together
        raise unknown_columns(path, f"a row has {counted(count, 'column')}: {quoted(lines[0])}; x, y and z are needed")
    table, words = _sample(path, delimiter, decimal, count, before)
    columns, notes = columns_by_values(path, table, words)
    rest = columns[-1] == OTHER and bool(np.isnan(table[:, -1]).all()) and max(counts) > count
    return Layout(columns, delimiter, before, decimal, rest, notes)


def _beginning(path: Path) -> tuple[list[str], int, list[str]]:
    """The lines before the first row that are not blank, the number of lines before it, and the first rows; no rows where
    there are none."""
    lines: list[tuple[int, str]] = []
    with open_text(path) as file:
        text = TextRows(path, file, block=_SAMPLE_BYTES)
        while len(lines) <= _MOST_HEADERS + _FIRST_ROWS and (line := text.line(tabs=True)) is not None:
            lines.append((text.line_number - 1, line))
    for at, (before, line) in enumerate(lines[: _MOST_HEADERS + 1]):
        if not line.startswith(("#", "//")) and _is_row(line, next(iter(lines[at + 1 : at + 2]), None)):
            rows = [row for _, row in lines[at:] if not row.startswith(("#", "//"))]
            return [header for _, header in lines[:at]], before, rows
    return [header for _, header in lines], 0, []


def _is_row(line: str, after: tuple[int, str] | None) -> bool:
    """Whether a line is a row of numbers: at least three of its fields are numbers; where the first is not, the same fields of
    the next line are numbers too."""
    delimiter, decimal = separators([line, after[1]] if after else [line])
    fields = [number(word, decimal) if word else None for word in fields_of(line, delimiter)]
    known = [at for at, value in enumerate(fields) if value is not None]
    if len(known) < 3 or known[0] == 0 or after is None:
        return len(known) >= 3
    other = [number(word, decimal) if word else None for word in fields_of(after[1], delimiter)]
    return sum(at < len(other) and other[at] is not None for at in known) >= 3


def _ends_with_words(lines: list[str], delimiter: str, count: int, decimal: str) -> bool:
    """Whether the rows have words from field ``count`` on, which may hold the delimiter."""
    ends = [fields_of(line, delimiter)[count - 1 :] for line in lines]
    return count > 3 and all(any(number(word, decimal) is None for word in end) for end in ends)


def separators(lines: list[str]) -> tuple[str, str]:
    """The delimiter and the decimal mark of rows."""
    line = lines[0]
    delimiter = next((mark for mark in ";|" if line.count(mark) >= 2), None)
    if delimiter is None and not any(map(has_decimal_comma, lines)) and _outside_quotes(line).count(",") >= 2:
        delimiter = ","
    if delimiter is None:
        tabs = line.count("\t") >= 2 and any(len(fields_of(row, "\t")) != len(fields_of(row, BLANKS)) for row in lines)
        delimiter = "\t" if tabs and len(fields_of(line, "\t")) >= 3 else BLANKS
    return delimiter, decimal_mark([word for row in lines for word in fields_of(row, delimiter)], delimiter)


def _outside_quotes(line: str) -> str:
    return _QUOTED.sub("", line) if '"' in line else line


def fields_of(line: str, delimiter: str) -> list[str]:
    """The fields of a row.  Double quotes may enclose delimiters and blanks."""
    if '"' not in line:
        if delimiter == BLANKS:
            return line.split()
        return [word.strip() for word in line.strip(" \r").removesuffix(delimiter).split(delimiter)]
    if delimiter == BLANKS:
        return [word.group() for word in _WORDS.finditer(line)]
    bare = _QUOTED.sub(lambda found: found.group().replace(delimiter, "\0"), line.strip(" \r"))
    return [word.strip().replace("\0", delimiter) for word in bare.removesuffix(delimiter).split(delimiter)]


def _sample(path: Path, delimiter: str, decimal: str, count: int, headers: int) -> tuple[np.ndarray, np.ndarray]:
    """Rows from the beginning, the middle and the end of a file: (n, count) float64, NaN where a field is not a number, and
    (n, count) bool, where it is a word."""
    rows = sample_fields(path, delimiter, count, headers)
    if not rows:
        raise InputError("holds no two rows with the same number of values; a row is x y z, and i, r g b if known", file=path)
    values = [[number(word, decimal) for word in row[:count]] for row in rows]
    return np.array(values, np.float64), np.array([[value is None for value in row] for row in values])


def sample_fields(path: Path, delimiter: str, count: int, headers: int) -> list[list[str]]:
    """Rows from the beginning, the middle and the end of a file, of at least ``count`` fields each, as text."""
    rows = list[list[str]]()
    with open_text(path) as file:
        size = size_of(file)
        for place in sorted({0, max(0, size // 2), max(0, size - _SAMPLE_BYTES)}):
            file.seek(place)
            lines = line_feeds(file.read(_SAMPLE_BYTES)).decode("latin-1").split("\n")
            whole = lines[headers if place == 0 else 1 : len(lines) if place + _SAMPLE_BYTES >= size else -1]
            found = (fields_of(line, delimiter) for line in whole if not line.startswith(("#", "//")))
            rows += [fields for fields in found if len(fields) >= count]
    return rows
