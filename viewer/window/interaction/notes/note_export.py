"""Saves the notes from the window: a report with pictures (PDF), issues (BCF) or a table (CSV), beside the window.

The same files as ``pointglass report`` makes of the saved project (viewer.commands.report), of what is there now.
"""

from contextlib import ExitStack
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....commands.report.report_job import ENDINGS, ReportJob
from ....commands.report.report_pdf import Wording
from ...kit.widgets import tooltip_beside
from ...kit.worker import Worker
from ...saving.capture import name_kept
from ..editing import end, ended

if TYPE_CHECKING:
    from ..tool import ToolContext


class NoteExport:
    """One export at a time.  worker: the one under way, else None."""

    def __init__(self) -> None:
        self.worker: Worker | None = None
        self._out: Path | None = None
        self._missing: list[str] = []
        self._waiting: ExitStack | None = None  # for points that are being read; it keeps the name of the file

    def draw(self, ui: Any, context: "ToolContext") -> None:
        """The button."""
        if ui.button("Report…"):
            self.ask(context)
        if ui.is_item_hovered():
            tooltip_beside(ui, f"Saves viewpoints, notes and measurements as {', '.join(ENDINGS)}")

    def ask(self, context: "ToolContext") -> None:
        """Asks where the file is to be saved, and begins."""
        shown = context.session.shown_scan
        if context.scene is None or shown.preview:
            context.toast(f"A report can be made when all points have been read{context.session.loads.reading.how}")
        elif self.worker is not None or self._waiting is not None:
            context.toast("The last report is still being made")
        else:
            name = f"{shown.title.split('.')[0] or 'scan'} report.pdf"
            context.files.save("reports", "Save the report", name, ENDINGS, lambda path: self.start(context, path))

    def start(self, context: "ToolContext", out: Path) -> None:
        """Makes the file, which may be replaced, when the points that are being read are there."""
        self._waiting = ExitStack()
        self._waiting.enter_context(name_kept(out))
        context.session.work.exact_points.when_read(lambda: self._begin(context, out))

    def _begin(self, context: "ToolContext", out: Path) -> None:
        waiting, self._waiting = self._waiting, None
        session = context.session
        if waiting is None or session.scene is None:
            return
        waiting.close()
        scene, view = replace(session.scene, meta=session.facts), session.view_settings
        document = session.work.as_saved(session.camera, view.shown_settings, view.background)
        name = session.work.project.stem if session.work.project is not None else session.shown_scan.title
        self._out, self._missing = out, []
        wording = Wording(name, date=date.today().isoformat())
        job = ReportJob(scene, document, session.work.project, out, document.viewpoints, wording, self._missing.append)

        def work() -> str:
            with name_kept(out):
                return job.write()

        self.worker = Worker(work, f"Making {out.name}", session.loads.wake)

    def follow(self, context: "ToolContext") -> None:
        """Called in every turn of the loop: says what was saved, or why not."""
        if (done := ended(self.worker, context, "The report was not saved")) is None:
            return
        self.worker = None
        if done.error is not None:
            return
        if done.result is None or self._out is None:
            context.toast("The report was given up; nothing was saved")
            return
        context.tell_saved(self._out, f"Saved {done.result} to {self._out}")
        if self._missing:
            context.session.notices.say(f"{self._out.name} does not show everything", "; ".join(self._missing))

    @property
    def unfinished(self) -> str:
        return "A report is being made." if self.worker is not None or self._waiting is not None else ""

    def close(self) -> None:
        """Gives an export up and waits until it has removed what it was writing."""
        if self._waiting is not None:
            self._waiting.close()
        end(self.worker)
