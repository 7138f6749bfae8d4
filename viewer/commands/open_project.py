"""Scans or a project from the command line, opened for a tool that works on measured points: export and sections."""

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING

from ..work.document import Document, ScanFile
from ..work.ghosts import prepared
from ..work.project import check_projects, is_project, moves_of, read_project, scans_of
from ..work.reference import with_reference

if TYPE_CHECKING:
    from ..grid.scene import Scene


def opened(options: argparse.Namespace, *, match: bool | None = None) -> "tuple[Scene, Document]":
    """The scene of ``options.scans`` and its document: that of the project, or an empty one for scans.

    options: as viewer.commands.options.add_scans and add_exposures make them.  match: as for open_scene; None: as ``options``
    say.  Raises InputError where a project is damaged, holds no visible scan, or is not alone, or assigns a reference system
    that is not known.
    """
    from ..grid.open_scene import open_scene

    check_projects(list(options.scans))
    if is_project(options.scans[0]):
        document = read_project(options.scans[0])
        scans = scans_of(options.scans[0], document)
    else:
        document, scans = Document(tuple(ScanFile(str(path)) for path in options.scans)), list(options.scans)
    matched = bool(options.exposures == "matched") if match is None else match
    scene = open_scene(scans, cache=not options.no_cache, match=matched, columns=options.columns,
                       moves=moves_of(document.scans))
    scene = prepared(scene, document.ghosts)
    return replace(scene, meta=with_reference(scene.meta, document.scans)), document


def project_scene(options: argparse.Namespace) -> "Scene":
    """The scene of ``pointglass info`` of the scans of a project, with the unit and reference system that it assigns.

    Raises InputError as :func:`opened`.
    """
    from .info import scene_of

    check_projects(list(options.scans))
    document = read_project(options.scans[0])
    scans = scans_of(options.scans[0], document)
    return scene_of(scans, cache=not options.no_cache, columns=options.columns, assigned=document.scans)
