"""The grids of the files of a place in the cache: which are there, and one file converted.

Each file has a grid of its own, which depends on nothing but the file, the options and the size of cells.  So a file is added,
replaced or removed without converting the others, and files can be converted by several processes.
"""

import logging
import math
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from ...common.errors import InputError
from ...common.rigid_transform import Rows
from ...readers.formats import takes_columns
from ...readers.moved_source import move_of, moves_at
from .. import cache as stored
from ..build_scene import build_scene
from ..density_layers import MAX_LAYERS, Lattice
from ..grid_header import DamagedGrid, cell_size_of

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class PlaceOptions:
    """How the files of a place are read; can be pickled.

    match, columns: as for viewer.grid.open_scene.  moves: transformations by real path.  cell_size: of the place, file
    units; None: as the points of the file ask for.
    """

    match: bool = True
    columns: str | None = None
    moves: tuple[tuple[str, Rows], ...] = ()
    cell_size: float | None = None

    def folder(self, file: Path) -> Path:
        """The folder in the cache of the grid of ``file`` with cells as its points ask for.  Those with cells of other sizes
        have a suffix."""
        columns = self.columns if takes_columns(file) else None
        return stored.folder_of([file], self.match, columns, self._moves(file), MAX_LAYERS)

    def _moves(self, file: Path) -> dict[str, Rows]:
        return moves_at([file], [move_of(file, dict(self.moves))])


def convert_one(file: Path, cache: Path, options: PlaceOptions) -> Path:
    """The folder of the grid of one file in the folder ``cache``, where it is built if it is not there.

    A plain function of files, which another process may run.  Raises InputError where the file cannot be read or the folder
    cannot be written.
    """
    folder = cache / _name(options.folder(file).name, options.cell_size)
    if stored.load(folder, [file]) is None:
        columns = options.columns if takes_columns(file) else None
        build = partial(build_scene, match=options.match, columns=columns, moves=options._moves(file),
                        lattice=Lattice(options.cell_size))  # fmt: skip
        stored.build_into(folder, [file], build, keep_old=False)
    return folder


def _name(natural: str, cell_size: float | None) -> str:
    return natural if cell_size is None else f"{natural}-c{round(math.log2(cell_size))}"


@dataclass(frozen=True)
class KnownGrids:
    """The grids of files that are in the cache.  folders: by file, then by size of the cells."""

    folders: dict[Path, dict[float, Path]]

    def common_size(self) -> float | None:
        """The size of cells that the most bytes of files have a grid of; None where there is no grid."""
        votes: Counter[float] = Counter()
        for file, sizes in self.folders.items():
            votes.update({size: _bytes(file) for size in sizes})
        return max(votes, key=lambda size: (votes[size], size)) if votes else None


def known_grids(files: Sequence[Path], cache: Path, options: PlaceOptions) -> KnownGrids:
    """The grids of ``files`` in the folder ``cache``."""
    there: dict[str, list[str]] = {}
    for name in os.listdir(cache) if cache.is_dir() else ():
        there.setdefault(name.partition("-c")[0], []).append(name)
    found: dict[Path, dict[float, Path]] = {}
    for file in files:
        sizes = {}
        for name in sorted(there.get(options.folder(file).name, ()), reverse=True):
            try:
                sizes[cell_size_of(cache / name)] = cache / name
            except DamagedGrid as error:
                _log.warning("%s: damaged grid (%s); it is built again", cache / name, error)
        found[file] = sizes
    return KnownGrids(found)


def largest(files: Sequence[Path]) -> Path:
    """The file of the most bytes, whose points decide on the cells of a place that has none yet."""
    return max(files, key=_bytes)


def _bytes(file: Path) -> int:
    try:
        return file.stat().st_size
    except OSError:
        return 0


def refuse_none(files: Sequence[Path], errors: Sequence[InputError]) -> None:
    """Raises InputError where none of the files could be opened."""
    from ...readers.formats import none_opens

    if len(errors) == len(files):
        raise errors[0] if len(files) == 1 else none_opens(list(files), errors[0])
