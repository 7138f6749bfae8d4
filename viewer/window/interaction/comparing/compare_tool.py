"""Compare: how far the surfaces of one scan lie from those of an earlier one, or from a mesh, as colours of its points.

Scans are files of the scene, meshes lie beside it.  What is compared and how it is shown is part of the document, so that it is
undone, saved and restored; distances, and the levels of colours made of them, follow from it and are computed on a thread.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....common.errors import InputError
from ....common.text import printable
from ....picture.dates.date_comparison import DateComparison
from ....picture.views import POINT_VIEWS
from ....work.comparing.compared_model import model_of, with_model
from ....work.comparing.scene_changes import Coloured, SceneDistances, compared_files, compared_of, keys_of
from ....work.document import replaced
from ....work.measuring.measure_text import unit_name
from ....work.pictures.points_legend import change_legend
from ....work.project import moves_of
from ....work.registration.moved_files import transforms_of
from ....work.scan_files import FilePart, files_of
from ...kit import icons
from ...kit.worker import BESIDE, Worker
from ...session.two_dates import dates_of
from ..editing import edit, end, ended, metres_per_unit
from ..tool import Tool, ToolContext
from .aligned_places import aligned_unsure
from .compare_panel import draw_panel
from .compare_work import colour_work, compare_work, differing, fresh_folder, place_key, share_limit, with_model_hidden

if TYPE_CHECKING:
    from ....grid.scene import Scene

FOLDER = "comparisons"
"""Of the remembered folder (viewer.window.file_dialog)."""


class Compare(Tool):
    """before, after: numbers of files; from their count on, ``before`` counts meshes.  method: a key of METHODS.  registration:
    uncertainty (95 %), file units.  beside: whether the handle has the two dates without a comparison, too.  made, coloured: of
    the document's comparison, None until they are there."""

    name, label, icon = "compare", "Compare", icons.COMPARE
    help = "colour a scan by how far it lies from an earlier one, or from a model"

    def __init__(self) -> None:
        self.before, self.after = 0, 1
        self.method, self.registration = "m3c2", 0.0
        self.beside = False
        self.made: SceneDistances | None = None
        self.coloured: Coloured | None = None
        self.worker: Worker | None = None
        self._shown: DateComparison | None = None  # that ``coloured`` is of
        self._colouring: Worker | None = None
        self._exporting: tuple[Worker, Path] | None = None
        self._given_up: object = None  # place_key of one that cannot be shown, or was cancelled
        self._to_points = False  # whether a view with the colours of points is chosen when they are there
        self._of: tuple | None = None
        self._aligned: tuple | None = None  # of which ``registration`` was taken

    # ---- what there is

    def parts(self, context: ToolContext) -> list[FilePart]:
        """The files of the scene; none where it does not tell them apart, or is not complete."""
        scene = context.scene
        if scene is None or context.session.shown_scan.preview:
            return []
        found = files_of(scene)
        return found if all(part.apart for part in found) else []

    def names(self, context: ToolContext) -> list[str]:
        """Of the files, and of the meshes after them."""
        files = [printable(Path(part.path).name) for part in self.parts(context)]
        return files + [f"model {printable(layer.name)}" for layer in context.document.meshes] if files else []

    def model(self, context: ToolContext) -> int | None:
        """Number of the chosen mesh, None where two scans are compared."""
        number = self.before - len(self.parts(context))
        return number if 0 <= number < len(context.document.meshes) else None

    def unit(self, context: ToolContext) -> str:
        """Of distances."""
        return unit_name(metres_per_unit(context))

    @property
    def exporting(self) -> Worker | None:
        """The export under way."""
        return None if self._exporting is None else self._exporting[0]

    # ---- what is done

    def show_beside(self, context: ToolContext, on: bool) -> None:
        """Shows both dates, one at each side of a handle, or all points in the whole picture."""
        self.beside = on
        self._follow_dates(context)
        context.session.view_settings.compare(on)

    def _follow_dates(self, context: ToolContext) -> None:
        """Gives the handle its two dates while a comparison is open, or they were asked for."""
        parts, work, view = self.parts(context), context.session.work, context.session.view_settings
        there = (self.beside or context.document.comparison is not None) and max(self.before, self.after) < len(parts)
        work.dates = dates_of(parts, self.before, self.after) if there and self.before != self.after else None
        view.compare_dates(work.dates is not None)

    def choose(self, before: int, after: int) -> None:
        """Other files are to be compared."""
        self.before, self.after = before, after

    def start(self, context: ToolContext) -> None:
        """Compares, on a thread."""
        names, model, registration = self.names(context), self.model(context), self.registration
        if context.scene is None or max(self.before, self.after) >= len(names) or self.before == self.after:
            return
        keys, meshes = keys_of(context.scene), context.document.meshes
        after = keys[self.after]
        if model is not None:
            self._compare(lambda: with_model(after, meshes, model, registration), after[0], context)
        else:
            made = DateComparison(keys[self.before], after, self.method, registration)
            self._compare(lambda: made, after[0], context)

    def _compare(self, comparison: Callable[[], DateComparison], name: str, context: ToolContext) -> None:
        assert context.scene is not None
        work = compare_work(context.scene, comparison, context.document.meshes)
        self.worker = Worker(work, f"Comparing {name}", context.wake, niceness=BESIDE)

    def show(self, context: ToolContext, **chosen: Any) -> None:
        """Shows the comparison in another way: shown, limit or certain."""
        if (comparison := context.document.comparison) is not None:
            self._to_points |= chosen.get("shown") == "change"
            edit(context, "Show the comparison", "comparison shown", comparison=replace(comparison, **chosen))

    def show_share(self, context: ToolContext, share: float) -> None:
        """The colours end where a share of the distances ends."""
        if self.made is not None and (limit := share_limit(self.made, share)) is not None:
            self.show(context, limit=limit)

    def put_away(self, context: ToolContext) -> None:
        """Points have their own colours again."""
        edit(context, "End the comparison", comparison=None)
        self.beside = False
        self._drop(context)

    def _drop(self, context: ToolContext) -> None:
        """Shows no comparison any more, or not yet."""
        if self._colouring is not None:
            self._colouring.cancel()
        self._colouring = self.made = self.coloured = self._shown = None
        work, view = context.session.work, context.session.view_settings
        if work.changes is not None:
            self._to_points |= work.change_legend is not None and view.shown_settings.view in POINT_VIEWS
            work.changes = work.change_legend = None
            view.show_colours()

    def show_model(self, context: ToolContext, on: bool) -> None:
        """Draws the mesh of the comparison beside the coloured points, or does not."""
        comparison, meshes = context.document.comparison, context.document.meshes
        if comparison is not None and comparison.with_model:
            number = meshes.index(model_of(comparison, meshes))
            edit(context, f"{'Show' if on else 'Hide'} {meshes[number].name}",
                 meshes=replaced(meshes, number, replace(meshes[number], visible=on)))

    def open_other(self, context: ToolContext) -> None:
        """Asks for a second scan, which is opened with the one that is shown."""
        from ....readers.formats import FORMATS

        endings = tuple(dict.fromkeys(suffix for row in FORMATS for suffix in row.suffixes))
        shown = list(context.session.shown_scan.paths)
        context.files.open("scans", "Open the scan to compare with", {"Scans": endings},
                           lambda paths: context.open_scans([*shown, *paths]))

    def export(self, context: ToolContext) -> None:
        """Asks for a folder and writes there what `pointglass compare` writes."""
        parts, document, model = self.parts(context), context.document, self.model(context)
        if self.made is None or self._exporting is not None or max(self.before, self.after) >= len(self.names(context)):
            return
        layer = None if model is None else document.meshes[model]
        before, after = Path(parts[self.before].path if layer is None else layer.path), Path(parts[self.after].path)
        limit = None if self.coloured is None else self.coloured.found.limit

        def chosen(parent: Path) -> None:
            from ....commands.comparing.command import write_comparison

            out = fresh_folder(parent, f"{after.stem}-compared")
            work = Worker(lambda: write_comparison(before, after, out, method=self.method, registration=self.registration,
                                                   limit=limit, moves=moves_of(document.scans), layer=layer),
                          f"Writing {out.name}", context.wake, niceness=BESIDE)  # fmt: skip
            self._exporting = work, out

        context.files.open_folder(FOLDER, "Folder for the comparison", chosen)

    def follow(self, context: ToolContext) -> None:
        self._leave_other(context)
        self._follow_dates(context)
        self._follow_places(context)
        if (done := ended(self.worker, context, "The scans were not compared")) is not None:
            self.worker = None
            known = context.document.comparison
            if done.result is None or done.cancelled or context.scene is None or done.result[1].count != context.scene.count:
                self._given_up = place_key(known, context.document.meshes) if self.made is None else None
            else:
                comparison, self.made = done.result
                self._given_up = None
                if known is None or known.compared != comparison.compared:
                    self._to_points = True
                    meshes = with_model_hidden(context.document.meshes, comparison)
                    edit(context, "Compare", comparison=comparison, meshes=meshes)
        self._follow_document(context)
        if (done := ended(self._colouring, context, "The change cannot be shown")) is not None:
            self._colouring = None
            if done.result is not None and self.made is not None:
                comparison, coloured = done.result
                self._take(comparison, coloured, context)
        if self._exporting is not None and ended(self._exporting[0], context, "The comparison was not written") is not None:
            (done, out), self._exporting = self._exporting, None
            if done.result is not None and not done.cancelled:
                context.tell_saved(out)

    def _follow_places(self, context: ToolContext) -> None:
        """Takes the uncertainty that Align found of the chosen scans, where there is no comparison that has its own."""
        chosen = self.before, self.after, context.document.scans, context.document.meshes
        if chosen != self._aligned and context.document.comparison is None and context.scene is not None:
            self._aligned, self.registration = chosen, aligned_unsure(context.scene.meta.sources, *chosen)

    def _follow_document(self, context: ToolContext) -> None:
        """Makes what the document's comparison needs: it was opened, undone or changed."""
        wanted, scene = context.document.comparison, context.scene
        if wanted is None or scene is None:
            if self.made is not None or context.session.work.changes is not None:
                self._drop(context)
            self._given_up = None
            return
        meshes = context.document.meshes
        if self.worker is not None or not self.parts(context) or place_key(wanted, meshes) == self._given_up:
            return
        try:
            compared = compared_of(wanted, meshes)
            if self.made is None or self.made.compared != compared:
                self._drop(context)
                parts, (before, after) = self.parts(context), compared_files(scene, wanted)
                model = len(parts) + meshes.index(model_of(wanted, meshes)) if before is None else 0
                self.before = model if before is None else parts.index(before)
                self.after, self.registration = parts.index(after), wanted.registration
                self.method = self.method if wanted.with_model else wanted.method
                self._compare(lambda: wanted, wanted.after[0], context)
                return
        except InputError as error:
            self._drop(context)
            self._given_up = place_key(wanted, meshes)
            context.session.notices.say("A comparison of this project is not shown", error)
            return
        if self._colouring is None and (self._shown != wanted.in_picture or context.session.work.changes is None):
            work = colour_work(scene, self.made, context.document.edits, wanted)
            self._colouring = Worker(work, "Colouring the change", context.wake, niceness=BESIDE)

    def _leave_other(self, context: ToolContext) -> None:
        """Gives up what was compared where other scans are shown, or one was moved; what the document has is compared again."""
        scene: Scene | None = context.scene
        sources = () if scene is None else scene.meta.sources
        now = (sources, 0 if scene is None else scene.count, transforms_of(context.document.scans, sources))
        if now == self._of:
            return
        others, self._of = self._of is None or self._of[0] != sources, now
        if self.worker is not None:
            self.worker.cancel()
        self.worker = self._given_up = None
        self.beside = False
        self._drop(context)
        if others:
            self._to_points = False
            self.before, self.after = (1, 0) if len(sources) == 1 else (0, 1)

    def _take(self, comparison: DateComparison, coloured: Coloured, context: ToolContext) -> None:
        """Shows levels that were made."""
        session = context.session
        self.coloured, self._shown = coloured, comparison
        session.work.changes = coloured.levels
        coloured_by = comparison.shown == "change"
        legend = change_legend(coloured.found.limit, self.unit(context), with_model=comparison.with_model)
        session.work.change_legend = legend if coloured_by else None
        shows_points = session.view_settings.shown_settings.view in POINT_VIEWS
        if self._to_points and coloured_by and not shows_points:
            session.view_settings.show_points()
        self._to_points = False
        session.picture.renew()
        self._keep_figures(coloured, context)

    def _keep_figures(self, coloured: Coloured, context: ToolContext) -> None:
        """The document keeps what was found; where it has other figures, a file is another one than when it was saved."""
        work, figures = context.session.work, coloured.figures
        known = context.document.comparison
        if known is None or known.figures == figures:
            return
        if known.figures is not None:
            if not figures.differs(known.figures):
                return
            context.session.notices.say_also("A comparison has another result than before", *differing(known, figures))
        work.history.revise(lambda state: replace(state, comparison=replace(state.comparison, figures=figures))
                            if state.comparison is not None and state.comparison.compared == known.compared else state)

    @property
    def workers(self) -> "tuple[Worker | None, ...]":
        return self.worker, self._colouring, self.exporting

    @property
    def unfinished(self) -> str:
        return "A comparison is being written." if self._exporting is not None else ""

    def close(self) -> None:
        for worker in self.workers:
            end(worker)

    def panel(self, ui: Any, context: ToolContext) -> None:
        draw_panel(ui, self, context)
