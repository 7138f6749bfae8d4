"""XYZ, TXT, CSV and ASC: one row of text per point.  The columns are named by the file or by a person, or recognised.

Fields are separated by blanks, tabs, commas or semicolons; comments begin with # or //.  Frame and units: the file's, unknown.
"""

from collections.abc import Iterator
from pathlib import Path

from .column_source import Columns, ColumnSource
from .text_columns import named_columns, recognise
from .text_rows import ROWS, TextRows
from .text_sample import TextRegion, sample_rows
from .utf16 import open_text, size_of

_HEADER_BLOCK = 1 << 16  # bytes read at a time to pass the lines before the rows; chosen by hand


class XyzSource(ColumnSource):
    """One text file of points.  columns: the columns that a person named (``--columns``).

    Raises InputError where the columns cannot be recognised; the message names that option.
    """

    def __init__(self, path: Path, columns: str | None = None):
        super().__init__(path, path.suffix[1:].upper() or "XYZ")
        self._layout = recognise(path, None if columns is None else named_columns(path, columns))
        if self._layout.degrees:
            self.units = "degree"
        self.warnings += [f"{path.name}: {note}" for note in self._layout.notes]

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        wanted = "".join(name for name in wanted if name in self._layout.columns)
        if not wanted:
            return
        separators = self._layout.delimiter, self._layout.decimal, self._layout.rest
        with open_text(self.path) as file:
            text = TextRows(self.path, file)
            text.skip_lines(self._layout.headers)
            while True:
                table, other = text.rows(self._layout.target(wanted), ROWS, *separators)
                if len(table):
                    yield 0, {name: table[:, i] for i, name in enumerate(wanted)}
                if other is not None:
                    raise text.unreadable(fields=(other, len(self._layout.columns)))
                if not len(table):
                    return

    def _sample_rows(self, wanted: str, points: int, run: int) -> Iterator[tuple[int, Columns]]:
        wanted = "".join(name for name in wanted if name in self._layout.columns)
        if not wanted:
            return
        with open_text(self.path) as file:
            text = TextRows(self.path, file, block=_HEADER_BLOCK)
            text.skip_lines(self._layout.headers)
            begin, end = text.position, size_of(file)
        separators = self._layout.delimiter, self._layout.decimal, self._layout.rest
        region = TextRegion(begin, end, self._layout.target(wanted))
        for scan, table in sample_rows(self.path, [region], points, run, *separators):
            yield scan, {name: table[:, i] for i, name in enumerate(wanted)}
