"""Scans or a project from the command line, opened for a tool that works on measured points: export and sections."""

import argparse
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..common.errors import InputError
from ..readers.meshes.mesh_formats import scans_and_meshes
from ..work.document import Document, ScanFile
from ..work.ghosts import prepared
from ..work.moved_scans import difference
from ..work.project import check_projects, is_project, moves_of, places_in, read_project, scans_of
from ..work.reference import with_reference
from .mesh_files import layers_of

if TYPE_CHECKING:
    from ..common.workers.worker_choice import Workers
    from ..grid.scene import Scene
    from ..picture.camera import Camera

_log = logging.getLogger(__name__)


def opened(options: argparse.Namespace, *, match: bool | None = None, writes: bool = False, meshes: bool = False,
           workers: "Workers | None" = None, cameras: "Callable[[Document], Sequence[Camera]] | None" = None,
           say: bool = True) -> "tuple[Scene, Document]":  # fmt: skip
    """The scene of ``options.scans`` and its document: that of the project, or an empty one for scans.

    options: as viewer.commands.options.add_scans and add_exposures make them.  match: as for open_scene; None: as ``options``
    say.  writes: whether points are written by the regions and classes of the project.  A warning names each scan that is
    another file than the project was saved with.  meshes: whether meshes may be given beside scans; they join the document.
    workers: who converts the files of a place.  cameras: of a document, those of all pictures, as for
    viewer.stream.scene_in_view, as ``say`` is; None: all points are read.
    Raises InputError where a project is damaged, holds no visible scan, or is not alone, or assigns a reference system that is
    not known, and, with ``writes``, where regions or classes are of another file.
    """
    from ..stream.scene_in_view import open_scene_for

    given, models = scans_and_meshes(options.scans) if meshes else (list(options.scans), [])
    check_projects(given)
    if is_project(given[0]):
        document = read_project(given[0])
        scans = scans_of(given[0], document)
        _tell_of_replaced(given[0], document, writes)
    else:
        document, scans = Document(tuple(ScanFile(str(path)) for path in given)), given
    matched = bool(options.exposures == "matched") if match is None else match
    plain = replace(document.edits, meshes=(), photographs=()).none  # others name points by their numbers in the file
    scene = open_scene_for(scans, cameras(document) if cameras is not None and plain else (), cache=not options.no_cache,
                           match=matched, columns=options.columns, moves=moves_of(document.scans), workers=workers, say=say)
    scene = prepared(scene, document.ghosts)
    scene = replace(scene, meta=with_reference(scene.meta, document.scans))
    return scene, replace(document, meshes=(*document.meshes, *layers_of(models, scene))) if models else document


def _tell_of_replaced(project: Path, document: Document, writes: bool) -> None:
    """Points of regions and classes are kept by their numbers in the file: in another file these may be other points."""
    places, has_sets = places_in(project), bool(document.regions or document.reclassified)
    for scan in document.scans:
        if scan.visible and (why := difference(Path(scan.path), scan.path, places[scan.path])):
            said = f"the project was saved with another file of this name. {why}"
            if has_sets and writes:
                raise InputError(f"{said} Its regions and classes may hold other points now", file=scan.path,
                                 remedy="look at them in the window and save the project")
            which = " Its regions and classes may hold other points now: look at them in the window." if has_sets else ""
            _log.warning("%s: %s%s", scan.path, said, which)


def project_scene(options: argparse.Namespace) -> "Scene":
    """The scene of ``pointglass info`` of the scans of a project, with the unit and reference system that it assigns.

    Raises InputError as :func:`opened`.
    """
    from .info import scene_of

    check_projects(list(options.scans))
    document = read_project(options.scans[0])
    scans = scans_of(options.scans[0], document)
    return scene_of(scans, cache=not options.no_cache, columns=options.columns, assigned=document.scans)
