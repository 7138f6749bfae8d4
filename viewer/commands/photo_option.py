"""The folder that ``--photos`` names, read for a renderer."""

import logging
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

from ..common.errors import InputError

if TYPE_CHECKING:
    from ..picture.settings import Settings
    from ..readers.photographs.posed_photograph import PosedPhotograph
    from ..render.renderer import Renderer

Photographs: TypeAlias = "list[PosedPhotograph] | UnplacedFolder"
"""Those of a folder, with their cameras or without."""
_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class UnplacedFolder:
    """Photographs without cameras: where they were taken is searched in the scan.  paths: their files."""

    folder: Path
    paths: tuple[Path, ...]


def photographs_of_folder(settings: "Settings") -> "Photographs | None":
    """The photographs of the folder that the settings name; None where they name none.  Those without cameras that cannot be
    read are left out and named.  Raises InputError where none is left."""
    if settings.photos in ("auto", "off"):
        return None
    from ..work.pictures.photo_folder import decodable, photographs_in, without_cameras

    folder = Path(settings.photos)
    if paths := without_cameras(folder):
        kept, errors = decodable(paths)
        if not kept:
            raise InputError(f"holds no photograph that can be read; of the first: {errors[0]}", file=folder)
        for error in errors:
            _log.warning("%s; left out", error)
        return UnplacedFolder(folder, tuple(kept))
    return photographs_in(folder)


def check_photographs(settings: "Settings") -> None:
    """Raises InputError where the settings name a folder that holds no photographs."""
    from ..work.pictures.photo_folder import photographs_in, without_cameras

    if settings.photos not in ("auto", "off") and not without_cameras(folder := Path(settings.photos)):
        photographs_in(folder, tell=False)  # whoever uses them tells


def give_photographs(renderer: "Renderer", settings: "Settings", photographs: "Photographs | None") -> None:
    """Has a renderer use them.  Raises InputError where none of a folder without cameras is found in the scan."""
    if isinstance(photographs, UnplacedFolder):
        photographs = _placed(renderer, photographs)
    if photographs is not None:
        renderer.photographs.give(settings.photos, photographs)


def _placed(renderer: "Renderer", unplaced: UnplacedFolder) -> "list[PosedPhotograph]":
    from ..picture.photographs.placed_photograph import PlacedPhotograph
    from ..readers.photographs.placed_photographs import posed
    from ..work.document import Document
    from .photo_placing.photo_search import PhotoSearch, of_file, told

    search, placed, metre = PhotoSearch(renderer, Document()), [], renderer.scene.meta.metres_per_unit
    for path in unplaced.paths:
        found = search.find(of_file(path))
        if isinstance(found, PlacedPhotograph):
            placed.append(posed(found))
            print(f"pointglass: {told(found, str(path), metre)}", file=sys.stderr)
        else:
            _log.warning("%s", told(found, str(path), metre))
    if not placed:
        raise InputError("where its photographs were taken was not found in the scan", file=unplaced.folder,
                         remedy="add transforms.json or a COLMAP model in the scan's coordinates")
    return placed


def use_photographs(renderer: "Renderer", settings: "Settings") -> None:
    """Has a renderer use the photographs of the folder that the settings name, read once.  Raises InputError."""
    if not renderer.photographs.knows(settings.photos):
        give_photographs(renderer, settings, photographs_of_folder(settings))
