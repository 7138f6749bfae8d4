"""PTS (Leica): a line with the number of points, then as many rows x y z [i] [r g b]; several such parts may follow each other.

Coordinates are in the common frame.  Each part is a scan without a position.  Units: unknown, by convention metres.
"""

from collections.abc import Iterator
from pathlib import Path

from ...common.errors import InputError, Option
from ...common.text import counted, whole_number
from ..column_source import Columns, ColumnSource
from ..source import ScanInfo, surplus_warning
from .text_columns import LEAST_ROW, LEICA_COLUMNS, Layout, fields_of, named_columns, separators
from .text_header import OTHER
from .text_numbers import number
from .text_rows import ROWS, TextRows, quoted
from .text_sample import TextRegion, sample_rows
from .utf16 import open_text, size_of
from .xyz import XyzSource

_HEAD_BYTES = 1 << 12  # read to see whether there is a count: ten times the two lines that tell, of up to 200 bytes each


def open_pts(path: Path, columns: str | None = None) -> ColumnSource:
    """The reader for a .pts file; one without the line of the count is read as rows of text, with a warning.

    columns: as in XyzSource.  Raises InputError as PtsSource and XyzSource.
    """
    with open_text(path) as file:
        text = TextRows(path, file, block=_HEAD_BYTES)
        first = text.line() or ""
        lines = [first, text.line() or first]
    delimiter, decimal = separators(lines)
    rows = [fields_of(line, delimiter) for line in lines]
    numbers = [sum(number(word, decimal) is not None for word in row) for row in rows]
    if len(rows[0]) == 1 or max(numbers) < 3:
        return PtsSource(path, columns)
    known = LEICA_COLUMNS.get(len(rows[0])) if numbers[0] == len(rows[0]) else None
    source = XyzSource(path, columns if columns or known is None else ",".join(known))
    source.format = "PTS"
    source.warnings.insert(0, f"{path.name}: has no line with the number of its points; all of its rows are read")
    return source


class PtsSource(ColumnSource):
    """One .pts file.  columns: as in XyzSource.  Raises InputError where the counts contradict the file."""

    def __init__(self, path: Path, columns: str | None = None):
        super().__init__(path, "PTS")
        self._columns = "" if columns is None else named_columns(path, columns)
        self._counts: list[int] = []
        self._extents: list[tuple[int, int]] = []  # bytes of the rows of each part
        with open_text(path) as file:
            text, left = TextRows(path, file), size_of(file)
            while (line := text.peek()) is not None:
                count = self._count(line, left // LEAST_ROW)
                if count is None:
                    break
                text.line()
                self._look_at(text.peek() if count else None)
                begin = text.position
                if (done := text.skip(count)) < count:
                    raise self._truncated(done, count)
                self._counts.append(count)
                self._extents.append((begin, text.position))
            more = line is not None
        if not self._counts:
            raise InputError(f"begins with {quoted(line or '')} where a PTS has the number of its points", file=path,
                             remedy="export it again")  # fmt: skip
        self.count = sum(self._counts)
        if self.count == 0:
            raise InputError("holds no points (its header says 0)", file=path, remedy="export it again")
        if more:
            self._warn(surplus_warning(path, self.count))
        if len(self._counts) > 1:
            self.scans = [ScanInfo(f"{path.stem} {i}") for i in range(1, len(self._counts) + 1)]

    def _look_at(self, row: str | None) -> None:
        """Recognises the columns by the first row of a part; they are the same in all parts."""
        fields = len(row.split()) if row else 0
        if fields and not self._columns:
            if fields not in LEICA_COLUMNS:
                known = ", ".join(map(str, LEICA_COLUMNS))
                what = f"its rows have {counted(fields, 'value')}, not {known}: {quoted(row or '')}"
                raise InputError(what, file=self.path,
                                 remedy=("say what they are, such as ", Option("--columns"), " x,y,z,i,r,g,b,-"))
            self._columns = LEICA_COLUMNS[fields]

    def _count(self, line: str, most: int) -> int | None:
        """The number of points in a line; None where the line is a row of points."""
        count = whole_number(line)
        if count is not None and count > most:
            raise InputError(f"says that it holds {count:,} points, which its {self.path.stat().st_size:,} bytes cannot; it "
                             "is truncated or damaged, copy or export it again", file=self.path)  # fmt: skip
        return count

    def _record_rows(self) -> Iterator[tuple[int, Columns]]:
        """The columns that ``_rows`` knows: PTS has no header that would name others."""
        others = [str(at + 1) for at, column in enumerate(self._columns) if column == OTHER]
        text = f"{self.path.name}: column{'s' * (len(others) > 1)} {', '.join(others)} without a name in a header left out"
        if others and text not in self.record_losses:
            self.record_losses.append(text)
        return super()._record_rows()

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        wanted = "".join(name for name in wanted if name in self._columns)
        if not wanted:
            return
        target = Layout(self._columns).target(wanted)
        with open_text(self.path) as file:
            text = TextRows(self.path, file)
            for scan, count in enumerate(self._counts):
                text.line()
                done = 0
                while done < count:
                    table, other = text.rows(target, min(ROWS, count - done))
                    done += len(table)
                    if len(table):
                        yield scan, {name: table[:, i] for i, name in enumerate(wanted)}
                    if other is not None:
                        raise text.unreadable(fields=(other, len(self._columns)))
                    if not len(table):
                        raise self._truncated(done, count)

    def _sample_rows(self, wanted: str, points: int, run: int) -> Iterator[tuple[int, Columns]]:
        wanted = "".join(name for name in wanted if name in self._columns)
        target = Layout(self._columns).target(wanted)
        regions = [TextRegion(begin, end, target, scan) for scan, (begin, end) in enumerate(self._extents)]
        for scan, table in sample_rows(self.path, regions if wanted else [], points, run):
            yield scan, {name: table[:, i] for i, name in enumerate(wanted)}
