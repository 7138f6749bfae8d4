"""The transformations of a document's scans by the files of a scene, and the document with another one for a file.

A scan of a document may be a folder of several files; where one of them is moved alone, each gets an entry of its own.
Frame: a transformation leads from the file's own coordinates to those of the document.
"""

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.rigid_transform import IDENTITY, Rows
from ...readers.moved_source import move_of
from ...readers.remote.local_copies import local_file
from ..document import ScanFile
from ..project import moves_of
from ..scan_files import FilePart

if TYPE_CHECKING:
    from ...grid.scene import Scene

MOST_POINTS = 2_000_000
"""Points of a scan that are compared with another one: 30 for each voxel of viewer.work.registration.icp_clouds."""
_MOST_READ = 24_000_000
"""Points of a scene among which those of one file are looked for, the coarsest layers first: 0.3 GB of packed points."""


def transforms_of(scans: Sequence[ScanFile], sources: Sequence[str]) -> tuple[Rows | None, ...]:
    """The transformation that a document has of each file of a scene; None: it stays."""
    moves = moves_of(scans)
    return tuple(move_of(Path(source), moves) for source in sources)


def with_transform(scans: Sequence[ScanFile], sources: Sequence[str], number: int,
                   transform: Rows | None, unsure: float | None = None) -> tuple[ScanFile, ...]:
    """The scans of a document in which the file of this number, among the files of the scene, has a transformation; the
    identity counts as none.  unsure: of that place, as ScanFile has it."""
    transform, unsure = (None, None) if transform in (None, IDENTITY) else (transform, unsure)
    chosen = sources[number]
    found: list[ScanFile] = []
    for scan in scans:
        inside = [source for source in sources if is_of(source, scan.path)]
        if chosen not in inside:
            found.append(scan)
        elif len(inside) == 1:
            found.append(replace(scan, transform=transform, unsure=unsure))
        else:
            found += [replace(scan, path=source, transform=transform, unsure=unsure) if source == chosen else
                      replace(scan, path=source) for source in inside]
    return tuple(found)


def unsure_of(scans: Iterable[ScanFile], path: Path) -> float | None:
    """Uncertainty (95 %) of the place of a file, or of a folder of files, in a document: the largest of its scans.  0 where it
    stays as it is; None where it was moved and nothing states how certain that is."""
    moved = [scan.unsure for scan in scans if scan.transform is not None
             and (is_of(scan.path, str(path)) or is_of(str(path), scan.path))]
    known = [unsure for unsure in moved if unsure is not None]
    return None if len(known) < len(moved) else max(known, default=0.0)


def is_of(source: str, path: str) -> bool:
    """Whether a file is a scan of a document, or lies in its folder.  Of an address its copy counts."""
    real, scan = (os.path.realpath(local_file(Path(name), fetch=False)) for name in (source, path))
    return scan in (real, os.path.dirname(real))


def points_of(scene: "Scene", parts: Sequence[FilePart], most: int = MOST_POINTS) -> np.ndarray:
    """(n, 3) float64 points of some files of a scene, document coordinates, at most about ``most``: an even choice of them."""
    from ...grid.scene import packed, positions, scan_numbers

    wanted = np.zeros(256, bool)
    for part in parts:
        wanted[[number for number in part.numbers if number < 256]] = True
    found, count, step = [np.zeros((0, 3))], 0, 1 << 20
    for start in range(0, min(scene.count, _MOST_READ), step):
        rows = np.arange(start, min(start + step, scene.count))
        words = packed(scene, rows)
        kept = np.flatnonzero(wanted[scan_numbers(words)])[: most - count]
        found.append(positions(scene, words[kept], rows[kept]))
        count += len(kept)
        if count >= most:
            break
    return np.concatenate(found)
