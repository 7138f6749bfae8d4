"""All points of a scan with their stations, as its files have them, and whether two scans may be compared.

Frame: file coordinates, float64, file units; of scans that a project has moved, the project's.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError, Option
from ...common.progress import progress
from ...grid.build_scene import stated_facts
from ...grid.open_scene import as_paths
from ...preprocess.scan_description import DEGREE, ScanDescription
from ...readers.formats import open_sources
from ...readers.moved_source import Moves, move_of
from ...work.project import is_project, moves_of, read_project

if TYPE_CHECKING:
    from ...readers.source import Chunk, Source

_SAME_UNIT = 1e-6
"""Relative: the US survey foot differs from the foot by twice this."""


@dataclass(frozen=True, eq=False)
class Cloud:
    """xyz: (n, 3) finite float64.  station: (n,) uint16, rows of ``places``.  places: (S, 3), NaN where a file does not state
    where a station stood.  left_out: points of the files without coordinates.  meta: what the files state."""

    path: Path
    sources: "list[Source]"
    xyz: np.ndarray
    station: np.ndarray
    places: np.ndarray
    left_out: int
    meta: ScanDescription

    @property
    def name(self) -> str:
        return self.path.name or str(self.path)


def opened(path: Path, columns: str | None, moves: Moves | None = None) -> "tuple[list[Source], ScanDescription]":
    """The readers of a scan, or of the scans in a folder, and what they state.  moves: transformations of scans, which the
    readers apply.  Raises InputError."""
    if is_project(path):
        raise InputError("is a project: comparing reads scans", file=path,
                         remedy=("name both scans, and the project with ", Option("--project"), " where it has moved them"))
    files = as_paths(path)
    sources = [source for file in files for source in open_sources([file], columns if _is_text(file) else None, moves)]
    return sources, stated_facts(sources)


def moves_in(project: Path, scans: list[Path]) -> Moves:
    """The transformations that a project keeps of scans.  Raises InputError where it has moved none of them."""
    moves = moves_of(read_project(project).scans)
    if not any(move_of(file, moves) for path in scans for file in as_paths(path)):
        raise InputError("has moved neither of the scans", file=project,
                         remedy=("leave out ", Option("--project"), ", or name a project that `pointglass align` made of them"))
    return moves


def _is_text(path: Path) -> bool:
    from ...readers.formats import takes_columns

    return takes_columns(path)


def check_together(before: Path, of_before: ScanDescription, after: Path, of_after: ScanDescription) -> list[str]:
    """Raises InputError where two scans have different units or reference systems.  Returns what is assumed, lines."""
    for path, meta in ((before, of_before), (after, of_after)):
        if meta.in_degrees or meta.units == DEGREE:
            raise InputError("has its coordinates in degrees; distances need a unit of length", file=path,
                             remedy=("transform it with `pointglass export` ", Option("--reproject", "auto")))
    same = [f"{after.name} is compared with itself"] if before.exists() and after.exists() and before.samefile(after) else []
    one, other = of_before.metres_per_unit, of_after.metres_per_unit
    if one is not None and other is not None and abs(one / other - 1) > _SAME_UNIT:
        raise InputError(f"is in {of_after.units}, {before.name} is in {of_before.units}", file=after,
                         remedy="bring both to one unit, with `pointglass export` and --reproject or at their source")
    if of_before.crs and of_after.crs and of_before.crs != of_after.crs:
        raise InputError(f"has the reference system {of_after.crs}, {before.name} has {of_before.crs}", file=after,
                         remedy=("transform one with `pointglass export` ", Option("--reproject")))
    if (one is None) != (other is None):
        unknown, known = (before, of_after) if one is None else (after, of_before)
        return [*same, f"{unknown.name} states no unit of length; it is taken to be the {known.units} of the other scan"]
    return same


def read_cloud(path: Path, sources: "list[Source]", meta: ScanDescription) -> Cloud:
    """Reads all points.  Raises InputError where a file is damaged; Cancelled."""
    xyz, stations, left_out = [np.zeros((0, 3))], [np.zeros(0, np.uint16)], 0
    total = sum(source.count or 0 for source in sources)
    with progress(total, f"reading {path.name}", "point") as meter:
        for chunk, finite, first in finite_chunks(sources):
            left_out += chunk.invalid + int((~finite).sum())
            xyz.append(chunk.xyz[finite])
            number = np.broadcast_to(np.asarray(chunk.scan, np.int64) + first, len(chunk.xyz))[finite]
            stations.append(np.minimum(number, np.iinfo(np.uint16).max).astype(np.uint16))
            meter.update(len(chunk.xyz))
    places = [scan.position or (np.nan,) * 3 for source in sources for scan in source.scans]
    return Cloud(path, sources, np.concatenate(xyz), np.concatenate(stations), np.array(places, np.float64).reshape(-1, 3),
                 left_out, meta)  # fmt: skip


def finite_chunks(sources: "list[Source]") -> "Iterator[tuple[Chunk, np.ndarray, int]]":
    """Chunks of all files in order, which of their points have coordinates, (n,) bool, and the number of the file's first
    station."""
    first = 0
    for source in sources:
        for chunk in source.chunks():
            yield chunk, np.asarray(np.isfinite(chunk.xyz).all(axis=1)), first
        first += len(source.scans)
