"""The project file, ``.pointglass``: one JSON file with a Document in it, opened exactly as it was left.

``{"pointglass_project": 1, "document": {...}, "places": [...]}``; the document's keys are the fields of viewer.work.document,
clips carry their ``type``.  Paths of scans, of weights, of photographs and of the pictures of notes are relative to the project
file, with ``/``, where at most two folders up lead to them; else absolute.  ``places`` has both kinds of path of each scan, its
size and a checksum (viewer.work.moved_scans).  Numbers keep all 17 digits: reading gives the same values.  A scan that was
moved has ``transform``, the four rows of the rigid matrix from its file's coordinates to the document's; others lack the key.
"""

import contextlib
import dataclasses
import hashlib
import json
import logging
import os
import typing
from pathlib import Path

from ...model.common.files.atomic_write import write_atomic
from ..common.errors import InputError
from ..common.rigid_transform import Rows
from ..picture.json_values import from_json, to_json
from ..readers.remote.address import address_in, is_address
from ..readers.remote.local_copies import local_file
from .document import Document, ScanFile, with_whole_names
from .meshes.laid_meshes import found_mesh
from .moved_scans import MissingScans, ScanPlace, found_scan, place_of, places_from

SUFFIX = ".pointglass"
VERSION = 1
MOST_UP = 2
"""Folders up to a scan, of a stored relative path: a scan farther away is not moved together with the project."""
LARGEST = 64 << 20
"""Bytes; a project holds no points."""
_log = logging.getLogger(__name__)
_told: set[tuple[Path, str]] = set()
"""Scans that have moved, by project, of which a warning was given."""


def is_project(path: Path) -> bool:
    """Whether a path is called a project file."""
    return path.suffix.lower() == SUFFIX


def project_beside(document: Document) -> Path:
    """Where a new project of a document, which has scans, is saved: beside the first one, under its name."""
    first = Path(document.scans[0].path)
    return first.with_name(first.stem + SUFFIX)


def write_project(path: Path, document: Document, known: typing.Mapping[str, ScanPlace] | None = None) -> None:
    """Writes a document so that an older file stays as it was on any failure.  known: absolute path of a scan -> what was last
    recorded of it, which is kept where the scan is not there now.  Raises InputError naming the file."""
    places = [dataclasses.asdict(place_of(scan.path, path, (known or {}).get(os.path.abspath(scan.path))))
              for scan in document.scans]
    data = {"pointglass_project": VERSION, "document": to_json(with_paths(document, lambda p: _relative(p, path.parent))),
            "places": places}
    text = json.dumps(data, indent=1, allow_nan=False) + "\n"
    try:
        write_atomic(path, lambda beside: write_durably(beside, text))
    except OSError as error:
        raise InputError(f"cannot be written ({error.strerror or error})", file=path,
                         remedy="save the project elsewhere") from None


def write_durably(path: Path, text: str) -> None:
    """Writes a text and waits until the disk has it: a rename that follows survives a power failure.  Raises OSError."""
    with path.open("w", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        os.fsync(file.fileno())


def digest_of(path: Path) -> str:
    """SHA-256 of a file, which tells whether another program has changed it; "" where it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""


def read_project(path: Path) -> Document:
    """The document of a project file; paths of scans are absolute, or relative to the working directory, as ``path`` is.

    A scan that has moved is found where viewer.work.moved_scans looks for it, and a warning says where.  Raises InputError in
    one line that names the file, the place in it and the bad value.  Scans that are not found are no error here: the window
    asks for them, and scans_of refuses them.
    """
    return _read(path)[0]


def places_in(path: Path) -> dict[str, ScanPlace]:
    """What a project file tells about the places of its scans: path as in read_project -> place.  Raises as read_project."""
    return _read(path)[1]


def _read(path: Path) -> tuple[Document, dict[str, ScanPlace]]:
    try:
        if path.stat().st_size > LARGEST:
            raise InputError(f"{path.stat().st_size} bytes are too many for a project file; is it a scan?", file=path)
        data = json.loads(path.read_bytes().decode("utf-8"))
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror or error})", file=path) from None
    except (ValueError, RecursionError) as error:  # not UTF-8, not JSON
        raise InputError(f"no project file, or a damaged one ({' '.join(str(error).split())[:120]})", file=path) from None
    if not isinstance(data, dict) or "pointglass_project" not in data:
        raise InputError('no project file: it has no "pointglass_project"', file=path)
    version = data["pointglass_project"]
    if type(version) is not int or version < 1:
        raise InputError(f"pointglass_project {version!r}: expected a version number", file=path)
    if version > VERSION:
        raise InputError(f"a project of version {version}, this program reads up to {VERSION}", file=path,
                         remedy="update pointglass")
    try:
        document = document_from_json(data.get("document"))
    except InputError as error:
        raise InputError((error,), file=path) from None
    document = with_paths(document, lambda p: p if is_address(p) else str(path.parent / p))
    found, places = [], places_from(data.get("places"))
    for scan, place in zip(document.scans, places + [ScanPlace()] * len(document.scans)):
        there = str(found_scan(path, scan.path, place))
        if there != scan.path and (path, there) not in _told:
            _told.add((path, there))
            _log.warning("%s: its scan %s is not there any more; found as %s", path, scan.path, there)
        found.append((dataclasses.replace(scan, path=there), place))
    scans, meshes = tuple(scan for scan, _ in found), tuple(found_mesh(layer, path.parent) for layer in document.meshes)
    return dataclasses.replace(document, scans=scans, meshes=meshes), {scan.path: place for scan, place in found}


def scans_of(path: Path, document: Document) -> list[Path]:
    """The visible scans of a project read from ``path``.  Raises InputError where there is none, MissingScans where
    some are not there."""
    scans = [Path(scan.path) for scan in document.scans if scan.visible]
    if not scans:
        raise InputError("no scan of this project is visible; nothing to open", file=path)
    if missing := [scan for scan in scans if not (scan.exists() or is_address(scan))]:
        raise MissingScans(path, missing)
    return scans


def moves_of(scans: typing.Iterable[ScanFile]) -> dict[str, Rows]:
    """The transformations of the scans of a document that have been moved, by real path (viewer.readers.moved_source)."""
    return {os.path.realpath(local_file(Path(scan.path), fetch=False)): scan.transform for scan in scans
            if scan.transform is not None}


def check_projects(paths: list[Path], *, ask: bool = False) -> None:
    """Raises InputError where the project among ``paths`` cannot be opened, or is not alone; MissingScans as scans_of, unless
    somebody can be asked where they are."""
    if (project := project_among(paths)) is not None:
        with contextlib.suppress(*([MissingScans] if ask else [])):
            scans_of(project, read_project(project))


def project_among(paths: typing.Sequence[Path]) -> Path | None:
    """The project that ``paths`` is, None where they are scans.  Raises InputError where a project is not alone."""
    projects = [path for path in paths if is_project(path)]
    if projects and len(paths) > 1:
        raise InputError("a project is opened by itself, not together with other files", file=projects[0])
    return projects[0] if projects else None


def relocated(document: Document, located: typing.Mapping[str, str | None]) -> Document:
    """The document with other paths for some scans.  located: path in the document -> where that scan is; None: it is left
    out, that is not visible."""
    scans = [dataclasses.replace(scan, path=located[scan.path] or scan.path,
                                 visible=scan.visible and located[scan.path] is not None)
             if scan.path in located else scan for scan in document.scans]
    return dataclasses.replace(document, scans=tuple(scans))


def document_from_json(data) -> Document:
    """The document in a parsed project file.  Raises InputError naming the place in it."""
    return with_whole_names(from_json(Document, data, "document"))


def _relative(path: str, folder: Path) -> str:
    """A path as the project file stores it: relative to ``folder`` where at most MOST_UP folders up lead to it; of an
    address without a signature."""
    if (address := address_in(path)) is not None:
        return address.kept
    whole, base = Path(os.path.abspath(path)), Path(os.path.abspath(folder))
    for up, parent in enumerate((base, *base.parents)):
        if up <= MOST_UP and whole.is_relative_to(parent) and parent != parent.parent:
            return "/".join([".."] * up + list(whole.relative_to(parent).parts)) or "."
    return whole.as_posix()


def with_paths(document: Document, change: typing.Callable[[str], str]) -> Document:
    """The document with every path of a file changed."""
    scans = tuple(dataclasses.replace(scan, path=change(scan.path)) for scan in document.scans)
    settings = document.settings
    if settings.weights is not None:
        settings = dataclasses.replace(settings, weights=change(settings.weights))
    if settings.photos not in ("auto", "off"):
        settings = dataclasses.replace(settings, photos=change(settings.photos))
    notes = tuple(dataclasses.replace(note, picture=change(note.picture)) if note.picture else note
                  for note in document.annotations)
    meshes = tuple(dataclasses.replace(layer, path=change(layer.path)) for layer in document.meshes)
    photographs = tuple(dataclasses.replace(photo, path=change(photo.path)) for photo in document.photographs)
    return dataclasses.replace(document, scans=scans, settings=settings, annotations=notes, meshes=meshes,
                               photographs=photographs)
