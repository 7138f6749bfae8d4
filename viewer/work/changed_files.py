"""The scans of a document after files were added to its scene or removed from it.

Stations are hidden by their numbers in the scene, which follow the order of the files.
"""

import os
from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

from ..grid.cache import load_folder
from ..readers.grid_folder import is_grid
from ..readers.remote.local_copies import local_file
from .document import Document, ScanFile
from .registration.moved_files import is_of
from .scan_files import FilePart


def with_files(document: Document, paths: Iterable[Path]) -> Document:
    """The document with more scans behind those it has; a scan that it has is not added again, one that was not visible is."""
    scans, known = list(document.scans), {os.path.realpath(scan.path): number for number, scan in enumerate(document.scans)}
    for path in paths:
        number = known.setdefault(os.path.realpath(path), len(scans))
        scans[number:number + 1] = [replace(scans[number], visible=True) if number < len(scans) else ScanFile(str(path))]
    return replace(document, scans=tuple(scans))


def without_file(document: Document, parts: Sequence[FilePart], number: int) -> Document:
    """The document without one of the files of its scene.  parts: of the scene.  A scan that is a folder becomes its files;
    a folder made by ``convert`` goes where it was made from that file alone, else the document stays as it is."""
    gone, scans = parts[number], []
    for scan in document.scans:
        if is_grid(Path(scan.path)):
            held = load_folder(Path(scan.path)).meta.sources
            if gone.path in held and len(held) > 1:
                return document
            if gone.path not in held:
                scans.append(scan)
            continue
        here = str(local_file(Path(scan.path), fetch=False))  # of an address its copy, from which the scene was read
        inside = [part.path for part in parts if is_of(part.path, here)]
        if gone.path not in inside:
            scans.append(scan)
        elif len(inside) > 1:
            scans += [replace(scan, path=path) for path in inside if path != gone.path]
    hidden = [station if station < gone.numbers.start else station - len(gone.numbers)
              for station in document.hidden_stations if station not in gone.numbers]
    return replace(document, scans=tuple(scans), hidden_stations=tuple(hidden))
