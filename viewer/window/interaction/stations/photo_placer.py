"""Photographs without a pose: where they were taken is searched on a thread, and what is found becomes part of the document.

The rendered views that they are compared with are kept for the next photograph of the same scene.
"""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import ref

from ....commands.photo_placing.photo_search import PhotoSearch, UnplacedPhotograph, accuracy, of_file, of_scan, told
from ....common.errors import InputError
from ....common.text import counted
from ....picture.photographs.placed_photograph import MOST_PLACED, PlacedPhotograph
from ....readers.e57.e57_pictures import StoredPicture
from ....readers.photographs.placed_photographs import posed
from ....readers.photographs.posed_photograph import PosedPhotograph
from ....work.pictures.photo_folder import PHOTO_ENDINGS
from ...kit import icons
from ...kit.theme import fitted
from ...kit.widgets import compact_button, tooltip_beside
from ...kit.worker import Worker
from ..editing import edit, end, ended
from ..tool import ToolContext

if TYPE_CHECKING:
    from ....grid.scene import Scene
    from ....work.document import Document
    from ....work.photo_poses.pose_search import NotFound
    from ....work.photo_poses.reference_views import ReferenceView

EXPLAINED = "compares it with rendered views of the scan; a pose that is found is kept in the project"


class PhotoPlacer:
    """worker: searches at the moment, else None.  said: what the last search found, in words."""

    def __init__(self) -> None:
        self.worker: Worker | None = None
        self.said: list[str] = []
        self._views: tuple[ref[Scene], list[ReferenceView]] | None = None
        self._shown: tuple[PlacedPhotograph, PosedPhotograph] | None = None

    def search(self, context: ToolContext, photographs: Callable[[], list[UnplacedPhotograph]]) -> None:
        """Begins a search.  photographs: reads them, on the thread; raises PointglassError."""
        scene = context.scene
        if scene is None or self.worker is not None:
            return
        views = self._views[1] if self._views is not None and self._views[0]() is scene else None
        document = context.document
        self.worker = Worker(lambda: _searched(scene, document, photographs(), views), "Searching where photographs were taken",
                             context.session.loads.wake)

    def search_stored(self, context: ToolContext, stored: StoredPicture) -> None:
        """Searches a photograph of the scan."""
        self.search(context, lambda: [of_scan(stored)])

    def add(self, context: ToolContext) -> None:
        """Asks for photographs, and searches them."""
        context.files.open("photographs", "Find where photographs were taken", {"Photographs": PHOTO_ENDINGS},
                           lambda files: self.search(context, lambda: [of_file(Path(file)) for file in files]), many=True)

    def search_folder(self, context: ToolContext) -> None:
        """Searches the photographs of a folder without cameras that the settings name, once the scan is complete; but those
        that the document has."""
        session = context.session
        folder = session.view_settings.photo_folder
        if not folder.unplaced or session.shown_scan.preview or session.loads.current is not None or self.worker is not None:
            return
        known = {Path(photo.path).absolute() for photo in context.document.photographs}
        wanted = [path for path in folder.take_unplaced() if path not in known]
        room = MOST_PLACED - len(known)
        if len(wanted) > room:
            context.toast(f"Of {counted(len(wanted), 'photograph')} {room} are searched: a project holds {MOST_PLACED}")
        if wanted[:room]:
            self.search(context, lambda: [of_file(path) for path in wanted[:room]])

    def follow(self, context: ToolContext) -> None:
        """Takes the result of a search that has ended."""
        if (done := ended(self.worker, context, "Where a photograph was taken cannot be searched")) is None:
            return
        self.worker = None
        if done.result is None or done.cancelled:
            return
        scene, views, found = done.result
        self._views = (ref(scene), views) if views is not None else self._views
        self.said = [told(one, name, scene.meta.metres_per_unit) for name, one in found]
        placed = [one for _, one in found if isinstance(one, PlacedPhotograph)]
        if scene is not context.scene:
            return
        if placed:
            new = {(one.path, one.number) for one in placed}
            kept = (one for one in context.document.photographs if (one.path, one.number) not in new)
            edit(context, f"Place {counted(len(placed), 'photograph')}", photographs=(*kept, *placed))
            self.show(context, placed[-1])
        context.toast(self.said[0] if len(self.said) == 1 else f"{len(placed)} of {counted(len(found), 'photograph')} placed")

    def show(self, context: ToolContext, placed: PlacedPhotograph) -> None:
        """Stands where it was taken, with the photograph over the view."""
        from .stand_at_photo import show_photo

        if self._shown is None or self._shown[0] != placed:
            self._shown = placed, posed(placed)
        show_photo(context, self._shown[1])

    def draw(self, ui: Any, context: ToolContext, viewed: StoredPicture | None) -> None:
        """The placed photographs, and the buttons that search.  viewed: the photograph of the scan that is looked at."""
        metre = None if context.scene is None else context.scene.meta.metres_per_unit
        if context.document.photographs:
            ui.text_unformatted("Photographs placed by search")
        for number, placed in enumerate(context.document.photographs):
            ui.push_id(8000 + number)
            text = f"{placed.name}{accuracy(placed, metre)}"
            shown = self._shown is not None and self._shown[0] == placed and _is_over(context, self._shown[1])
            if ui.selectable(fitted(text, ui.get_content_region_avail().x - 40), shown, 0,
                             (max(ui.get_content_region_avail().x - 40, 1), 0))[0]:  # fmt: skip
                self.show(context, placed)
            if ui.is_item_hovered():
                tooltip_beside(ui, f"{told(placed, placed.name, metre)}. A click shows it in its place")
            ui.same_line()
            if compact_button(icons.REMOVE, context.theme):
                kept = tuple(one for one in context.document.photographs if one is not placed)
                edit(context, f"Remove the pose of {placed.name}", photographs=kept)
            ui.pop_id()
        if self.worker is not None:
            ui.text_wrapped("Searching where photographs were taken…")
        ui.begin_disabled(self.worker is not None)
        if viewed is not None and not viewed.placed and ui.button("Find where it was taken"):
            self.search_stored(context, viewed)
        if ui.button("Place photographs…"):
            self.add(context)
        ui.end_disabled()
        if ui.is_item_hovered():
            tooltip_beside(ui, f"JPEG or PNG: {EXPLAINED}")
        for line in self.said:
            ui.text_wrapped(line)

    def close(self) -> None:
        """Ends a search."""
        end(self.worker)


def _is_over(context: ToolContext, photo: PosedPhotograph) -> bool:
    return (shown := context.session.work.photo) is not None and shown.photo is photo


def _searched(scene: "Scene", document: "Document", photographs: list[UnplacedPhotograph], views: "list[ReferenceView] | None"
              ) -> "tuple[Scene, list[ReferenceView] | None, list[tuple[str, PlacedPhotograph | NotFound]]]":
    """On a thread, with an OpenGL context of its own."""
    from ....render.device.context import create_context
    from ....render.renderer import Renderer

    context = create_context()
    try:
        renderer = Renderer(context, scene)
        try:
            search = PhotoSearch(renderer, document)
            search.views = views
            found = [(photo.name, _found(search, photo, alone=len(photographs) == 1)) for photo in photographs]
            return scene, search.views, found
        finally:
            renderer.release()
    finally:
        context.release()


def _found(search: PhotoSearch, photo: UnplacedPhotograph, *, alone: bool) -> "PlacedPhotograph | NotFound":
    """Of several photographs, one that is damaged does not stop the others."""
    from ....work.photo_poses.picture_features import opencv
    from ....work.photo_poses.pose_search import NotFound

    try:
        return search.find(photo)
    except InputError as error:
        if alone:
            raise
        opencv()  # raises where that is what is missing
        return NotFound(str(error))
