"""Work on sets of points beside the window: one at a time, listed with its progress, taken as one step of the document."""

import weakref
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ...kit.worker import Worker
from ..editing import end, ended

if TYPE_CHECKING:
    from ....grid.scene import Scene
    from ..tool import ToolContext

Work = Callable[[], Any]
Done = Callable[[Any], None]


class SetJob:
    """worker: what is under way, else None."""

    def __init__(self) -> None:
        self.worker: Worker | None = None
        self._done: Done = lambda _: None
        self._of: tuple[weakref.ref[Scene], object] | None = None  # the scene, and the sets that it began with

    def start(self, context: "ToolContext", title: str, work: Work, done: Done) -> bool:
        """Begins ``work``; ``done`` takes its result, unless the sets or the scan have changed by then.  Returns whether it was
        begun: a line says why it was not."""
        if context.scene is None or context.session.shown_scan.preview:
            context.toast(f"Points can be selected when all of them have been read{context.session.loads.reading.how}")
        elif self.worker is not None:
            context.toast("The last selection is still under way")
        else:
            self._of, self._done = (weakref.ref(context.scene), _sets(context)), done
            self.worker = Worker(work, title, context.wake)
            return True
        return False

    def follow(self, context: "ToolContext") -> None:
        """Takes what has ended."""
        done = ended(self.worker, context, "This selection could not be made")
        if done is None:
            return
        self.worker = None
        if done.error is not None or done.cancelled or self._of is None:
            return
        if self._of[0]() is not context.scene or self._of[1] != _sets(context):
            context.toast("The points or their sets changed meanwhile: select again")
            return
        self._done(done.result)

    def close(self) -> None:
        """Gives up what is under way."""
        end(self.worker)


def _sets(context: "ToolContext") -> object:
    document = context.document
    return document.selection, document.regions, document.reclassified, document.hidden_classes, document.clips
