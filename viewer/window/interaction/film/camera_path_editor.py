"""The camera path of a film: its keyframes, edited on a timeline, previewed over the picture, kept in a file.

The path is that of ``pointglass video``: a spline through position, direction and field of view, at constant speed but for
keyframes where the camera stays, and for a slow beginning and end.
"""

from dataclasses import replace
from math import isfinite
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from ....commands.film.path_timing import timing_of
from ....common.errors import PointglassError
from ....work.cameras.around_centre import orbit
from ....work.cameras.camera_files import CAMERA_ENDINGS, read_cameras, write_camera_path
from ....work.cameras.keyframes import pace_of, passing_seconds, path_seconds, preview_cameras
from ....work.document import LONGEST_STAY, FilmTitle, Keyframe, replaced, unique_name, without
from ....work.viewpoint import Viewpoint
from ...kit import icons
from ...kit.widgets import compact_button, tooltip_beside
from ...saving.capture import unwritable
from ..editing import Pointing, edit
from ..tool import ToolContext
from .timeline import Timeline
from .title_fields import TitleFields

if TYPE_CHECKING:
    from ...kit.overlay import OverlayCanvas

STEP = 3.0
"""Seconds from one new keyframe to the next."""
WRITTEN = {"Camera path": (".json",)}
READ = {"Cameras": CAMERA_ENDINGS}
"""Files of cameras that are written and read: kind -> endings."""
_ORTHOGRAPHIC = "A film is made in perspective: press X, then add the view"
_REACH = 120.0
"""Design units around the middle of the view within which a point to go around is looked for."""
_CURVE = 96
"""Places of the path that are drawn over the picture."""


def fly_to(context: ToolContext, view: Viewpoint) -> None:
    """Puts the camera where a view was taken, with its field of view."""
    context.session.flight.show(view.camera(16, 9))
    context.renew_picture()


class CameraPathEditor:
    """at: seconds along the path, of the preview.  playing: whether the preview runs.
    timeline: with the selected keyframe.  titles: of the film, typed and shown."""

    def __init__(self) -> None:
        self.timeline, self.titles = Timeline(), TitleFields()
        self.at, self.playing = 0.0, False
        self._pointing = Pointing()
        self._clock = perf_counter
        self._before, self._scrubs = 0.0, False

    def add_keyframe(self, context: ToolContext, view: Viewpoint | None = None) -> None:
        """Appends the present view, or a bookmark, to the path."""
        path = context.document.path
        name = unique_name("Key", (key.view.name for key in path.keyframes))
        view = Viewpoint.of(context.camera, name) if view is None else replace(view, name=name)
        if view.orthographic is not None:
            context.toast(_ORTHOGRAPHIC)
            return
        time = path.keyframes[-1].time + STEP if path.keyframes else 0.0
        edit(context, f"Add keyframe {name}", path=replace(path, keyframes=(*path.keyframes, Keyframe(time, view))))

    def orbit(self, context: ToolContext) -> None:
        """The path becomes one turn around the measured point nearest to the middle of the view."""
        width, height = context.camera.width, context.camera.height
        if context.camera.orthographic is not None:
            context.toast(_ORTHOGRAPHIC)
            return
        found = self._pointing.at(context, (width / 2, height / 2), _REACH)
        if found is None:
            context.toast("No measured point near the middle of the view: look at what the camera is to go around")
            return
        document = context.document
        keys = orbit(context.camera, found.position, document.up, step=STEP)
        had = bool(document.path.keyframes)
        edit(context, "Orbit a point", path=replace(document.path, keyframes=keys, closed=True))
        self.timeline.selected, self.at, self.playing = None, 0.0, False
        back = "; Ctrl+Z brings the former one back" if had else ""
        context.toast(f"The path goes once around the point in the middle{back}")

    def set_length(self, context: ToolContext, seconds: float) -> None:
        """Stretches the times of all keyframes so that the path takes so many seconds."""
        path = context.document.path
        factor = seconds / path_seconds(path)
        keys = tuple(replace(key, time=key.time * factor) for key in path.keyframes)
        edit(context, "Length of the camera path", "length", path=replace(path, keyframes=keys))

    def change_lens(self, context: ToolContext, degrees: float) -> None:
        """Gives the window, and the selected keyframe, another vertical field of view."""
        context.session.flight.field_of_view = degrees
        context.renew_picture()
        path, number = context.document.path, self.timeline.selected
        if number is not None and number < len(path.keyframes):
            key = path.keyframes[number]
            keys = replaced(path.keyframes, number, replace(key, view=replace(key.view, vertical_fov=degrees)))
            edit(context, f"Field of view of {key.view.name}", ("lens", number), path=replace(path, keyframes=keys))

    def select(self, context: ToolContext, number: int) -> None:
        """Selects a keyframe and shows it."""
        path = context.document.path
        self.timeline.selected, self.playing = number, False
        self.at = passing_seconds(path)[number]
        fly_to(context, path.keyframes[number].view)

    def shift(self, context: ToolContext, places: int) -> None:
        """Moves the selected keyframe in the order of the path: the times keep their places."""
        path, number = context.document.path, self.timeline.selected
        if number is None or not 0 <= number + places < len(path.keyframes):
            return
        order = list(path.keyframes)
        order.insert(number + places, order.pop(number))
        keys = tuple(replace(key, time=place.time) for key, place in zip(order, path.keyframes, strict=True))
        self.timeline.selected = number + places
        edit(context, f"Reorder {keys[number + places].view.name}", path=replace(path, keyframes=keys))

    def change_title(self, context: ToolContext, title: FilmTitle | None, number: int | None = None) -> None:
        """Sets the opening title, or the caption of keyframe ``number``."""
        path = context.document.path
        if number is None:
            if title != path.title:
                edit(context, "Opening title", "title", path=replace(path, title=title))
        elif title != path.keyframes[number].caption:
            key = replace(path.keyframes[number], caption=title)
            edit(context, f"Caption at {key.view.name}", ("caption", number),
                 path=replace(path, keyframes=replaced(path.keyframes, number, key)))

    def change_stay(self, context: ToolContext, number: int, seconds: float) -> None:
        """The camera stays at a keyframe for so many seconds."""
        path = context.document.path
        keys = replaced(path.keyframes, number, replace(path.keyframes[number], stay=seconds))
        edit(context, f"Stay at {path.keyframes[number].view.name}", ("stay", number), path=replace(path, keyframes=keys))

    def replace_view(self, context: ToolContext) -> None:
        """The selected keyframe becomes the present view."""
        path, number = context.document.path, self.timeline.selected
        if context.camera.orthographic is not None:
            context.toast(_ORTHOGRAPHIC)
        elif number is not None and number < len(path.keyframes):
            key = path.keyframes[number]
            keys = replaced(path.keyframes, number, replace(key, view=Viewpoint.of(context.camera, key.view.name)))
            edit(context, f"Move {key.view.name}", path=replace(path, keyframes=keys))

    def delete(self, context: ToolContext) -> None:
        """Removes the selected keyframe."""
        path, number = context.document.path, self.timeline.selected
        if number is not None and number < len(path.keyframes):
            self.timeline.selected = None
            name = path.keyframes[number].view.name
            edit(context, f"Delete {name}", path=replace(path, keyframes=without(path.keyframes, number)))

    def read_path(self, context: ToolContext, file: Path) -> None:
        """Replaces the keyframes by the cameras of ``file``."""
        try:
            cameras = read_cameras(file)
            timing = timing_of(file, len(cameras))
        except PointglassError as error:
            context.session.notices.say("The camera path cannot be read", error)
            return
        stays, captions = (*timing.stays, *[0.0] * len(cameras)), (*timing.captions, *[None] * len(cameras))
        keys = tuple(Keyframe(STEP * number, Viewpoint.of(camera, camera.name), stay, caption)
                     for number, (camera, stay, caption) in enumerate(zip(cameras, stays, captions)))
        path = replace(context.document.path, keyframes=keys, title=timing.title, ease=timing.ease)
        edit(context, f"Read {file.name}", path=path)

    def write_path(self, context: ToolContext, file: Path) -> None:
        """Writes the keyframes to ``file``, with size, fps and seconds: `pointglass video --path` makes the same film."""
        path = context.document.path
        keys = [*path.keyframes, *(path.keyframes[:1] if path.closed else ())]
        cameras = [replace(key.view.camera(*path.format.size), name=f"key_{number:03d}") for number, key in enumerate(keys)]
        try:
            write_camera_path(file, cameras, fps=path.fps, seconds=path_seconds(path) or None,
                              stays=[key.stay for key in path.keyframes], ease=path.ease,
                              title=path.title, captions=[key.caption for key in path.keyframes])
        except (PointglassError, OSError) as error:
            told = unwritable(file, error) if isinstance(error, OSError) else error
            context.session.notices.say("The camera path cannot be written", told)
        else:
            context.tell_saved(file)

    def show_at(self, context: ToolContext, seconds: float) -> None:
        """Puts the camera where the path is after so many seconds."""
        path = context.document.path
        cameras, length = preview_cameras(path), path_seconds(path)
        self.at = min(max(seconds, 0.0), length)
        camera = cameras[round(self.at / length * (len(cameras) - 1))] if length > 0 else cameras[0]
        context.session.flight.show(camera)
        context.renew_picture()

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        keys = context.document.path.keyframes
        moves = len(keys) > 1 and (self.playing or self._scrubs)
        self.titles.draw(overlay, context, context.document.path, self.at if moves else None)
        if self.playing and len(keys) > 1:
            now = self._clock()
            step, self._before = now - self._before, now
            self.show_at(context, self.at + step)
            if self.at >= path_seconds(context.document.path):
                self.playing = False
            return
        self.playing = False
        if len(keys) > 1:
            curve = preview_cameras(context.document.path)
            overlay.polyline([camera.position for camera in curve[:: max(1, len(curve) // _CURVE)]], "accent", 1.5)
        for key in keys:
            place = key.view.camera(16, 9).position
            overlay.marker(place, "accent", 5.0, "square")
            overlay.label(place, key.view.name)

    def panel(self, ui: Any, context: ToolContext) -> None:
        """The rows of the panel."""
        path = context.document.path
        if ui.button("Add keyframe here"):
            self.add_keyframe(context)
        ui.same_line()
        if ui.button("Orbit"):
            self.orbit(context)
        if ui.is_item_hovered():
            tooltip_beside(ui, "A path once around the point in the middle of the view")
        if path.keyframes:
            self._timeline(ui, context)
            self.change_title(context, self.titles.field(ui, context, context.document.path.title, True))
        if ui.button("Open path…"):
            context.files.open("camera paths", "Open a camera path", READ, lambda files: self.read_path(context, files[0]))
        ui.same_line()
        ui.begin_disabled(not path.keyframes)
        if ui.button("Save path…"):
            context.files.save("camera paths", "Save the camera path", "camera_path.json", WRITTEN,
                               lambda file: self.write_path(context, file))
        ui.end_disabled()

    def _timeline(self, ui: Any, context: ToolContext) -> None:
        path = context.document.path
        length = path_seconds(path)
        clamp = ui.SliderFlags_.always_clamp
        if length > 0 and ui.button("Pause" if self.playing else "Play"):
            self.playing, self._before = not self.playing, self._clock()
            if self.at >= length:
                self.at = 0.0
        event = self.timeline.draw(ui, context.theme, passing_seconds(path), min(self.at, length), length)
        if event.selected is not None:
            self.select(context, event.selected)
        self._scrubs = event.scrubbed is not None
        if event.scrubbed is not None:
            self.playing = False
            self.show_at(context, event.scrubbed)
        self._selected(ui, context)
        if length <= 0:
            return
        ui.set_next_item_width(-1)
        changed, seconds = ui.drag_float("##length", length, 0.1, 0.2, 3600.0, "length %.1f s", clamp)
        if changed and isfinite(seconds):  # "nan" may be typed
            self.set_length(context, seconds)
        if (pace := pace_of(path)) is not None and pace.shortened:
            ui.text_wrapped(f"The {pace.shortened}: make the film longer.")
        changed, ease = ui.checkbox("begin and end slowly", path.ease)
        if changed:
            edit(context, "Begin and end slowly", path=replace(path, ease=ease))
        changed, closed = ui.checkbox("back to the first keyframe", path.closed)
        if changed:
            edit(context, "Close the camera path", path=replace(path, closed=closed))

    def _selected(self, ui: Any, context: ToolContext) -> None:
        """What can be done with the selected keyframe."""
        keys, number = context.document.path.keyframes, self.timeline.selected
        if number is None or number >= len(keys):
            self.timeline.selected = None
            ui.text_wrapped("Click a keyframe of the strip to select it.")
            return
        ui.text_unformatted(f"{keys[number].view.name}, {keys[number].view.vertical_fov:.0f}°")
        for label, explained, act in (
            ("<", "earlier in the path", lambda: self.shift(context, -1)),
            (">", "later in the path", lambda: self.shift(context, 1)),
            ("update", "the keyframe becomes the present view", lambda: self.replace_view(context)),
            (icons.REMOVE, "removes the keyframe (Delete)", lambda: self.delete(context)),
        ):  # fmt: skip
            if label != "<":
                ui.same_line()
            if compact_button(f"{label}##keyframe", context.theme):
                act()
            if ui.is_item_hovered():
                tooltip_beside(ui, explained)
        ui.set_next_item_width(-1)
        changed, stay = ui.drag_float("##stay", keys[number].stay, 0.05, 0.0, LONGEST_STAY, "stay here %.1f s",
                                      ui.SliderFlags_.always_clamp)
        if ui.is_item_hovered():
            tooltip_beside(ui, "How long the camera stays at this keyframe; the film keeps its length")
        if changed and isfinite(stay):
            self.change_stay(context, number, stay)
        ui.push_id(number)  # of another keyframe it is another field
        caption = context.document.path.keyframes[number].caption
        self.change_title(context, self.titles.field(ui, context, caption, False), number)
        ui.pop_id()
