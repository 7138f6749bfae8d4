"""Film: bookmarks, keyframes of a camera path, its preview, and the video, which is rendered beside the window.

The path is that of ``pointglass video``: a spline through the keyframes at constant speed.  A film has its own OpenGL context
on a thread of its own, so that the window stays usable; it shows what the window shows: clips, hidden stations and look.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

from viewer.errors import PointglassError
from viewer.settings import VIEWS
from viewer.tools.document import Keyframe, Viewpoint, replaced, unique_name, without
from viewer.tools.film.command import MP4, PANORAMA_SIZE
from viewer.tools.film.keyframes import cameras_along, path_seconds, preview_cameras
from viewer.window.interaction.editing import edit, end, ended
from viewer.window.interaction.film_job import FilmJob, film_worker
from viewer.window.interaction.tool import Tool, ToolContext
from viewer.window.navigation import looking
from viewer.window.saved_picture import LARGEST
from viewer.window.worker import Worker

if TYPE_CHECKING:
    from viewer.window.overlay import OverlayCanvas

SIZES = ((1280, 720), (1920, 1080), (3840, 2160), (1080, 1920))
SHOTS = tuple(range(1, LARGEST + 1))
RATES = (24.0, 25.0, 30.0, 60.0)
STEP = 3.0
"""Seconds from one new keyframe to the next."""
_CURVE = 96
"""Places of the path that are drawn over the picture."""


class Film(Tool):
    """Its panel has three parts: bookmarks, the path, the video."""

    name, label, letter, key = "film", "Film", "V", "K"
    help = "bookmarks, camera path with preview, video and panorama"

    def __init__(self) -> None:
        self.at = 0.0  # seconds along the path, of the preview
        self.playing = False
        self._clock = perf_counter
        self._before = 0.0
        self.path_file, self.out = "camera_path.json", "film.mp4"
        self.size, self.view, self.supersample, self.panorama = SIZES[1], "neural", 1, False
        self.worker: Worker | None = None

    # -- bookmarks and keyframes -------------------------------------------------------------------------------------

    def add_bookmark(self, context: ToolContext) -> None:
        """Keeps the present view under a new name."""
        found = context.document.viewpoints
        name = unique_name("View", (view.name for view in found))
        edit(context, f"Add bookmark {name}", viewpoints=(*found, Viewpoint.of(context.camera, name)))

    def add_keyframe(self, context: ToolContext, view: Viewpoint | None = None) -> None:
        """Appends the present view, or a bookmark, to the path."""
        path = context.document.path
        name = unique_name("Key", (key.view.name for key in path.keyframes))
        view = Viewpoint.of(context.camera, name) if view is None else replace(view, name=name)
        time = path.keyframes[-1].time + STEP if path.keyframes else 0.0
        edit(context, f"Add keyframe {name}", path=replace(path, keyframes=(*path.keyframes, Keyframe(time, view))))

    def set_length(self, context: ToolContext, seconds: float) -> None:
        """Stretches the times of all keyframes so that the path takes so many seconds."""
        path = context.document.path
        factor = seconds / path_seconds(path)
        keys = tuple(replace(key, time=key.time * factor) for key in path.keyframes)
        edit(context, "Length of the camera path", "length", path=replace(path, keyframes=keys))

    def fly_to(self, context: ToolContext, view: Viewpoint) -> None:
        """Puts the camera where a view was taken; the lens stays the window's."""
        camera = view.camera(16, 9)
        flight = context.session.flight
        flight.go(looking(camera.position, camera.forward, flight.state.speed, flight.state.upright))
        context.renew_picture()

    def read_path(self, context: ToolContext) -> None:
        """Replaces the keyframes by the cameras of ``path_file``."""
        from viewer.tools.camera_files import read_cameras

        try:
            cameras = read_cameras(Path(self.path_file))
        except PointglassError as error:
            context.session.notices.say("The camera path cannot be read", str(error))
            return
        keys = tuple(Keyframe(STEP * number, Viewpoint.of(camera, camera.name)) for number, camera in enumerate(cameras))
        edit(context, f"Read {Path(self.path_file).name}", path=replace(context.document.path, keyframes=keys))

    def write_path(self, context: ToolContext) -> None:
        """Writes the keyframes to ``path_file``, with fps and seconds: `pointglass video --path` makes the same film."""
        from viewer.tools.camera_files import write_camera_path

        path = context.document.path
        keys = [*path.keyframes, *(path.keyframes[:1] if path.closed else ())]
        cameras = [replace(key.view.camera(*self.size), name=f"key_{number:03d}") for number, key in enumerate(keys)]
        try:
            write_camera_path(Path(self.path_file), cameras, fps=path.fps, seconds=path_seconds(path) or None)
        except (PointglassError, OSError) as error:
            context.session.notices.say("The camera path cannot be written", str(error))
        else:
            context.toast(f"Saved {Path(self.path_file).resolve()}")

    # -- preview -----------------------------------------------------------------------------------------------------

    def show_at(self, context: ToolContext, seconds: float) -> None:
        """Puts the camera where the path is after so many seconds."""
        path = context.document.path
        cameras, length = preview_cameras(path), path_seconds(path)
        self.at = min(max(seconds, 0.0), length)
        camera = cameras[round(self.at / length * (len(cameras) - 1))] if length > 0 else cameras[0]
        flight = context.session.flight
        flight.go(looking(camera.position, camera.forward, flight.state.speed, flight.state.upright))
        context.renew_picture()

    def left(self, context: ToolContext) -> None:
        self.playing = False

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        keys = context.document.path.keyframes
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

    # -- the video ---------------------------------------------------------------------------------------------------

    def job(self, context: ToolContext) -> FilmJob:
        """The film that the panel describes.  Raises InputError where the path has no keyframe."""
        path = context.document.path
        size = PANORAMA_SIZE if self.panorama else self.size
        count = max(1, round(path_seconds(path) * path.fps))
        out = context.folder / self.out
        settings = replace(context.session.view_settings.shown_settings, view=self.view)
        return FilmJob(
            context.session.scene, tuple(cameras_along(path.keyframes, count, size, closed=path.closed)), path.fps,
            settings, out, panorama=self.panorama, supersample=self.supersample,
            background=context.session.view_settings.background, alterations=context.document.alterations,
        )  # fmt: skip

    def start(self, context: ToolContext) -> None:
        """Renders the video beside the window."""
        try:
            self.worker = film_worker(self.job(context), context.session.loads.wake)
        except PointglassError as error:
            context.session.notices.say("This film cannot be made", str(error))

    def follow(self, context: ToolContext) -> None:
        done = ended(self.worker, context, "The film was not made")
        if done is None:
            return
        self.worker = None
        if done.cancelled:
            kept = "" if Path(self.out).suffix.lower() in MP4 else "; the frames made so far stay, and are kept the next time"
            context.toast(f"Film cancelled{kept}")
        elif done.error is None:
            context.toast(str(done.result))

    def close(self) -> None:
        end(self.worker)

    def panel(self, ui: Any, context: ToolContext) -> None:
        if context.scene is None:
            return
        work = context.session.work
        work.shot_scale = _chosen(ui, "##shot", [f"F12 saves {n} x the window's size" for n in SHOTS], SHOTS, work.shot_scale)
        self._bookmarks(ui, context)
        ui.separator()
        self._path(ui, context)
        ui.separator()
        self._video(ui, context)

    def _bookmarks(self, ui: Any, context: ToolContext) -> None:
        if ui.button("Add bookmark"):
            self.add_bookmark(context)
        found = context.document.viewpoints
        for number, view in enumerate(found):
            ui.push_id(number)
            ui.set_next_item_width(-92.0)
            changed, name = ui.input_text("##name", view.name)
            if changed:
                renamed = replaced(found, number, replace(view, name=name))
                edit(context, "Rename bookmark", ("bookmark", number), viewpoints=renamed)
            ui.same_line()
            if ui.small_button("go"):
                self.fly_to(context, view)
            ui.same_line()
            if ui.small_button("key"):
                self.add_keyframe(context, view)
            if ui.is_item_hovered():
                ui.set_tooltip("append this view to the camera path")
            ui.same_line()
            gone = ui.small_button("x")
            ui.pop_id()
            if gone:
                edit(context, f"Delete bookmark {view.name}", viewpoints=without(found, number))
                return

    def _path(self, ui: Any, context: ToolContext) -> None:
        path = context.document.path
        if ui.button("Add keyframe here"):
            self.add_keyframe(context)
        for number, key in enumerate(path.keyframes):
            ui.push_id(500 + number)
            if ui.selectable(f"{key.time:.1f} s  {key.view.name}", False)[0]:
                self.fly_to(context, key.view)
            if ui.begin_popup_context_item("##more"):
                if ui.selectable("Replace by the present view", False)[0]:
                    view = Viewpoint.of(context.camera, key.view.name)
                    keys = replaced(path.keyframes, number, replace(key, view=view))
                    edit(context, f"Move {key.view.name}", path=replace(path, keyframes=keys))
                if ui.selectable("Delete", False)[0]:
                    edit(context, f"Delete {key.view.name}", path=replace(path, keyframes=without(path.keyframes, number)))
                ui.end_popup()
            ui.pop_id()
        if len(path.keyframes) > 1:
            self._timeline(ui, context)
        ui.set_next_item_width(-1)
        _, self.path_file = ui.input_text("##path file", self.path_file)
        if ui.button("Open path"):
            self.read_path(context)
        ui.same_line()
        ui.begin_disabled(not path.keyframes)
        if ui.button("Save path"):
            self.write_path(context)
        ui.end_disabled()

    def _timeline(self, ui: Any, context: ToolContext) -> None:
        path = context.document.path
        length = path_seconds(path)
        clamp = ui.SliderFlags_.always_clamp
        if ui.button("Pause" if self.playing else "Play"):
            self.playing, self._before = not self.playing, self._clock()
            if self.at >= length:
                self.at = 0.0
        ui.same_line()
        ui.set_next_item_width(-1)
        moved, at = ui.slider_float("##at", self.at, 0.0, length, "%.1f s", clamp)
        if moved:
            self.playing = False
            self.show_at(context, at)
        ui.set_next_item_width(-1)
        changed, seconds = ui.drag_float("##length", length, 0.1, 0.2, 3600.0, "length %.1f s", clamp)
        if changed:
            self.set_length(context, seconds)
        changed, closed = ui.checkbox("back to the first keyframe", path.closed)
        if changed:
            edit(context, "Close the camera path", path=replace(path, closed=closed))

    def _video(self, ui: Any, context: ToolContext) -> None:
        if self.worker is not None:
            share = self.worker.fraction
            ui.text_unformatted(f"Rendering {self.worker.done:,} of {self.worker.total:,} frames" if share else "Preparing…")
            ui.progress_bar(share or 0.0)
            if ui.button("Cancel"):
                self.worker.cancel()
            return
        path = context.document.path
        rates = [f"{rate:g} frames a second" for rate in RATES]
        self.panorama = ui.checkbox("360-degree panorama", self.panorama)[1]
        ui.begin_disabled(self.panorama)
        self.size = _chosen(ui, "##size", [f"{w} x {h}" for w, h in SIZES], SIZES, self.size)
        ui.end_disabled()
        rate = _chosen(ui, "##fps", rates, RATES, path.fps)
        if rate != path.fps:
            edit(context, "Frames a second", path=replace(path, fps=rate))
        self.view = _chosen(ui, "##view", list(VIEWS), tuple(VIEWS), self.view)
        self.supersample = _chosen(ui, "##supersample", ["no supersampling", "2 x 2 samples a pixel"], (1, 2), self.supersample)
        ui.set_next_item_width(-1)
        _, self.out = ui.input_text("##out", self.out)
        if ui.is_item_hovered():
            ui.set_tooltip("a name ending in .mp4, or a folder for one PNG a frame, which can be continued")
        ui.begin_disabled(not path.keyframes or not self.out)
        if ui.button("Render video"):
            self.start(context)
        ui.end_disabled()


def _chosen(ui: Any, label: str, names: Sequence[str], values: Sequence[Any], value: Any) -> Any:
    """A list of choices; returns the one that is chosen now."""
    current = names[values.index(value)] if value in values else str(value)
    ui.set_next_item_width(-1)
    if ui.begin_combo(label, current):
        for name, other in zip(names, values, strict=True):
            if ui.selectable(name, other == value)[0]:
                value = other
        ui.end_combo()
    return value
