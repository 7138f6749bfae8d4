"""PTX (Leica): scans with their poses, each a header of ten lines and columns times rows of points x y z i [r g b].

The header: columns, rows, scanner position, three axes, and the 4x4 matrix from scanner to file for row vectors, whose last row
is the translation.  Rows of zeros are directions without a return.  Metres.  Frame: the file's; points are transformed to it.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ...common.errors import InputError
from ...common.text import whole_number
from ..column_source import Columns, ColumnSource
from ..source import ScanInfo
from .text_columns import LEAST_ROW, LEICA_COLUMNS
from .text_rows import ROWS, TextRows, quoted
from .text_sample import TextRegion, sample_rows
from .utf16 import open_text

_VECTORS = (3, 3, 3, 3, 4, 4, 4, 4)  # numbers in the lines of a header after columns and rows
_ORTHOGONAL = 1e-3  # largest error of a product of axes: four decimals make one of 2e-4 at most, and poses have six or more


@dataclass(frozen=True, eq=False)
class _Scan:
    """columns: of its rows.  begin, end: the bytes of its rows.  rotation: (3, 3), translation: (3,), scanner to file:
    ``p @ rotation + translation``."""

    count: int
    columns: str
    begin: int
    end: int
    rotation: np.ndarray
    translation: np.ndarray


class PtxSource(ColumnSource):
    """One .ptx file.  Raises InputError where a header is not valid, or a scan is shorter than it states."""

    def __init__(self, path: Path):
        super().__init__(path, "PTX")
        self.units, self.metres_per_unit = "metre", 1.0
        self._scans: list[_Scan] = []
        infos: list[ScanInfo] = []
        with open_text(path) as file:
            text = TextRows(path, file)
            while not text.at_end():
                count, matrix = self._header(text)
                first = text.peek()
                fields = len(first.split()) if first is not None else 0
                if count and fields not in LEICA_COLUMNS:
                    raise self._truncated(0, count) if first is None else text.unreadable()
                begin = text.position
                if (done := text.skip(count)) < count:
                    raise self._truncated(done, count, f" of scan {len(self._scans) + 1}")
                name = f"{path.stem} {len(infos) + 1}"
                placed = self._is_pose(matrix)
                if not placed:
                    self._warn(f"{path.name}: pose of {name!r} is not usable, its points are not moved")
                    matrix = np.eye(4)
                columns = LEICA_COLUMNS.get(fields, "xyz")
                self._scans.append(_Scan(count, columns, begin, text.position, matrix[:3, :3], matrix[3, :3]))
                infos.append(ScanInfo(name, tuple(matrix[3, :3].tolist()) if placed else None))
        self.scans = infos if len(infos) > 1 else [ScanInfo(path.stem, info.position) for info in infos]
        self.count = sum(scan.count for scan in self._scans)
        if self.count == 0:
            raise InputError("holds no points", file=path, remedy="export it again")

    def _header(self, text: TextRows) -> tuple[int, np.ndarray]:
        """Reads a header: the number of points of the scan, and its matrix (4, 4)."""
        begin = text.line_number + 1
        size = [whole_number(line) if (line := text.line()) is not None else None for _ in range(2)]
        if size[0] is None or size[1] is None:
            raise self._no_header(begin)
        count = size[0] * size[1]
        if count > self.path.stat().st_size // LEAST_ROW:
            what = f"scan {len(self._scans) + 1} states {size[0]:,} columns of {size[1]:,} points"
            raise InputError(f"{what}, more than the file can hold; truncated or damaged, copy or export it again",
                             file=self.path)
        vectors = []
        for numbers in _VECTORS:
            line = text.line()
            try:
                vectors.append([float(word) for word in (line or "").split()])
            except ValueError:
                raise self._no_header(begin, line) from None
            if len(vectors[-1]) != numbers:
                raise self._no_header(begin, line)
        return count, np.array(vectors[4:])

    def _no_header(self, begin: int, line: str | None = None) -> InputError:
        what = f", {quoted(line)} is not expected there" if line else ""
        return InputError(f"line {begin:,} does not begin a scan (columns, rows, position, three axes, matrix){what}; "
                          "truncated or damaged, copy or export it again", file=self.path)  # fmt: skip

    @staticmethod
    def _is_pose(matrix: np.ndarray) -> bool:
        rotation = matrix[:3, :3]
        with np.errstate(invalid="ignore", over="ignore"):
            error = np.abs(rotation @ rotation.T - np.eye(3)).max()
        return bool(np.isfinite(matrix).all() and error < _ORTHOGONAL and np.array_equal(matrix[:, 3], (0, 0, 0, 1)))

    def _placed(self, scan: int, columns: Columns) -> tuple[Columns, np.ndarray, int]:
        """Transforms points to the file's frame; zeros, which are directions without a return, are left out."""
        pose, size = self._scans[scan], len(columns["x"])
        local = np.stack([columns[axis] for axis in "xyz"], axis=1)
        found = local.any(axis=1)
        if not found.all():
            columns, local = {name: values[found] for name, values in columns.items()}, local[found]
        with np.errstate(invalid="ignore", over="ignore"):  # values that are not finite are dropped by the grid
            xyz = local if np.array_equal(pose.rotation, np.eye(3)) else local @ pose.rotation
            return columns, xyz + pose.translation, size - len(xyz)

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        with open_text(self.path) as file:
            text = TextRows(self.path, file)
            for number, scan in enumerate(self._scans):
                self._header(text)
                names = "".join(name for name in wanted if name in scan.columns)
                target, done = [names.find(name) for name in scan.columns], 0
                if not names:
                    text.skip(scan.count)
                    continue
                while done < scan.count:
                    table, other = text.rows(target, min(ROWS, scan.count - done))
                    done += len(table)
                    if len(table):
                        yield number, {name: table[:, i] for i, name in enumerate(names)}
                    if other is not None:
                        raise text.unreadable(fields=(other, len(scan.columns)))
                    if not len(table):
                        raise self._truncated(done, scan.count, f" of scan {number + 1}")

    def _sample_rows(self, wanted: str, points: int, run: int) -> Iterator[tuple[int, Columns]]:
        names = ["".join(name for name in wanted if name in scan.columns) for scan in self._scans]
        regions = [
            TextRegion(scan.begin, scan.end, [names[number].find(name) for name in scan.columns], number)
            for number, scan in enumerate(self._scans)
            if names[number]
        ]
        for number, table in sample_rows(self.path, regions, points, run):
            yield number, {name: table[:, i] for i, name in enumerate(names[number])}
