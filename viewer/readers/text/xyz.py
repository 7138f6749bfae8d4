"""XYZ, TXT, CSV and ASC: one row of text per point.  The columns are named by the file or by a person, or recognised.

Fields are separated by blanks, tabs, commas or semicolons; comments begin with # or //.  Frame and units: the file's, unknown.
"""

from collections.abc import Iterator
from pathlib import Path

from ...common.text import counted
from ..column_source import ALL, Columns, ColumnSource
from .text_columns import named_columns, recognise
from .text_further import Further, further_columns
from .text_rows import LONGEST_LINE, ROWS, TextRows
from .text_sample import TextRegion, sample_rows
from .utf16 import open_text, size_of


class XyzSource(ColumnSource):
    """One text file of points.  columns: the columns that a person named (``--columns``).

    Raises InputError where the columns cannot be recognised; the message names that option.
    """

    def __init__(self, path: Path, columns: str | None = None):
        super().__init__(path, path.suffix[1:].upper() or "XYZ")
        self._layout = recognise(path, None if columns is None else named_columns(path, columns))
        self._further: Further | None = None
        if self._layout.degrees:
            self.units = "degree"
        self.warnings += [f"{path.name}: {note}" for note in self._layout.notes]

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        wanted = "".join(name for name in wanted if name in self._layout.columns)
        if not wanted:
            return
        yield from self._tables(list(wanted), self._layout.target(wanted), len(wanted))

    def _tables(self, names: list[str], target: list[int], lenient: int) -> Iterator[tuple[int, Columns]]:
        """names: of the columns of ``target`` (see TextRows.rows); those from number ``lenient`` on may hold words."""
        separators = self._layout.delimiter, self._layout.decimal, self._layout.rest
        with open_text(self.path) as file:
            text = TextRows(self.path, file)
            text.skip_lines(self._layout.headers)
            while True:
                table, other = text.rows(target, ROWS, *separators, lenient)
                if len(table):
                    yield 0, {name: table[:, i] for i, name in enumerate(names)}
                if other is not None:
                    raise text.unreadable(fields=(other, len(self._layout.columns)))
                if not len(table):
                    break
        for column, count in text.words.items():
            words = f"{self.path.name}: {counted(count, 'field')} of column {names[column]}"
            self._lose(f"{words} {'is no number' if count == 1 else 'are no numbers'} and left out")

    def _record_rows(self) -> Iterator[tuple[int, Columns]]:
        """Rows with the further columns, by their names in the header."""
        if self._further is None:
            self._further = further_columns(self.path, self._layout)
            for text in self._further.losses:
                self._lose(text)
        letters = [name for name in ALL if name in self._layout.columns]
        target = self._layout.target("".join(letters))
        for number, at in enumerate(self._further.names):
            target[at] = len(letters) + number
        return self._tables([*letters, *self._further.names.values()], target, len(letters))

    def _lose(self, text: str) -> None:
        if text not in self.record_losses:
            self.record_losses.append(text)

    def _sample_rows(self, wanted: str, points: int, run: int) -> Iterator[tuple[int, Columns]]:
        wanted = "".join(name for name in wanted if name in self._layout.columns)
        if not wanted:
            return
        with open_text(self.path) as file:
            text = TextRows(self.path, file, block=LONGEST_LINE)
            text.skip_lines(self._layout.headers)
            begin, end = text.position, size_of(file)
        separators = self._layout.delimiter, self._layout.decimal, self._layout.rest
        region = TextRegion(begin, end, self._layout.target(wanted))
        for scan, table in sample_rows(self.path, [region], points, run, *separators):
            yield scan, {name: table[:, i] for i, name in enumerate(wanted)}
