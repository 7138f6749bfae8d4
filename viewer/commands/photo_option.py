"""The folder that ``--photos`` names, read for a renderer."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..picture.settings import Settings
    from ..readers.posed_photograph import PosedPhotograph
    from ..render.renderer import Renderer


def photographs_of_folder(settings: "Settings") -> "list[PosedPhotograph] | None":
    """The photographs of the folder that the settings name; None where they name none.  Raises InputError."""
    if settings.photos in ("auto", "off"):
        return None
    from ..work.pictures.photo_folder import photographs_in

    return photographs_in(Path(settings.photos))


def give_photographs(renderer: "Renderer", settings: "Settings", photographs: "list[PosedPhotograph] | None") -> None:
    """Has a renderer use them."""
    if photographs is not None:
        renderer.photographs.give(settings.photos, photographs)


def use_photographs(renderer: "Renderer", settings: "Settings") -> None:
    """Has a renderer use the photographs of the folder that the settings name, read once.  Raises InputError."""
    if not renderer.photographs.knows(settings.photos):
        give_photographs(renderer, settings, photographs_of_folder(settings))
