"""Compare: how far the surfaces of one scan lie from those of an earlier one, as colours of its points.

Both are files of the scene.  What is compared and how it is shown is part of the document, so that it is undone, saved and
restored; distances, and the levels of colours made of them, follow from it and are computed on a thread.
"""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....common.errors import InputError
from ....picture.dates.date_comparison import ChangeFigures, DateComparison
from ....picture.views import POINT_VIEWS
from ....work.comparing.scene_changes import Coloured, SceneDistances, compared_files, keys_of
from ....work.measuring.measure_text import unit_name
from ....work.pictures.points_legend import change_legend
from ....work.project import moves_of
from ....work.registration.moved_files import transforms_of
from ....work.scan_files import FilePart, files_of
from ...kit import icons
from ...kit.worker import Worker
from ...session.two_dates import dates_of
from ..editing import edit, end, ended, metres_per_unit
from ..tool import Tool, ToolContext
from .compare_panel import draw_panel
from .compare_work import colour_work, compare_work, fresh_folder, share_limit

if TYPE_CHECKING:
    from ....grid.scene import Scene

FOLDER = "comparisons"
"""Of the remembered folder (viewer.window.file_dialog)."""


def _differing(known: DateComparison, now: ChangeFigures) -> list[str]:
    """Lines that say what a comparison found when the project was saved, and what it finds now."""
    assert known.figures is not None
    then = known.figures
    texts = [f"{figures.changed:,} of {figures.points:,} points changed, median " +
             ("unknown" if figures.median is None else f"{figures.median:.3g}") for figures in (then, now)]
    return [f"{known.before[0]} and {known.after[0]}: {texts[0]} when it was saved; now {texts[1]}. A file, its place or this "
            "program is another one."]


class Compare(Tool):
    """before, after: numbers of files.  method: a key of METHODS.  registration: uncertainty (95 %), file units.
    beside: whether the handle has the two dates without a comparison, too.  made, coloured: of the document's comparison, None
    until they are there."""

    name, label, icon = "compare", "Compare", icons.COMPARE
    help = "colour a scan by how far it lies from an earlier one"

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
        self._given_up: DateComparison | None = None  # that cannot be shown, or was cancelled
        self._to_points = False  # whether a view with the colours of points is chosen when they are there
        self._of: object = None

    # ---- what there is

    def parts(self, context: ToolContext) -> list[FilePart]:
        """The files of the scene; none where it does not tell them apart, or is not complete."""
        scene = context.scene
        if scene is None or context.session.shown_scan.preview:
            return []
        found = files_of(scene)
        return found if all(part.apart for part in found) else []

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
        parts = self.parts(context)
        if context.scene is None or max(self.before, self.after) >= len(parts) or self.before == self.after:
            return
        keys = keys_of(context.scene)
        self._compare(DateComparison(keys[self.before], keys[self.after], self.method, self.registration), context)

    def _compare(self, comparison: DateComparison, context: ToolContext) -> None:
        assert context.scene is not None
        self.worker = Worker(compare_work(context.scene, comparison), f"Comparing {comparison.after[0]}", context.wake)

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
        self.made = self.coloured = self._shown = None
        work = context.session.work
        if work.changes is not None:
            work.changes = work.change_legend = None
            context.session.view_settings.show_colours()

    def open_other(self, context: ToolContext) -> None:
        """Asks for a second scan, which is opened with the one that is shown."""
        from ....readers.formats import FORMATS

        endings = tuple(dict.fromkeys(suffix for row in FORMATS for suffix in row.suffixes))
        shown = list(context.session.shown_scan.paths)
        context.files.open("scans", "Open the scan to compare with", {"Scans": endings},
                           lambda paths: context.open_scans([*shown, *paths]))

    def export(self, context: ToolContext) -> None:
        """Asks for a folder and writes there what `pointglass compare` writes."""
        parts, document = self.parts(context), context.document
        if self.made is None or self._exporting is not None or max(self.before, self.after) >= len(parts):
            return
        before, after = (Path(parts[number].path) for number in (self.before, self.after))
        limit = None if self.coloured is None else self.coloured.found.limit

        def chosen(parent: Path) -> None:
            from ....commands.comparing.command import write_comparison

            out = fresh_folder(parent, f"{after.stem}-compared")
            work = Worker(lambda: write_comparison(before, after, out, method=self.method, registration=self.registration,
                                                   limit=limit, moves=moves_of(document.scans)),
                          f"Writing {out.name}", context.wake)  # fmt: skip
            self._exporting = work, out

        context.files.open_folder(FOLDER, "Folder for the comparison", chosen)

    def follow(self, context: ToolContext) -> None:
        self._leave_other(context)
        self._follow_dates(context)
        if (done := ended(self.worker, context, "The scans were not compared")) is not None:
            self.worker = None
            known = context.document.comparison
            if done.result is None or done.cancelled or context.scene is None or done.result[1].count != context.scene.count:
                self._given_up = known if self.made is None else None
            else:
                comparison, self.made = done.result
                self._given_up = None
                if known is None or known.compared != comparison.compared:
                    self._to_points = True
                    edit(context, "Compare", comparison=comparison)
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

    def _follow_document(self, context: ToolContext) -> None:
        """Makes what the document's comparison needs: it was opened, undone or changed."""
        wanted, scene = context.document.comparison, context.scene
        if wanted is None or scene is None:
            if self.made is not None or context.session.work.changes is not None:
                self._drop(context)
            self._given_up = None
            return
        if wanted == self._given_up or self.worker is not None or not self.parts(context):
            return
        if self.made is None or self.made.compared != wanted.compared:
            self._drop(context)
            try:
                parts, (before, after) = self.parts(context), compared_files(scene, wanted)
            except InputError as error:
                self._given_up = wanted
                context.session.notices.say("A comparison of this project is not shown", error)
                return
            self.before, self.after = parts.index(before), parts.index(after)
            self.method, self.registration = wanted.method, wanted.registration
            self._compare(wanted, context)
        elif self._colouring is None and (self._shown != wanted.in_picture or context.session.work.changes is None):
            work = colour_work(scene, self.made, context.document.edits, wanted)
            self._colouring = Worker(work, "Colouring the change", context.wake)

    def _leave_other(self, context: ToolContext) -> None:
        """Gives up what was compared where other scans are shown, or one was moved; what the document has is compared again."""
        scene: Scene | None = context.scene
        sources = () if scene is None else scene.meta.sources
        now = (sources, 0 if scene is None else scene.count, transforms_of(context.document.scans, sources))
        if now == self._of:
            return
        self._of = now
        for worker in (self.worker, self._colouring):
            if worker is not None:
                worker.cancel()
        self.worker = self._colouring = self._given_up = None
        self.before, self.after = (0, 1) if max(self.before, self.after) >= len(sources) else (self.before, self.after)
        self.beside = False
        self._drop(context)

    def _take(self, comparison: DateComparison, coloured: Coloured, context: ToolContext) -> None:
        """Shows levels that were made."""
        session = context.session
        self.coloured, self._shown = coloured, comparison
        session.work.changes = coloured.levels
        coloured_by = comparison.shown == "change"
        session.work.change_legend = change_legend(coloured.found.limit, self.unit(context)) if coloured_by else None
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
            context.session.notices.say_also("A comparison has another result than before", *_differing(known, figures))
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
