"""The folder of photographs that the settings name (``--photos FOLDER``), given to the renderers of a window.

Photographs with cameras are read once and colour pictures from then on.  Those of a folder without cameras wait here until the
Stations tool searches where they were taken; a pose that is found becomes part of the document.
"""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ...readers.photographs.posed_photograph import PosedPhotograph
    from ...render.renderer import Renderer


class PhotoFolder:
    """name: the value of Settings.photos that names the folder; "" before one is read.  photographs: those with cameras.
    unplaced: absolute paths of those without, until they are taken for a search."""

    def __init__(self) -> None:
        self.name = ""
        self.photographs: list[PosedPhotograph] = []
        self.unplaced: list[Path] = []

    def give(self, renderer: "Renderer", photos: str) -> None:
        """Has a renderer use what ``photos``, a value of Settings.photos, means.  Raises InputError where it is a folder that
        cannot be read."""
        if renderer.photographs.knows(photos):
            return
        if photos != self.name:
            self.photographs, unplaced = read_folder(photos)
            self.name, self.unplaced = photos, [path.absolute() for path in unplaced]
        renderer.photographs.give(photos, self.photographs)

    def take_unplaced(self) -> list[Path]:
        """The photographs to be searched, once."""
        taken, self.unplaced = self.unplaced, []
        return taken


def read_folder(photos: str) -> "tuple[list[PosedPhotograph], list[Path]]":
    """The photographs of a folder, those that have cameras or the paths of those that have none.  Raises InputError."""
    from ...work.pictures.photo_folder import photographs_in, without_cameras

    folder = Path(photos)
    unplaced = without_cameras(folder)
    return ([] if unplaced else photographs_in(folder)), unplaced


def give_folder(renderer: "Renderer", photos: str) -> None:
    """Has the renderer of a job use what ``photos`` means; poses that were found are in the document.  Raises InputError."""
    PhotoFolder().give(renderer, photos)
