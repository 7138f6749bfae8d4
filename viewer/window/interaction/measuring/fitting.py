"""A surface that is fitted at a click, on a thread: the frame does not wait for it."""

import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from ....work.fits.fit import fit_at
from ....work.measure import MeasuredPoint
from ...kit.worker import Worker
from ..editing import drawn_points

if TYPE_CHECKING:
    from ....grid.scene import Scene
    from ..tool import ToolContext


class Fitting:
    """At most one surface at a time: a further click takes the place of the one before."""

    def __init__(self) -> None:
        self._worker: Worker | None = None
        self._point: MeasuredPoint | None = None
        self._scene: weakref.ref[Scene] | None = None

    @property
    def point(self) -> MeasuredPoint | None:
        """The point whose surface is being fitted."""
        return self._point

    def start(self, context: "ToolContext", kind: str, point: MeasuredPoint) -> None:
        """Fits a surface of a kind of viewer.work.fits.fit.KINDS to the drawn points around ``point``."""
        scene, kept = context.scene, drawn_points(context)
        if scene is None:
            return
        self._point, self._scene = point, weakref.ref(scene)
        self._worker = Worker(lambda: fit_at(scene, point.position, kind, kept), "Fitting the surface", context.wake)

    def stop(self) -> None:
        """Gives up what is being fitted."""
        if self._worker is not None:
            self._worker.cancel()
        self._worker = self._point = self._scene = None

    def moved(self, at_place: Callable[[list[MeasuredPoint]], list[MeasuredPoint]]) -> None:
        """Gives the point its place in the file, which has been read meanwhile."""
        if self._point is not None:
            (self._point,) = at_place([self._point])

    def taken(self, context: "ToolContext") -> MeasuredPoint | None:
        """The point with its surface, once, when that has been found.  Says so where there is none, and drops what belongs to a
        scan that is not shown any more."""
        if self._scene is not None and self._scene() is not context.scene:
            self.stop()
        worker, point = self._worker, self._point
        if worker is None or point is None or not worker.finished:
            return None
        self.stop()
        if worker.error is not None:
            line = str(worker.error)
            context.toast(line[:1].upper() + line[1:])
            return None
        return replace(point, fit=worker.result)
