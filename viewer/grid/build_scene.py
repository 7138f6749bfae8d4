"""Reads scan files and builds their grid, in memory or in a file.  Frame: file coordinates."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import InputError
from ..preprocess.scan_description import RecordOrigin, ScanDescription, ScanWarning, WarningTopic
from ..readers.moved_source import moves_of_files
from .differences import differences
from .records.point_records import identity_of
from .scene import Scene

if TYPE_CHECKING:
    from ..common.workers.worker_choice import Workers
    from ..readers.moved_source import Moves
    from ..readers.source import Source
    from .building.decoded_files import Spool
    from .density_layers import Lattice

_IN_MEMORY = 32_000_000  # points (384 MB packed); larger scans are built in a file


def build_scene(files: list[Path], allocate, *, match: bool = True, columns: str | None = None,
                moves: "Moves | None" = None, folder: Path | None = None, lattice: "Lattice | None" = None,
                workers: "Workers | None" = None) -> Scene:
    """Reads the files, of several those that can be read, and builds their grid.

    allocate: gives the arrays of the points (viewer.grid.building.two_passes.Allocate).  folder: for temporary files.
    lattice: of a place (viewer.grid.building.two_passes.build_grid).
    workers: who decodes several files that are not moved; needs ``folder``.  None: this process, which decodes one file after
    the other, each on all processors where its format allows that.
    """
    build = partial(_build, allocate=allocate, match=match, columns=columns, moves=moves, folder=folder, lattice=lattice)
    if workers is None or len(files) < 2 or folder is None or moves:
        return build(files, spools={})
    from .building.decoded_files import decoded_files, remove_spools

    spools = decoded_files(files, columns, folder, workers)
    try:
        return build(files, spools=spools)
    finally:
        remove_spools(spools)


def _build(files: list[Path], *, allocate, match: bool, columns: str | None, moves: "Moves | None", folder: Path | None,
           lattice: "Lattice | None", spools: "dict[Path, Spool]") -> Scene:  # fmt: skip
    """build_scene, with those files that are decoded already."""
    from ..preprocess.point_colour import Colours
    from ..readers.formats import open_readable
    from .building.two_passes import build_grid

    sources, left_out = open_readable(files, columns, moves)
    while True:
        if spools:
            from .building.decoded_files import with_spools

            sources = with_spools(sources, spools)
        files = [source.path for source in sources]
        known = replace(
            stated_facts(sources), match=match, warnings=(*warnings_of(left_out), *_differences(sources)),
            records=RecordOrigin(files=tuple(map(identity_of, files)), columns=columns, moves=moves_of_files(files, moves)),
        )  # fmt: skip
        try:
            scene = build_grid(sources, colours=Colours(sources, match=match), allocate=allocate, known=known, folder=folder,
                               lattice=lattice)
        except InputError as error:  # damage that only reading all of its points finds
            broken = next((source for source in sources if error.is_of(source.path)), None)
            if broken is None or len(sources) == 1:
                raise
            left_out.append(error)
            sources, _ = open_readable([source.path for source in sources if source is not broken], columns, moves)
            continue
        _check_unchanged(files, known)
        return scene


def _check_unchanged(files: list[Path], known: ScanDescription) -> None:
    """Raises InputError naming the first file that is no longer the one that was opened."""
    stated = known.records.files if known.records else None
    for file, identity in zip(files, stated or ()):
        try:
            changed = identity_of(file) != identity
        except OSError:
            changed = True
        if changed:
            raise InputError("changed while it was read", file=file, remedy="try again")


def _differences(sources: "Sequence[Source]") -> list[ScanWarning]:
    return differences([(source.metres_per_unit, source.crs) for source in sources])


def stated_facts(sources: "Sequence[Source]") -> ScanDescription:
    """What the readers found in the files."""
    return ScanDescription(
        sources=tuple(str(source.path.absolute()) for source in sources),
        format=", ".join(dict.fromkeys(source.format for source in sources)),
        units=_common([source.units for source in sources], "mixed"),
        metres_per_unit=_common([source.metres_per_unit for source in sources], None),
        crs=_common([source.crs for source in sources], "mixed"),
    )


def in_memory(name: str, shape: tuple[int, ...], dtype: type) -> np.ndarray:
    """An array for a column of the points that is freed with the scene: memory, or for large scans a file without a name."""
    if shape[0] <= _IN_MEMORY:
        return np.empty(shape, dtype)
    import tempfile

    size = int(np.prod(shape)) * np.dtype(dtype).itemsize
    from .scratch_folder import reserve

    try:
        with tempfile.TemporaryFile(prefix="pointglass-") as file:
            reserve(file.fileno(), size, Path(tempfile.gettempdir()))
            return np.memmap(file, dtype, "r+", shape=shape)
    except OSError as error:
        raise InputError(f"no room for {size / 1e9:.1f} GB of points ({error.strerror})", file=tempfile.gettempdir(),
                         remedy="set TMPDIR to a folder with more space") from None


def warnings_of(errors: Iterable[InputError]) -> list[ScanWarning]:
    """The warnings about files that could not be opened."""
    return [ScanWarning(str(error), WarningTopic.LEFT_OUT) for error in errors]


def _common(values: list, otherwise):
    return values[0] if len(set(values)) == 1 else otherwise
