"""Film: bookmarks, keyframes of a camera path, its preview, and the video, which is rendered beside the window.

The path is that of ``pointglass video``: a spline through the keyframes at constant speed.  A film has its own OpenGL context
on a thread of its own, so that the window stays usable; it shows what the window shows: clips, hidden stations and look.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .....model.network.qualities import QUALITIES
from ....commands.film.command import MP4
from ....common.errors import PointglassError
from ....common.text import left_text
from ....picture.views import VIEWS
from ....work.cameras.keyframes import cameras_along, path_seconds, titles_along
from ....work.document import FILM_SAMPLES, FILM_SIDES, FilmFormat, replaced, unique_name, without
from ....work.viewpoint import Viewpoint
from ...kit import icons
from ...kit.sliders import slider_float
from ...kit.widgets import compact_button, compact_width, section, tooltip_beside
from ...kit.worker import Worker
from ...planning.networks import missing_qualities
from ...session.work import LARGEST_SHOT
from ..editing import edit, end, ended
from ..outline import Group, Row
from ..tool import KeyEvent, Tool, ToolContext
from .camera_path_editor import CameraPathEditor, fly_to
from .film_job import FilmJob, film_worker
from .publish_dialog import PublishDialog

if TYPE_CHECKING:
    from ...kit.overlay import OverlayCanvas

SIZES = ((1280, 720), (1920, 1080), (3840, 2160), (1080, 1920))
PANORAMAS = ((2048, 1024), FilmFormat().panorama_size, (8192, 4096))
LENSES = (15.0, 120.0)
"""Least and greatest vertical field of view that a person chooses, degrees."""
SHOTS = tuple(range(1, LARGEST_SHOT + 1))
KINDS = {"MP4 video": MP4, "Folder of PNG pictures, one a frame": ("",)}
RATES = (24.0, 25.0, 30.0, 60.0)


class Film(Tool):
    """Its panel has four parts: bookmarks, the path, the video, and the pictures that F12 saves."""

    name, label, icon, key = "film", "Film", icons.FILM, "K"
    help = "bookmarks, camera path with preview, titles, video and panorama"

    def __init__(self) -> None:
        self.path = CameraPathEditor()
        self.out: Path | None = None  # of the film that is rendered, or was rendered last
        self.worker: Worker | None = None
        self.publishing = PublishDialog()

    # -- bookmarks ---------------------------------------------------------------------------------------------------

    def add_bookmark(self, context: ToolContext) -> None:
        """Keeps the present view under a new name."""
        found = context.document.viewpoints
        name = unique_name("View", (view.name for view in found))
        edit(context, f"Add bookmark {name}", viewpoints=(*found, Viewpoint.of(context.camera, name)))

    def outline(self, context: ToolContext) -> tuple[Group]:
        found = context.document.viewpoints
        return (Group(
            "Viewpoints", icons.VIEWPOINT, len(found),
            lambda number: Row(found[number].name, about=f"{found[number].name}: a click flies there"),
            lambda number: fly_to(context, found[number]),
            rename=lambda number, name: self._rename(context, number, name),
            commands={"Append to the camera path": lambda number: self.path.add_keyframe(context, found[number]),
                      "Delete": lambda number: self._delete(context, number)},
        ),)  # fmt: skip

    def _rename(self, context: ToolContext, number: int, name: str) -> None:
        found = context.document.viewpoints
        edit(context, "Rename bookmark", ("bookmark", number),
             viewpoints=replaced(found, number, replace(found[number], name=name)))

    def _delete(self, context: ToolContext, number: int) -> None:
        found = context.document.viewpoints
        edit(context, f"Delete bookmark {found[number].name}", viewpoints=without(found, number))

    def selected(self, context: ToolContext) -> None:
        self.path.titles.prepare()

    def left(self, context: ToolContext) -> None:
        self.path.playing = False
        self.publishing.open = False

    def key_event(self, event: KeyEvent, context: ToolContext) -> bool:
        if event.kind != "press" or event.key not in ("DELETE", "BACKSPACE") or self.path.timeline.selected is None:
            return False
        self.path.delete(context)
        return True

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        self.path.draw(overlay, context)

    # -- the video ---------------------------------------------------------------------------------------------------

    def job(self, context: ToolContext, out: Path) -> FilmJob:
        """The film that the panel describes, saved as ``out``.  Raises InputError where the path has no keyframe."""
        path = context.document.path
        form = path.format
        size = form.panorama_size if form.panorama else form.size
        count = max(1, round(path_seconds(path) * path.fps))
        shown = context.session.view_settings.shown_settings
        settings = replace(shown, view=form.view, quality=form.quality or shown.quality)
        return FilmJob(
            context.session.scene, tuple(cameras_along(path, count, size)), path.fps,
            settings, out, panorama=form.panorama, supersample=form.supersample,
            background=context.session.view_settings.background, edits=context.document.edits,
            titles=titles_along(path, panorama=form.panorama),
        )  # fmt: skip

    def change_format(self, context: ToolContext, gesture: object = None, **changes: Any) -> None:
        """Changes how the pictures of the film are rendered, as one step.  gesture: as in edit."""
        path = context.document.path
        edit(context, "Pictures of the film", gesture, path=replace(path, format=replace(path.format, **changes)))

    def ask(self, context: ToolContext) -> None:
        """Asks where the video is saved, and begins it."""
        name = context.session.shown_scan.title.split(".")[0] or "film"
        context.files.save("films", "Save the film", f"{name}.mp4", KINDS, lambda out: self.start(context, out))

    def start(self, context: ToolContext, out: Path) -> None:
        """Renders the video beside the window."""
        self.out = out
        try:
            self.worker = film_worker(self.job(context, out), context.session.loads.wake)
        except PointglassError as error:
            context.session.notices.say("This film cannot be made", error)

    def follow(self, context: ToolContext) -> None:
        self.publishing.follow(context)
        done = ended(self.worker, context, "The film was not made")
        if done is None:
            return
        self.worker = None
        if done.cancelled:
            whole = self.out is None or self.out.suffix.lower() in MP4
            kept = "" if whole else "; the frames made so far stay, and are kept the next time"
            context.toast(f"Film cancelled{kept}")
        elif done.error is None and self.out is not None:
            context.tell_saved(self.out, str(done.result))

    @property
    def workers(self) -> "tuple[Worker | None, ...]":
        return (self.worker, self.publishing.worker)

    @property
    def unfinished(self) -> str:
        if self.worker is not None:
            return "A film is being rendered."
        return "A publication is being written." if self.publishing.worker is not None else ""

    def close(self) -> None:
        self.publishing.close()
        self.path.titles.close()
        end(self.worker)

    def panel(self, ui: Any, context: ToolContext) -> None:
        if context.scene is None:
            return
        ui.set_next_item_width(-1)
        lens = context.session.flight.field_of_view
        changed, degrees = slider_float("##lens", lens, *LENSES, "field of view %.0f°")
        if changed and LENSES[0] <= degrees <= LENSES[1]:
            self.path.change_lens(context, float(degrees))
        self._bookmarks(ui, context)
        ui.separator_text("Camera path")
        self.path.panel(ui, context)
        ui.separator_text("Video")
        self._video(ui, context)
        ui.same_line()
        if ui.button("Publish…"):
            self.publishing.ask(context)
        if ui.is_item_hovered():
            tooltip_beside(ui, "a folder that any browser opens by a double click: panoramas to walk through and to measure on")
        if section("Saved pictures (F12)", context.theme):
            self._stills(ui, context)
        self.publishing.draw(ui, context)

    def _stills(self, ui: Any, context: ToolContext) -> None:
        work = context.session.work
        work.shot_scale = _chosen(ui, "##shot", [f"F12 saves {n} x size" for n in SHOTS], SHOTS, work.shot_scale)
        work.shot_measured = ui.checkbox("with measurements", work.shot_measured)[1]
        if ui.is_item_hovered():
            tooltip_beside(ui, "F12 draws measurements over the picture; `render --like` draws it again without them")
        work.shot_noted = ui.checkbox("with notes", work.shot_noted)[1]
        if ui.is_item_hovered():
            tooltip_beside(ui, "F12 draws notes over the picture; `render --like` draws it again without them")
        work.shot_legend = ui.checkbox("with legend and scale", work.shot_legend)[1]
        if ui.is_item_hovered():
            tooltip_beside(ui, "F12 draws the legend of recoloured points, and the scale bar of an orthographic view;\n"
                               "`render --like` draws the picture without them")
        if ui.button("Folder of pictures…"):
            context.saves.choose_folder()
        if ui.is_item_hovered():
            tooltip_beside(ui, f"F12 and F9 save under new names in {context.saves.folder}")

    def _bookmarks(self, ui: Any, context: ToolContext) -> None:
        if ui.button("Add bookmark"):
            self.add_bookmark(context)
        found = context.document.viewpoints
        for number, view in enumerate(found):
            ui.push_id(number)
            ui.set_next_item_width(-compact_width(("go", "key", icons.REMOVE), context.theme))
            changed, name = ui.input_text("##name", view.name)
            if changed:
                self._rename(context, number, name)
            ui.same_line()
            if compact_button("go", context.theme):
                fly_to(context, view)
            ui.same_line()
            if compact_button("key", context.theme):
                self.path.add_keyframe(context, view)
            if ui.is_item_hovered():
                tooltip_beside(ui, "append this view to the camera path")
            ui.same_line()
            gone = compact_button(icons.REMOVE, context.theme)
            ui.pop_id()
            if gone:
                self._delete(context, number)
                return

    def _video(self, ui: Any, context: ToolContext) -> None:
        if self.worker is not None:
            share = self.worker.fraction
            ui.text_unformatted(f"Rendering {self.worker.done:,} of {self.worker.total:,} frames" if share else "Preparing…")
            if (seconds := self.worker.seconds_left) is not None:
                ui.text_unformatted(f"{left_text(seconds)} left")
            ui.progress_bar(share or 0.0)
            if ui.button("Cancel"):
                self.worker.cancel()
            return
        path = context.document.path
        form, changes, typed = path.format, dict[str, Any](), False
        rates = [f"{rate:g} frames a second" for rate in RATES]
        changes["panorama"] = ui.checkbox("360-degree panorama", form.panorama)[1]
        if form.panorama:
            names = [f"{w} x {h}" for w, h in PANORAMAS]
            changes["panorama_size"] = _chosen(ui, "##panorama size", names, PANORAMAS, form.panorama_size)
            if ui.button("Save a still from here"):
                context.saves.panorama(form.panorama_size)
        else:
            sizes = tuple(dict.fromkeys((*SIZES, form.size)))  # one that was typed is listed as well
            changes["size"] = _chosen(ui, "##size", [f"{w} x {h}" for w, h in sizes], sizes, form.size)
            ui.set_next_item_width(-1)
            typed, sides = ui.input_int2("##sides", list(form.size))
            if typed:
                low, high = FILM_SIDES
                changes["size"] = tuple(min(max(side, low), high) // 2 * 2 for side in sides)
            if ui.is_item_hovered():
                tooltip_beside(ui, "any other size: width and height, pixels")
        rate = _chosen(ui, "##fps", rates, RATES, path.fps)
        if rate != path.fps:
            edit(context, "Frames a second", path=replace(path, fps=rate))
        changes["view"] = _chosen(ui, "##view", list(VIEWS), tuple(VIEWS), form.view)
        if form.view == "neural":
            shown = context.session.view_settings.shown_settings
            there = [name for name in QUALITIES if name not in missing_qualities(shown)]
            quality = form.quality or shown.quality
            chosen = _chosen(ui, "##quality", [f"quality {name}" for name in there], there, quality)
            changes |= {"quality": chosen} if chosen != quality else {}
        samples = ["no supersampling", *(f"{n} x {n} samples a pixel" for n in FILM_SAMPLES[1:])]
        changes["supersample"] = _chosen(ui, "##supersample", samples, FILM_SAMPLES, form.supersample)
        self.change_format(context, "film size" if typed else None, **changes)
        ui.begin_disabled(not path.keyframes)
        if ui.button("Render video…"):
            self.ask(context)
        if ui.is_item_hovered():
            tooltip_beside(ui, "as one MP4, or as a folder with one PNG a frame, which can be continued")
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
