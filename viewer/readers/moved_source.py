"""A scan at another place: a reader whose coordinates are transformed by the rigid transformation that a project keeps of it.

Points, scanner positions and normals are moved; colours and all other attributes stay.  Frame: the reader inside has the file's
own, this one has that of the document, float64.
"""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from ..common.errors import InputError
from ..common.rigid_transform import Rows, inverse, moved_points, turned_directions
from .source import Chunk, Records, ScanInfo, Source

Moves = Mapping[str, Rows]
"""Real path of a scan, or of a folder of scans -> the transformation of its coordinates.  Scans that are not in it stay."""

NORMALS = (("nx", "ny", "nz"), ("normal_x", "normal_y", "normal_z"), ("NormalX", "NormalY", "NormalZ"))
"""Names of columns of directions, in PLY and PCD, in Potree 2, and in LAS with extra bytes."""


def move_of(path: Path, moves: Moves | None) -> Rows | None:
    """The transformation of a file: its own, or that of the folder it lies in (octrees, folders of scans); None: it stays."""
    if not moves:
        return None
    real = os.path.realpath(path)
    return moves.get(real) or moves.get(os.path.dirname(real))


def moves_of_files(files: Iterable[Path], moves: Moves | None) -> tuple[Rows | None, ...]:
    """The transformation of each file; () where none is moved."""
    found = tuple(move_of(file, moves) for file in files)
    return found if any(found) else ()


def moves_at(files: Sequence[Path], transforms: Sequence[Rows | None]) -> dict[str, Rows]:
    """The transformations of files by path, from those in the order of the files, or () where none is moved."""
    return {os.path.realpath(file): rows for file, rows in zip(files, transforms) if rows is not None}


def refuse_moved_grid(folder: Path, moves: Moves | None) -> None:
    """Raises InputError where a folder made by ``convert`` has a transformation: its points are packed at their places."""
    if moves and os.path.realpath(folder) in moves:
        raise InputError("a folder made by convert cannot be moved", file=folder, remedy="move the scan that it was made from")


def placed(source: Source, moves: Moves | None) -> Source:
    """The reader, or one of the moved scan where it has a transformation."""
    transform = move_of(source.path, moves)
    return source if transform is None else MovedSource(source, transform)


def unmoved(source: Source) -> tuple[Source, Rows | None]:
    """The reader of the file itself, and the transformation that it has here."""
    return (source.inner, source.transform) if isinstance(source, MovedSource) else (source, None)


class MovedSource(Source):
    """inner: the reader of the file.  transform: from its frame to this one's."""

    def __init__(self, inner: Source, transform: Rows):
        super().__init__(
            inner.path, inner.format, inner.count, inner.units, inner.metres_per_unit, inner.crs, inner.precision,
            [self._info(scan, transform) for scan in inner.scans], inner.warnings, inner.crs_text, inner.record_losses,
        )  # fmt: skip
        self.inner, self.transform = inner, transform

    @staticmethod
    def _info(scan: ScanInfo, transform: Rows) -> ScanInfo:
        if scan.position is None:
            return scan
        x, y, z = moved_points(transform, np.array([scan.position]))[0].tolist()
        return replace(scan, position=(x, y, z))

    def _chunk(self, chunk: Chunk) -> Chunk:
        return replace(chunk, xyz=moved_points(self.transform, chunk.xyz))

    def _records(self, records: Records) -> Records:
        """Without the native form, which has the file's own coordinates."""
        columns = turned_normals(records.columns, self.transform)
        return replace(records, xyz=moved_points(self.transform, records.xyz), columns=columns, native=None)

    def chunks(self) -> Iterator[Chunk]:
        """See Source."""
        return map(self._chunk, self.inner.chunks())

    def record_chunks(self) -> Iterator[Records]:
        """See Source."""
        return map(self._records, self.inner.record_chunks())

    def column_chunks(self, name: str) -> Iterator[Records]:
        """See Source."""
        if any(name in triple for triple in NORMALS):
            return self.record_chunks()
        return map(self._records, self.inner.column_chunks(name))

    def records(self, numbers: np.ndarray) -> Records:
        """See Source."""
        return self._records(self.inner.records(numbers))

    def sample(self, points: int, run: int) -> Iterator[Chunk] | None:
        """See Source."""
        found = self.inner.sample(points, run)
        return None if found is None else map(self._chunk, found)

    def precision_within(self, bounds: np.ndarray) -> float:
        """The coordinates keep the steps that they have in the file: what is stored in float32 near its own zero stays fine
        where the scan is moved to map coordinates."""
        corners = np.array([[bounds[i, 0], bounds[j, 1], bounds[k, 2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        own = np.abs(moved_points(inverse(self.transform), corners)).max()
        return max(self.inner.precision * float(own) / max(float(np.abs(bounds).max()), 1e-300), 2.0**-53)

    @property
    def intensity_ends(self) -> tuple[float, float]:
        """See Source."""
        return self.inner.intensity_ends

    @property
    def has_quick_records(self) -> bool:
        """See Source."""
        return self.inner.has_quick_records


def moved_pose(transform: Rows | None, camera_to_world: np.ndarray) -> np.ndarray:
    """(4, 4): where a camera or photograph of a file stands, which is moved with it."""
    return camera_to_world if transform is None else np.array(transform) @ camera_to_world


def turned_normals(columns: dict[str, np.ndarray], transform: Rows) -> dict[str, np.ndarray]:
    """Columns of records with the directions among them turned, in the types they had; whole numbers are left."""
    turned = {}
    for names in NORMALS:
        found = [columns[name] for name in names if name in columns and columns[name].ndim == 1]
        if len(found) == 3 and all(values.dtype.kind == "f" for values in found):
            directions = turned_directions(transform, np.stack(found, axis=1))
            turned |= {name: directions[:, axis].astype(values.dtype) for axis, (name, values) in enumerate(zip(names, found))}
    return {**columns, **turned}
