"""Stations: markers where the scanner stood, a click to stand there, and the photographs that an E57 holds, in place.

A photograph is laid over the view from its own place: blended, or split against it, with the PSNR between the two.  Walking
away fades it out into the view.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from weakref import ref

import numpy as np

from ....common.rigid_transform import Rows
from ....readers.e57.e57_photographs import posed_photographs
from ....readers.e57.e57_pictures import StoredPicture, stored_pictures
from ....readers.moved_source import move_of, moved_pose, moves_at
from ....readers.photographs.posed_photograph import PosedPhotograph
from ....work.places.pick import station_name
from ...kit import icons
from ...kit.theme import fitted
from ...kit.widgets import tooltip_beside
from ...kit.worker import Worker
from ..editing import edit
from ..outline import Group, Row
from ..tool import KeyEvent, PointerEvent, Tool, ToolContext
from .ghosts_panel import GhostsPanel
from .next_place import AT_PLACE, KEYS, places_of, step, step_buttons
from .photo_panel import draw_photographs
from .photo_placer import PhotoPlacer
from .photo_switch import about_view
from .picture_viewer import PictureViewer
from .stand_at_photo import show_photo, stand_at

if TYPE_CHECKING:
    from ....grid.scene import Scene
    from ...kit.overlay import OverlayCanvas

GRIP = 16.0
"""Logical pixels around a marker that a click takes."""


MOST_PARTS = 255
"""Files and stations that a packed point can number."""


def show_station(context: ToolContext, number: int, name: str, on: bool) -> None:
    """Shows or hides the points of a file or station, as a step that can be undone."""
    kept = tuple(other for other in context.document.hidden_stations if other != number)
    edit(context, f"{'Show' if on else 'Hide'} {name}", hidden_stations=kept if on else (*kept, number))


def _photographs(file: Path, transform: Rows | None
                 ) -> tuple[list[StoredPicture], dict[PosedPhotograph, StoredPicture | None], list[str]]:
    """The pictures of an E57; those with a geometry at their places in the document, each with the picture that it is; and
    warnings.  transform: of the file."""
    photos, warnings = posed_photographs(file)
    stored = stored_pictures(file)
    by_number: dict[int | None, StoredPicture] = {picture.number: picture for picture in stored}
    moved = {replace(photo, camera_to_world=moved_pose(transform, photo.camera_to_world)): by_number.get(photo.number)
             for photo in photos}
    return stored, moved, warnings


def parts_of(scene: "Scene") -> list[tuple[int, str]]:
    """(number, name) of the files and stations that can be hidden: all, where there are two or more or a position is known.

    Ghosts have a list of their own.
    """
    ghosts = scene.marked.station if scene.marked is not None else -1
    count = min(len(scene.meta.scans), MOST_PARTS)
    parts = [(number, station_name(scene, number)) for number in range(count) if number != ghosts]
    return parts if len(parts) > 1 or places_of(scene) else []


class Stations(Tool):
    """Its panel lists files, stations and photographs."""

    name, label, icon, key = "stations", "Stations", icons.STATIONS, "P"
    help = "stand at scanner positions, photographs; PageUp, PageDown: others"
    takes_clicks = True

    def __init__(self) -> None:
        self._of: tuple | None = None  # the files whose photographs are read, whether as a preview, and their transformations
        self._read: Worker | None = None
        self._selected = False  # whether the tool is selected
        self._listed: tuple[ref[Scene], list[tuple[int, str]], dict[int, np.ndarray]] | None = None  # of the scene shown
        self.ghosts = GhostsPanel()
        self.photos: list[PosedPhotograph] = []
        self.stored: dict[PosedPhotograph, StoredPicture | None] = {}  # each of them by itself
        self.warnings: list[str] = []
        self.pictures: list[StoredPicture] = []  # all of the scan, also those without a pose
        self.viewer = PictureViewer()
        self.placer = PhotoPlacer()

    def selected(self, context: ToolContext) -> None:
        self._selected = True

    def left(self, context: ToolContext) -> None:
        self._selected, context.session.work.photo = False, None
        self.viewer.close_picture()

    def follow(self, context: ToolContext) -> None:
        if self._selected:
            self._follow(context)
        self.ghosts.follow(context)
        self.viewer.follow()
        self.placer.search_folder(context)
        self.placer.follow(context)

    @property
    def reading(self) -> bool:
        """Whether photographs are being read."""
        return self._read is not None

    @property
    def workers(self) -> tuple[Worker | None, ...]:
        return (self.ghosts.search, self.placer.worker)

    def close(self) -> None:
        self.ghosts.close()
        self.viewer.close()
        self.placer.close()

    def key_event(self, event: KeyEvent, context: ToolContext) -> bool:
        if event.key in KEYS and event.kind in ("press", "repeat"):
            step(self, context, KEYS[event.key])
            return True
        if event.kind != "press" or event.key != "ESCAPE" or self.viewer.viewed is None:
            return False
        self.viewer.close_picture()
        return True

    def _follow(self, context: ToolContext) -> None:
        """Reads the photographs of the scan shown, once, on a thread of its own."""
        shown, meta = context.session.shown_scan, context.session.facts
        moves = moves_at([Path(file) for file in meta.sources], meta.records.moves if meta.records is not None else ())
        folder = context.session.view_settings.photo_folder
        if self._of != (of := (shown.paths, shown.preview, moves, folder.name)):
            self._of, self.photos, self.warnings, self._read = of, [*folder.photographs], [], None
            self.pictures, self.stored, context.session.work.photo = [], {}, None
            self.viewer.close_picture()
            files = [Path(path) for path in context.session.shown_scan.paths if Path(path).suffix.lower() == ".e57"]
            if files and not context.session.shown_scan.preview:
                self._read = Worker(lambda: [_photographs(file, move_of(file, moves)) for file in files],
                                    "Reading photographs", context.session.loads.wake)
        if self._read is not None and self._read.finished:
            done, self._read = self._read, None
            if done.error is not None:
                self.warnings = [str(done.error)]
            for pictures, photos, warnings in done.result or []:
                self.pictures += pictures
                self.photos += photos
                self.stored |= photos
                self.warnings += warnings

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        if event.kind != "release" or event.button != "left" or event.clicks != 1 or context.scene is None:
            return False
        found = places_of(context.scene)
        if not found:
            return False
        pixels, _ = context.camera.project([place for _, _, place, _ in found])
        with np.errstate(invalid="ignore"):
            away = np.nan_to_num(np.linalg.norm(pixels - event.position, axis=1), nan=np.inf)
        nearest = int(away.argmin())
        if away[nearest] <= context.pixels(GRIP):
            stand_at(context, found[nearest][2])
            context.toast(f"Standing at {found[nearest][1]}")
        return False

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        if context.scene is None:
            return
        at_eye = AT_PLACE * np.ptp(context.scene.bounds, axis=0).max()  # a marker there would hide the picture
        found = [(place, f"{name} (inferred)" if inferred else name, inferred)
                 for _, name, place, inferred in places_of(context.scene)
                 if np.linalg.norm(place - context.camera.position) >= at_eye]
        for place, _, inferred in found:
            overlay.marker(place, "accent", 8.0, "ring" if inferred else "diamond")
        if found:
            overlay.labels([place for place, _, _ in found], [text for _, text, _ in found])
        shown, psnr = context.session.work.photo, context.viewport.photos.psnr
        if shown is not None and psnr is not None:
            left, top, width, height = overlay.area
            if shown.split:
                middle, bottom = left + shown.split_at * width, top + height - overlay.theme.px(12)
                overlay.divider(middle)
                overlay.text((middle - overlay.theme.px(10), bottom), "photograph", align=(1.0, 1.0))
                view = f"{context.session.screen.drawn[-1]} view"
                overlay.text((middle + overlay.theme.px(10), bottom), view, align=(0.0, 1.0))
            text = f"photograph against the view: {psnr:.1f} dB PSNR{about_view(context)}"
            overlay.text((left + width / 2, top + overlay.theme.px(64)), text, align=(0.5, 0.0))

    def outline(self, context: ToolContext) -> tuple[Group, ...]:
        return self._stations(context), self._photographs_listed(context)

    def _stations(self, context: ToolContext) -> Group:
        """Scanner stations; where they are the files, which the outliner lists by itself, only those with a place."""
        scene = context.scene
        assert scene is not None
        if self._listed is None or self._listed[0]() is not scene:
            self._listed = ref(scene), parts_of(scene), {number: place for number, _, place, _ in places_of(scene)}
        _, parts, places = self._listed

        def stand(row: int) -> None:
            if (place := places.get(parts[row][0])) is not None:
                stand_at(context, place)
            else:
                context.toast(f"Where {parts[row][1]} stood is not known")

        return Group(
            "Stations", icons.STATION, len(parts) if places else 0,
            lambda row: Row(parts[row][1], about=f"{parts[row][1]}: a click stands there",
                            shown=parts[row][0] not in context.document.hidden_stations),
            stand, show=lambda row, on: show_station(context, *parts[row], on),
        )  # fmt: skip

    def _photographs_listed(self, context: ToolContext) -> Group:
        """Photographs in place, once this tool has been selected and has read them."""
        shown = context.session.work.photo

        def stand(row: int) -> None:
            self.wanted = True
            self.viewer.close_picture()
            show_photo(context, self.photos[row])

        return Group(
            "Photographs", icons.PHOTOGRAPH, len(self.photos),
            lambda row: Row(self.photos[row].title, about=f"{self.photos[row].kind} photograph: a click shows it in its place",
                            chosen=shown is not None and shown.photo is self.photos[row]), stand,
        )  # fmt: skip

    def panel(self, ui: Any, context: ToolContext) -> None:
        if context.scene is None:
            return
        known = {number: (place, inferred) for number, _, place, inferred in places_of(context.scene)}
        if not known:
            ui.text_wrapped("The scanner positions are unknown: neither the file nor the order of its points tells.")
        for number, name in parts_of(context.scene):
            ui.push_id(number)
            changed, on = ui.checkbox("##visible", number not in context.document.hidden_stations)
            if ui.is_item_hovered():
                tooltip_beside(ui, "show these points")
            if changed:
                show_station(context, number, name, on)
            ui.same_line()
            room = ui.get_content_region_avail().x
            place, inferred = known.get(number, (None, False))
            if place is None:
                ui.text_unformatted(fitted(name, room))
            elif ui.button(fitted(name, room - 2 * ui.get_style().frame_padding.x)):
                stand_at(context, place)
            if ui.is_item_hovered():
                tooltip_beside(ui, f"{name}: position "
                                   + ("unknown" if place is None else "inferred from the order of the points" if inferred
                                      else "as the file says"))
            ui.pop_id()
        step_buttons(ui, self, context)
        draw_photographs(ui, self, context)
        ui.separator()
        self.ghosts.draw(ui, context)
