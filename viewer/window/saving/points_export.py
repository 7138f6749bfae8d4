"""Exports the points in sight from the window: of no hidden file or station, and what the clips leave, as whole records or as
Gaussian splats.

The files are read again beside the window, as ``pointglass export`` does (viewer.commands.exporting); what the target cannot
hold is said when the file is there.
"""

from dataclasses import replace
from pathlib import Path

from ...commands.exporting.command import export
from ...commands.exporting.splat_export import BUDGET, SplatTarget, splat_target
from ...common.text import bytes_text, counted
from ...grid.records.point_marks import check_sets
from ...picture.point_sets import PointSet
from ...work.selection import Selection
from ..file_dialog.file_dialogs import FileDialogs
from ..kit.notices import Answer
from ..kit.worker import BESIDE, Worker
from ..session.session import Session
from .capture import name_kept

KINDS = {
    "LAZ, compressed LAS": (".laz",), "LAS": (".las",), "E57": (".e57",), "PLY": (".ply",), "Gaussian splats, glTF": (".glb",),
    "Gaussian splats, SPZ": (".spz",), "Gaussian splats, PLY": (".splats.ply",),
}  # fmt: skip
"""Kinds of file that the dialog offers; a test compares their endings with those that ``export`` writes."""
BUDGETS = {"2 million": BUDGET, "0.5 million": 500_000, "8 million": 8_000_000}
"""Splats at most: the answers to the question that follows a name of splats, the usual one first."""
_LAST_WAIT = 20.0
"""Seconds that a closing window waits until a given-up export has removed what it was writing."""


class PointsExport:
    """One export at a time.  worker: the one under way, else None."""

    def __init__(self, session: Session, files: FileDialogs):
        self._session, self._files = session, files
        self.worker: Worker | None = None
        self._out: Path | None = None
        self._losses: list[str] = []

    def ask(self, only: PointSet | None = None, what: str = "") -> None:
        """Asks where the points are to be saved, and begins.  only: of a region or a selection, which is called ``what``; None:
        all that are in sight."""
        shown = self._session.shown_scan
        if self._session.scene is None or shown.preview:
            how = self._session.loads.reading.how
            self._session.notices.toast(f"The points can be exported when all of them have been read{how}")
        elif self.worker is not None:
            self._session.notices.toast("The last export is still under way")
        elif only is not None:
            name = f"{shown.title.split('.')[0] or 'points'} {what}.laz"
            self._files.save("exports", f"Export the points of {what}", name, KINDS, lambda out: self.begin(out, only))
        else:
            name = f"{shown.title.split('.')[0] or 'points'} part.laz" if self._left_out else f"{shown.title} copy.laz"
            self._files.save("exports", f"Export {self.what}", name, KINDS, self.begin)

    def begin(self, out: Path, only: PointSet | None = None) -> None:
        """Exports to ``out``, of splats once a person has said how many.  only: as for :meth:`ask`."""
        if (target := splat_target(out)) is None:
            self.start(out, only)
            return
        answers = [Answer(label, lambda budget=budget: self.start(out, only, budget)) for label, budget in BUDGETS.items()]
        self._session.notices.ask("How many splats?", _about_budgets(out, target), (*answers, Answer("Cancel")))

    @property
    def _left_out(self) -> bool:
        """Whether something is left out: by clips, or with a hidden file or station."""
        document, scene = self._session.document, self._session.scene
        return document.drops or bool(scene and scene.hidden_stations(document))

    @property
    def what(self) -> str:
        """What would be exported now, in words."""
        return "the points in sight" if self._left_out else "all points"

    def start(self, out: Path, only: PointSet | None = None, budget: int | None = None) -> None:
        """Exports to ``out``, which may be replaced.  only: as for :meth:`ask`.  budget: splats at most."""
        session, document = self._session, self._session.document
        if session.scene is None:
            return
        scene = replace(session.scene, meta=session.facts)
        # a region that is exported by name need not be shown
        regions = tuple(region for region in document.regions if only is None or region.points != only)
        edits = replace(document.edits, regions=regions)
        self._out, self._losses = out, []

        def work() -> int:
            check_sets(scene, edits)
            with name_kept(out):
                return export(Selection.in_sight(scene, edits, only=only), out, up=edits.up, note=self._losses.append,
                              budget=budget)

        what = "points" if splat_target(out) is None else "splats"
        self.worker = Worker(work, f"Exporting {what} to {out.name}", session.loads.wake, niceness=BESIDE)

    def follow(self) -> None:
        """Called in every turn of the loop: says what was exported, or why nothing was."""
        if self.worker is None or not self.worker.finished:
            return
        done, self.worker = self.worker, None
        notices, out = self._session.notices, self._out
        if done.error is not None:
            notices.say("The points were not exported", done.error)
        elif done.result is None or out is None:
            notices.toast("The export was given up; nothing was saved")
        else:
            notices.tell_saved(out, f"Exported {counted(done.result, 'splat' if splat_target(out) else 'point')} to {out}")
            if self._losses:
                notices.say(f"{out.name} does not hold everything", "; ".join(self._losses))

    @property
    def unfinished(self) -> list[str]:
        """What would be lost if the window closed now, in sentences."""
        return ["Points are being exported."] if self.worker is not None else []

    def close(self) -> None:
        """Gives an export up and waits until it has removed what it was writing."""
        if self.worker is not None:
            self.worker.cancel()
            self.worker.join(_LAST_WAIT)


def _about_budgets(out: Path, target: SplatTarget) -> str:
    """What a person should know to choose one of BUDGETS."""
    sizes = ", ".join(f"{label} up to {bytes_text(round(budget * target.bytes))}" for label, budget in
                      sorted(BUDGETS.items(), key=lambda row: row[1]))
    return (f"{out.name} will hold Gaussian splats made from the points in sight, at most: {sizes}. Browsers and phones show "
            "0.5 to 2 million smoothly. More splats go where colours change and near scanners.")
