"""Files decoded by workers, for a grid that is built here: decoding is a map over files, counting and placing a reduction.

Each worker reads a file with its reader and writes the chunks behind each other into a file of its own (a spool) in the folder
of the grid.  The reduction then walks over the same chunks in the same order as if it had decoded them, so that the grid has
the same bytes.  On disk the spools take the place of what viewer.grid.building.kept_chunks keeps.
"""

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import InputError
from ...common.workers.run_tasks import run_tasks
from ...common.workers.worker_choice import Workers
from ...readers.formats import open_source
from ...readers.source import Chunk, Records, Source

_ARRAYS = tuple(field.name for field in fields(Chunk) if field.name != "invalid")
_Place = tuple[int, str, tuple[int, ...]]
"""Where an array begins in a spool, its type and shape."""


@dataclass(frozen=True)
class Spool:
    """The chunks of a file.  chunks: each without its arrays, and where these are.  warnings, ends: of the source, once it has
    been read.  error: where the file is damaged."""

    path: Path
    chunks: tuple[tuple[Chunk, dict[str, _Place]], ...] = ()
    warnings: tuple[str, ...] = ()
    ends: tuple[float, float] = (0.0, 0.0)
    error: InputError | None = None


class DecodedSource(Source):
    """inner: the reader of the file, of which only what its header says is used."""

    worth_keeping = False

    def __init__(self, inner: Source, spool: Spool):
        super().__init__(
            inner.path, inner.format, inner.count, inner.units, inner.metres_per_unit, inner.crs, inner.precision, inner.scans,
            list(spool.warnings) if spool.error is None else inner.warnings, inner.crs_text, inner.record_losses,
        )  # fmt: skip
        self.inner, self._spool = inner, spool

    def chunks(self) -> Iterator[Chunk]:
        """See Source."""
        if self._spool.error is not None:
            raise self._spool.error
        with self._spool.path.open("rb") as file:
            for chunk, places in self._spool.chunks:
                arrays: dict[str, Any] = {}
                for name, (begin, dtype, shape) in places.items():
                    file.seek(begin)
                    arrays[name] = np.fromfile(file, dtype, int(np.prod(shape))).reshape(shape)
                yield replace(chunk, **arrays)

    def sample(self, points: int, run: int) -> Iterator[Chunk] | None:
        """See Source."""
        return self.inner.sample(points, run)

    def records(self, numbers: np.ndarray) -> Records:
        """See Source."""
        return self.inner.records(numbers)

    def record_chunks(self) -> Iterator[Records]:
        """See Source."""
        return self.inner.record_chunks()

    def precision_within(self, bounds: np.ndarray) -> float:
        """See Source."""
        return self.inner.precision_within(bounds)

    @property
    def intensity_ends(self) -> tuple[float, float]:
        """See Source."""
        return self._spool.ends


def decoded_files(files: Sequence[Path], columns: str | None, folder: Path, workers: Workers) -> dict[Path, Spool]:
    """The files decoded by workers, one at a time each.  columns: as for viewer.grid.open_scene.  folder: for the spools, which
    the caller removes (:func:`remove_spools`).  Raises PointglassError; damage of a file is left to its source."""
    tasks = [(file, folder / f"decoded-{number}") for number, file in enumerate(files)]
    with closing(run_tasks(partial(decode, columns=columns), tasks, workers, label="decoding", unit="file",
                           name=lambda task: task[0].name)) as spools:  # fmt: skip
        return dict(zip(files, spools, strict=True))


def with_spools(sources: Sequence[Source], spools: dict[Path, Spool]) -> list[Source]:
    """The sources, those that were decoded with the points of their spools."""
    return [DecodedSource(source, spools[source.path]) if source.path in spools else source for source in sources]


def remove_spools(spools: dict[Path, Spool]) -> None:
    """Removes the files of spools."""
    for spool in spools.values():
        spool.path.unlink(missing_ok=True)


def decode(task: tuple[Path, Path], *, columns: str | None) -> Spool:
    """Decodes a file into a spool; runs in a worker.  Raises OSError where that cannot be written."""
    file, path = task
    chunks: list[tuple[Chunk, dict[str, _Place]]] = []
    with path.open("wb") as out:
        try:
            source = open_source(file, columns)
            for chunk in source.chunks():
                arrays = {name: value for name in _ARRAYS if isinstance(value := getattr(chunk, name), np.ndarray)}
                places, begin = dict[str, _Place](), out.tell()
                for name, array in arrays.items():
                    places[name] = begin, array.dtype.str, array.shape
                    begin += array.nbytes
                    out.write(np.ascontiguousarray(array).reshape(-1).view(np.uint8).data)
                chunks.append((replace(chunk, **dict.fromkeys(arrays)), places))
        except InputError as error:
            return Spool(path, error=error)
    return Spool(path, tuple(chunks), tuple(source.warnings), source.intensity_ends)
