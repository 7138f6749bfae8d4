"""The measurements of the document as a file, once the exact places of their points have been read."""

from contextlib import ExitStack
from pathlib import Path

from ....common.errors import PointglassError
from ....work.measuring.measure_files import write_measurements
from ...saving.capture import name_kept
from ..editing import facts_of
from ..tool import ToolContext


class MeasurementExport:
    """At most one waits for points; it keeps the name of its file."""

    def __init__(self) -> None:
        self._waiting: ExitStack | None = None

    def __bool__(self) -> bool:
        """Whether one waits for points."""
        return self._waiting is not None

    def start(self, context: ToolContext, path: Path) -> None:
        """Writes all measurements to ``path``, in the file's units, when the points that are being read are there; says where,
        or why not."""
        reading = context.session.work.exact_points
        if reading.busy:
            context.toast("The measurements are exported when their points have been read from the file")
            self._waiting = self._waiting or ExitStack()
            self._waiting.enter_context(name_kept(path))
        reading.when_read(lambda: self._write(context, path))

    def end(self) -> None:
        """Gives up what waits, and the name of its file."""
        waiting, self._waiting = self._waiting, None
        if waiting is not None:
            waiting.close()

    def _write(self, context: ToolContext, path: Path) -> None:
        try:
            write_measurements(path, context.document.measurements, facts_of(context))
        except PointglassError as error:
            context.session.notices.say("The measurements cannot be exported", error)
        else:
            context.tell_saved(path)
        self.end()
