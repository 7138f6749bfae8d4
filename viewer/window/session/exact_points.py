"""The file's own values of picked points, without a frame that waits for them.

A point whose record can be read quickly is read at once.  Otherwise a thread reads it, and the grid's values are used until it
has ended, and for good where the file cannot be read: ``Picked.note`` then says why.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import monotonic
from typing import TYPE_CHECKING, Protocol

from ...work.places.pick import Picked, exactly, is_quick
from ..kit.worker import Worker

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera


class Shown(Protocol):
    """What is shown when a point is picked.  wake: called on a thread when the point has been read."""

    @property
    def scene(self) -> "Scene | None": ...
    @property
    def camera(self) -> "Camera": ...
    def wake(self) -> None: ...


Arrived = Callable[[Picked], None]
_AT_ONCE = 2
"""Points that are read at the same time: the two ends of a distance, which may be in different files.  Each reading holds a
chunk of the file (viewer.readers.source.CHUNK) in memory."""


@dataclass(eq=False)
class _Reading:
    worker: Worker
    picked: Picked
    arrived: Arrived
    started: bool = False


class ExactPoints:
    """Points that are being read, in the order in which they were asked for."""

    def __init__(self) -> None:
        self._waiting: list[_Reading] = []
        self._then: list[Callable[[], object]] = []

    @property
    def busy(self) -> bool:
        """Whether a point is being read."""
        return bool(self._waiting)

    def of(self, context: Shown, picked: Picked, arrived: Arrived) -> Picked:
        """The point with the values of its file, where they can be read quickly; else as it is, and ``arrived`` is called with
        them by a later :meth:`poll`."""
        if context.scene is None or picked.exact:
            return picked
        if is_quick(context.scene, picked.index):
            return exactly(context.scene, context.camera, picked)
        self.start(context, picked, arrived)
        return picked

    def start(self, context: Shown, picked: Picked, arrived: Arrived) -> None:
        """Reads a point on a thread."""
        scene, camera = context.scene, context.camera
        if scene is None:
            return
        worker = Worker(lambda: exactly(scene, camera, picked), "Reading the point", context.wake, start=False)
        self._waiting.append(_Reading(worker, picked, arrived))
        self._start_next()

    def when_read(self, then: Callable[[], object]) -> None:
        """Calls ``then`` when no point is being read: now, or by a later :meth:`poll`."""
        if self._waiting:
            self._then.append(then)
        else:
            then()

    def poll(self) -> None:
        """Hands over the points that have been read.  Called once a frame."""
        for reading in [reading for reading in self._waiting if reading.worker.finished]:
            self._waiting.remove(reading)
            worker = reading.worker
            reading.arrived(worker.result if worker.error is None else replace(reading.picked, note=str(worker.error)))
        self._start_next()
        while self._then and not self._waiting:
            self._then.pop(0)()

    def wait(self, seconds: float) -> None:
        """Waits for the points that are being read, so long at most, and hands them over."""
        end = monotonic() + seconds
        while self._waiting and (left := end - monotonic()) > 0:
            self._waiting[0].worker.join(left)
            self.poll()

    def _start_next(self) -> None:
        for reading in self._waiting[:_AT_ONCE]:
            if not reading.started:
                reading.started = True
                reading.worker.start()
