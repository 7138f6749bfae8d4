"""Publishes what the window shows as a folder for browsers: choice of the places, their plan, size and time, then a job.

The same folder as ``pointglass publish`` makes of the saved project, of what is there now.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....commands.publishing.command import second_view
from ....commands.publishing.own_files import check_folder
from ....commands.publishing.place_choice import PLANNED
from ....commands.publishing.publication import Form, Publication
from ....common.errors import PointglassError
from ....common.text import bytes_text, counted, left_text
from ...kit.worker import BESIDE, Worker
from ...planning.folder_photographs import give_folder
from ..editing import end, ended
from .publish_plan import PLACE_BYTES, PublishPlan, planned

if TYPE_CHECKING:
    import moderngl

    from ..tool import ToolContext

PLACES: dict[str | int, str] = {
    "auto": "scanner positions, else viewpoints, else planned",
    "stations": "scanner positions",
    "viewpoints": "viewpoints",
    **{number: f"at most {number} planned places" for number in (4, PLANNED, 30)},
}
VIEWS = ("neural", "filled")
ENDINGS = {"Folder for browsers": ("",)}
_PLAN = 420
"""Design units of the plan's longer side."""


class PublishDialog:
    """open: whether it is shown.  plan: what is planned for the present choice.  worker: what is written, else None."""

    def __init__(self) -> None:
        self.open, self.wanted, self.view, self.second = False, "auto", "neural", True
        self.plan: PublishPlan | None = None
        self.problem = ""
        self.worker: Worker | None = None
        self._planner: Worker | None = None
        self._of: tuple | None = None
        self._out: Path | None = None
        self._texture: moderngl.Texture | None = None

    def ask(self, context: "ToolContext") -> None:
        """Opens the dialog."""
        if context.scene is None or context.session.shown_scan.preview:
            context.toast(f"The scan can be published when all points have been read{context.session.loads.reading.how}")
        elif self.worker is not None:
            context.toast("The last publication is still being written")
        else:
            self.open = True

    def follow(self, context: "ToolContext") -> None:
        """Called in every turn of the loop: plans anew where the choice has changed, and tells what was written."""
        if self._planner is not None and self._planner.finished:
            done, self._planner = self._planner, None
            if not done.cancelled:
                self.problem, self.plan = str(done.error or ""), done.result if done.error is None else None
        self._plan_anew(context)
        if (done := ended(self.worker, context, "The publication was not written")) is None:
            return
        self.worker = None
        if done.cancelled:
            context.toast("Publishing was given up; the places made so far stay, and are kept the next time")
        elif done.error is None and self._out is not None:
            context.tell_saved(self._out / "index.html", str(done.result))

    def _plan_anew(self, context: "ToolContext") -> None:
        document = context.document
        of = (self.wanted, self.view, id(context.scene), document.viewpoints, document.edits) if self.open else None
        if of == self._of:
            return
        if self._planner is not None:
            self._planner.cancel()
            return  # a later turn begins anew
        self._of, self.plan, self.problem = of, None, ""
        self._forget_texture()
        if of is None or context.session.scene is None:
            return
        scene, wanted = replace(context.session.scene, meta=context.session.facts), self.wanted
        settings = replace(context.session.view_settings.shown_settings, view=self.view)
        self._planner = Worker(lambda: planned(scene, document, settings, wanted, Form.side), "Planning the places",
                               context.session.loads.wake)

    def draw(self, ui: Any, context: "ToolContext") -> None:
        """The dialog over the middle of the picture."""
        if not self.open:
            return
        (left, top), (width, height) = context.session.area.origin, context.session.area.size
        density = context.session.area.density
        ui.set_next_window_pos(((left + width / 2) / density, (top + height / 2) / density), ui.Cond_.always, (0.5, 0.5))
        flags = (ui.WindowFlags_.no_collapse | ui.WindowFlags_.always_auto_resize | ui.WindowFlags_.no_move
                 | ui.WindowFlags_.no_saved_settings)
        shown, kept = ui.begin("Publish for browsers", True, flags)
        if shown:
            self._rows(ui, context)
        ui.end()
        if not kept:
            self.open = False

    def _rows(self, ui: Any, context: "ToolContext") -> None:
        theme = context.theme
        ui.push_item_width(theme.px(_PLAN))
        if ui.begin_combo("##places", PLACES[self.wanted]):
            for key, name in PLACES.items():
                if ui.selectable(name, key == self.wanted)[0]:
                    self.wanted = key
            ui.end_combo()
        if ui.begin_combo("##view", f"{self.view} pictures"):
            for view in VIEWS:
                if ui.selectable(f"{view} pictures", view == self.view)[0]:
                    self.view = view
            ui.end_combo()
        ui.pop_item_width()
        self.second = ui.checkbox("with a second view, to compare", self.second)[1]
        if self.plan is None:
            ui.dummy((theme.px(_PLAN), theme.px(4)))
            ui.text_wrapped(self.problem or "Planning the places…")
        else:
            self._shown(ui, context, self.plan)
        ui.begin_disabled(self.plan is None)
        if ui.button("Publish…"):
            name = f"{context.session.shown_scan.title.split('.')[0] or 'scan'} site"
            context.files.save("publications", "A new folder for the publication", name, ENDINGS,
                               lambda out: self.start(context, out))
        ui.end_disabled()
        ui.same_line()
        if ui.button("Close"):
            self.open = False

    def _shown(self, ui: Any, context: "ToolContext", plan: PublishPlan) -> None:
        rows, columns = plan.picture.shape[:2]
        scale = context.theme.px(_PLAN) / max(rows, columns)
        if self._texture is None:
            self._texture = context.texture(plan.picture)
        ui.image(ui.ImTextureRef(self._texture.glo), (columns * scale, rows * scale))
        size = f"{max(1, round(len(plan.places) * PLACE_BYTES[self.second] / 1e6))} MB"
        more = f" on {plan.storeys} storeys" if plan.storeys > 1 else ""
        ui.text_unformatted(f"{counted(len(plan.places), 'place')}{more}, about {size}, about {left_text(plan.seconds)}")

    def start(self, context: "ToolContext", out: Path) -> None:
        """Writes the publication beside the window; it goes on with one that was stopped in this folder."""
        session, plan = context.session, self.plan
        if plan is None or session.scene is None:
            return
        try:
            check_folder(out)
        except PointglassError as error:
            session.notices.say("This folder cannot be used", error)
            return
        scene, view = replace(session.scene, meta=session.facts), session.view_settings
        document = session.work.as_saved(session.camera, view.shown_settings, view.background)
        title = session.work.project.stem if session.work.project is not None else session.shown_scan.title.split(".")[0]
        job = Publication(scene, document, replace(view.shown_settings, view=self.view), plan.places, out, title,
                          Form(second=second_view(self.view, None if self.second else "none", document)), session.work.project)
        self._out, self.open = out, False
        self.worker = Worker(lambda: written(job), f"Publishing {out.name}", session.loads.wake, niceness=BESIDE)

    def close(self) -> None:
        """Gives up what is under way and waits until it has removed what it was writing."""
        self.open = False
        end(self._planner)
        end(self.worker)
        self._forget_texture()

    def _forget_texture(self) -> None:
        if self._texture is not None:
            self._texture.release()
            self._texture = None


def written(job: Publication) -> str:
    """Writes a publication with an OpenGL context of its own; returns what was made, in words.  Raises PointglassError."""
    from ....render.described_picture import Composer
    from ....render.device.context import create_context
    from ....render.renderer import Renderer
    from ....work.ghosts import prepared

    if job.settings.view == "neural":
        from .....model.common.process.torch_process import prepare_inference

        prepare_inference()
    context, problems = create_context(), list[str]()
    try:
        renderer, composer = Renderer(context, prepared(job.scene, job.document.ghosts)), Composer(context)
        try:
            give_folder(renderer, job.settings.photos)
            _, size = job.write(renderer, composer, problems.append)
        finally:
            composer.release()
            renderer.release()
    finally:
        context.release()
    text = f"Published {counted(len(job.places), 'place')}, {bytes_text(size)}; a click in Saved files opens it in the browser"
    return "\n".join([text, *(f"Left out: {problem}" for problem in problems)])
