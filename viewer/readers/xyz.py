"""XYZ, TXT, CSV and ASC: a row of text a point, in columns that the file or a person names, or that are recognised.

Separated by blanks, tabs, commas or semicolons; comments begin with # or //.  Frame and units: the file's, unknown.
"""

from collections.abc import Iterator
from pathlib import Path

from viewer.readers.column_source import Columns, ColumnSource
from viewer.readers.text_columns import named_columns, recognise
from viewer.readers.text_rows import ROWS, TextRows


class XyzSource(ColumnSource):
    """One text file of points.  columns: what a person said of them (``--columns``).

    Raises InputError where its columns cannot be told, naming the option that tells them.
    """

    def __init__(self, path: Path, columns: str | None = None):
        super().__init__(path, path.suffix[1:].upper() or "XYZ")
        self._layout = recognise(path, None if columns is None else named_columns(path, columns))

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        wanted = "".join(name for name in wanted if name in self._layout.columns)
        if not wanted:
            return
        with self.path.open("rb") as file:
            text = TextRows(self.path, file)
            text.skip_lines(self._layout.headers)
            while True:
                table, other = text.rows(self._layout.target(wanted), ROWS, self._layout.delimiter)
                if len(table):
                    yield 0, {name: table[:, i] for i, name in enumerate(wanted)}
                if other is not None:
                    raise text.unreadable(fields=(other, len(self._layout.columns)))
                if not len(table):
                    return
