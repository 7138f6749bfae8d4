"""Reads rows of numbers from a text file, a block at a time; errors name the line that is not numbers.

Frame and units: the file's.  Memory: two blocks of text and the requested rows.
"""

import re
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...common.errors import InputError
from ...common.text import counted
from .text_numbers import number, token_text

BLOCK = 1 << 24
"""Bytes of text that are read at a time.  Four million rows of seven columns: half takes as much CPU time and lowers the peak
of the memory from 267 MB to 230, twice raises it to 342."""
LONGEST_LINE = 1 << 16
"""Bytes of a line: over a hundred times the rows of scans, which have some hundreds."""
_SHOWN = 40  # characters of a line that a message quotes: half a line of a terminal
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"  # of UTF-8, as some spreadsheets write it
ROWS = 1 << 18
"""Rows that readers request at a time: seven columns take 15 MB as float64."""
BLANKS = ""
"""The delimiter where fields are separated by blanks or tabs."""


class TextRows:
    """An open text file as rows of numbers and, in between, lines.

    lines: the number of lines before the file's position.  block: bytes read at a time.
    """

    def __init__(self, path: Path, file: BinaryIO, lines: int = 0, block: int = BLOCK):
        self.path, self._file, self._block = path, file, block
        self._text, self._rest, self._at, self._ended = b"", b"", 0, False
        self._added = 0  # newlines that the file does not have
        self.line_number = lines
        """Number of lines before the current position."""
        self.words: dict[int, int] = {}
        """By column of the result, fields that are words where numbers would be (``lenient`` in :meth:`rows`)."""

    def line(self, tabs: bool = False) -> str | None:
        """The next line that is not blank, without its end and blanks around it; None at the end of the file.
        tabs: keep tabs, which may be delimiters."""
        while self._fill():
            end = self._text.index(b"\n", self._at)
            found, self._at = self._text[self._at : end].decode("latin-1"), end + 1
            self.line_number += 1
            if found.strip():
                return found.strip(" \r") if tabs else found.strip()
        return None

    def peek(self) -> str | None:
        """The line that ``line`` will return next."""
        found = self.line()
        if found is not None:
            self._at, self.line_number = self._text.rfind(b"\n", 0, self._at - 1) + 1, self.line_number - 1
        return found

    def rows(self, target: list[int], most: int, delimiter: str = BLANKS, decimal: str = ".", rest: bool = False,
             lenient: int | None = None) -> tuple[np.ndarray, int | None]:  # fmt: skip
        """Reads up to ``most`` of the next rows.

        target: for each field of a line its column in the result, -1 for none.  delimiter, decimal, rest: as in Layout
        (viewer.readers.text.text_columns).  lenient: columns of the result from this one on become NaN where a field is no
        number, which ``words`` counts.  Returns (n, columns) float64, and the number of fields of the next line where it
        differs, else None.  Raises InputError naming the line where a wanted field is not a number.
        """
        from .text_kernels import OTHER_WIDTH, byte_kinds, parse_rows

        table = np.empty((most, max(target) + 1))
        places, slow = np.array(target, np.int64), np.empty((max(4096, 4 * len(target)), 4), np.int64)
        done, other, kinds = 0, None, byte_kinds(delimiter)
        while done < most and other is None and self._fill():
            text = np.frombuffer(self._text, np.uint8)
            n, at, slows, why, lines, fields = parse_rows(
                text, self._at, len(text), kinds, bool(delimiter), ord(decimal), rest, places, table[done:], slow
            )
            for row, column, begin, end in slow[:slows].tolist():
                value = number(token_text(self._text[begin:end]), decimal)
                if value is None:
                    if lenient is None or column < lenient:
                        raise self.unreadable(begin)
                    value, self.words[column] = np.nan, self.words.get(column, 0) + 1
                table[done + row, column] = value
            done, self._at, self.line_number = done + n, at, self.line_number + lines
            other = fields if why == OTHER_WIDTH else None
        return table[:done], other

    @property
    def position(self) -> int:
        """The byte of the file that the next line begins at."""
        return self._file.tell() - len(self._rest) - (len(self._text) - self._added - self._at)

    def at_end(self) -> bool:
        """Whether nothing but blank lines is left."""
        return self.peek() is None

    def unreadable(self, at: int | None = None, fields: tuple[int, int] | None = None) -> InputError:
        """The error about a line that is not numbers.  at: a position in it, by default the next line.
        fields: the number of fields it has, and the number expected, where these differ."""
        at = self._at if at is None else at
        begin = self._text.rfind(b"\n", 0, at) + 1
        line = self._text[begin : self._text.find(b"\n", at)].decode("latin-1").strip()
        number = self.line_number + 1 + self._text.count(b"\n", self._at, begin)
        if has_decimal_comma(line):
            return InputError(f"line {number:,} has numbers with a decimal comma: {quoted(line)}", file=self.path,
                              remedy="export it with decimal points")  # fmt: skip
        if fields:
            after = self._text[self._text.find(b"\n", at) + 1 :] + self._rest + self._file.read(1)
            cut = "" if after.strip() else ", the file is truncated"
            return InputError(f"line {number:,} has {counted(fields[0], 'value')} where {fields[1]} are expected: "
                              f"{quoted(line)}{cut}", file=self.path, remedy="copy or export it again")  # fmt: skip
        return InputError(f"line {number:,} holds {quoted(line)} where numbers are expected", file=self.path,
                          remedy="export it again")

    def skip_lines(self, lines: int) -> None:
        """Skips to line number ``lines``, counting blank lines and comments."""
        while self.line_number < lines and self._fill():
            self._at, self.line_number = self._text.index(b"\n", self._at) + 1, self.line_number + 1

    def skip(self, most: int) -> int:
        """Skips up to ``most`` rows without parsing them, and returns how many there were."""
        from .text_kernels import skip_rows

        passed = 0
        while passed < most and self._fill():
            text = np.frombuffer(self._text, np.uint8)
            n, self._at, lines = skip_rows(text, self._at, len(text), most - passed)
            passed, self.line_number = passed + n, self.line_number + lines
        return passed

    def _fill(self) -> bool:
        """Reads on until a complete line is there; returns False at the end of the file."""
        while self._at >= len(self._text):
            if self._ended:
                return False
            first = self._file.tell() == 0
            block = self._file.read(self._block)
            self._ended = not block
            if first:
                block = block.removeprefix(_BYTE_ORDER_MARK)
            block = line_feeds(block)
            self._added = 1 if self._ended and self._rest else 0
            text = self._rest + block + b"\n" * self._added
            end = text.rfind(b"\n") + 1
            self._text, self._rest, self._at = text[:end], text[end:], 0
            if len(self._rest) > LONGEST_LINE:
                what = f"line {self.line_number + 1 + self._text.count(bytes([10])):,} has more than {LONGEST_LINE:,} bytes"
                raise InputError(f"{what}, it is not a text file of points", file=self.path, remedy="export it again")
        return True


def line_feeds(block: bytes) -> bytes:
    """A block of text whose lines end with carriage returns alone, as of old Macintosh programs, with line feeds instead."""
    return block.replace(b"\r", b"\n") if b"\r" in block and b"\n" not in block else block


def quoted(line: str) -> str:
    """The beginning of a line for a message."""
    shown = "".join(c if c.isascii() and c.isprintable() else "?" for c in line[:_SHOWN])
    return f"{shown!r}{' ...' if len(line) > _SHOWN else ''}"


def has_decimal_comma(line: str) -> bool:
    """Whether a line holds at least three numbers such as 1,5, separated by blanks, tabs or semicolons."""
    words = re.split(r"[;\s]+", line.strip("; \t\r\n"))
    return len(words) >= 3 and sum(bool(_DECIMAL_COMMA.fullmatch(word)) for word in words) >= 3
