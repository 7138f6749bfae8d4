"""Compare: how far the surfaces of one scan lie from those of an earlier one, as colours of its points.

Both are files of the scene.  Distances, and the levels of colours made of them, are computed on a thread; the document does not
change, so that there is nothing to undo: "Own colours" ends it.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....work.comparing.change_levels import ramp_of_legend
from ....work.measuring.measure_text import unit_name
from ....work.pictures.picture_legend import Legend
from ....work.project import moves_of
from ....work.registration.moved_files import transforms_of
from ....work.scan_files import FilePart, files_of
from ...kit import icons
from ...kit.worker import Worker
from ...session.two_dates import dates_of
from ..editing import end, ended, metres_per_unit
from ..tool import Tool, ToolContext
from .compare_panel import draw_panel
from .compare_work import Coloured, Comparison, Shown, colour_work, compare_work, fresh_folder, share_limit

if TYPE_CHECKING:
    from ....grid.scene import Scene

FOLDER = "comparisons"
"""Of the remembered folder (viewer.window.file_dialog)."""


class Compare(Tool):
    """before, after: numbers of files.  method: a key of METHODS.  registration: uncertainty (95 %), file units.
    shown, limit, certain: as of colour_work; limit None: chosen by the changes.  beside: whether the handle has the two dates
    without a comparison, too.  made, coloured: of the last comparison."""

    name, label, icon = "compare", "Compare", icons.COMPARE
    help = "colour a scan by how far it lies from an earlier one"

    def __init__(self) -> None:
        self.before, self.after = 0, 1
        self.method, self.registration = "m3c2", 0.0
        self.shown: Shown = "change"
        self.limit: float | None = None
        self.certain = self.beside = False
        self.made: Comparison | None = None
        self.coloured: Coloured | None = None
        self.worker: Worker | None = None
        self._colouring: Worker | None = None
        self._again = False
        self._exporting: tuple[Worker, Path] | None = None
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
        there = (self.beside or self.made is not None) and max(self.before, self.after) < len(parts)
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
        work = compare_work(context.scene, parts[self.before], parts[self.after], self.method, self.registration)
        self.worker = Worker(work, f"Comparing {Path(parts[self.after].path).name}", context.wake)

    def show(self, context: ToolContext, **chosen: Any) -> None:
        """Shows the comparison in another way: shown, limit or certain."""
        for name, value in chosen.items():
            setattr(self, name, value)
        self._colour(context)

    def show_share(self, context: ToolContext, share: float) -> None:
        """The colours end where a share of the distances ends."""
        if self.made is not None and (limit := share_limit(self.made, share)) is not None:
            self.show(context, limit=limit)

    def _colour(self, context: ToolContext) -> None:
        if self.made is None or context.scene is None:
            return
        if self._colouring is not None:
            self._again = True
            return
        work = colour_work(context.scene, self.made, context.document.edits, self.shown, self.limit, certain=self.certain)
        self._colouring = Worker(work, "Colouring the change", context.wake)

    def put_away(self, context: ToolContext) -> None:
        """Points have their own colours again."""
        self.made, self.coloured, self.beside = None, None, False
        context.session.work.changes = context.session.work.change_legend = None
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
            if done.result is not None and not done.cancelled and context.scene is not None \
                    and done.result.count == context.scene.count:
                self.made, self.limit, self.shown = done.result, None, "change"
                self._colour(context)
        if (done := ended(self._colouring, context, "The change cannot be shown")) is not None:
            self._colouring = None
            if done.result is not None and self.made is not None and not self._again:
                self._take(done.result, context)
            elif self._again:
                self._again = False
                self._colour(context)
        if self._exporting is not None and ended(self._exporting[0], context, "The comparison was not written") is not None:
            (done, out), self._exporting = self._exporting, None
            if done.result is not None and not done.cancelled:
                context.tell_saved(out)

    def _leave_other(self, context: ToolContext) -> None:
        """Gives up what was compared where other scans are shown, or one was moved."""
        scene: Scene | None = context.scene
        sources = () if scene is None else scene.meta.sources
        now = (sources, 0 if scene is None else scene.count, transforms_of(context.document.scans, sources))
        if now == self._of:
            return
        self._of = now
        for worker in (self.worker, self._colouring):
            if worker is not None:
                worker.cancel()
        self.before, self.after = (0, 1) if max(self.before, self.after) >= len(sources) else (self.before, self.after)
        self.beside = False
        if self.made is not None:
            self.put_away(context)

    def _take(self, coloured: Coloured, context: ToolContext) -> None:
        """Shows levels that were made."""
        session, found = context.session, coloured.found
        self.coloured = coloured
        session.work.changes = coloured.levels
        unit = self.unit(context)
        ends = (f"{sign}{found.limit:.4g} {unit}" for sign in ("-", ""))
        session.work.change_legend = None if self.shown != "change" else Legend(
            "distance after - before", (), ramp_of_legend(), *ends)
        if self.shown == "change" and session.view_settings.shown_settings.view not in ("raw", "filtered"):
            session.view_settings.show_points()
        session.picture.renew()

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
