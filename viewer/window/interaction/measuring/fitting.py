"""Surfaces that are fitted at clicks, one after the other on a thread: the frame does not wait, and no click is lost."""

import weakref
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from ....work.fits.fit import fit_at
from ....work.measuring.measurement import KINDS, MeasuredPoint
from ...kit.worker import Worker
from ..editing import drawn_points

if TYPE_CHECKING:
    from ....grid.scene import Scene
    from ..tool import ToolContext


class Fitting:
    """The points that wait for their surface, in the order of their clicks, and those without one that were set behind them."""

    def __init__(self) -> None:
        self._waiting: list[tuple[str, MeasuredPoint]] = []
        self._worker: Worker | None = None  # of the first
        self._scene: weakref.ref[Scene] | None = None

    @property
    def points(self) -> list[MeasuredPoint]:
        """Those that wait."""
        return [point for _, point in self._waiting]

    def of(self, kind: str) -> list[MeasuredPoint]:
        """Those of measurements of a kind."""
        return [point for name, point in self._waiting if name == kind]

    def add(self, context: "ToolContext", kind: str, point: MeasuredPoint) -> bool:
        """A point of a measurement of a kind of KINDS.  Returns whether a surface is being fitted: not at a place on a mesh."""
        if point.spacing == 0 and not self._waiting:
            context.toast(f"{point.scan} is not measured here: surfaces are fitted to points")
            return False
        if context.scene is not None:
            self._scene = weakref.ref(context.scene)
            self._waiting.append((kind, point))
        return True

    def drop_last(self) -> None:
        """Takes back the last point that waits."""
        self._waiting.pop()
        if not self._waiting:
            self.stop()

    def drop(self, kind: str) -> None:
        """Gives up what was set of measurements of a kind."""
        if self._waiting and self._waiting[0][0] == kind:
            self._end_worker()
        self._waiting = [(name, point) for name, point in self._waiting if name != kind]

    def stop(self) -> None:
        """Gives up all that waits."""
        self._end_worker()
        self._waiting, self._scene = [], None

    def moved(self, at_place: Callable[[list[MeasuredPoint]], list[MeasuredPoint]]) -> None:
        """Gives points their place in the file, which has been read meanwhile."""
        self._waiting = [(kind, point) for (kind, _), point in zip(self._waiting, at_place(self.points), strict=True)]

    def taken(self, context: "ToolContext", placed: int) -> tuple[str, MeasuredPoint] | None:
        """The kind and the next point with its surface, once, when that has been found; None where there is none yet.
        placed: how many points of a measurement of several surfaces are set.  Says so where nothing can be fitted.  Where all
        points have taken the place of a preview meanwhile, surfaces are fitted to them."""
        if context.scene is None:
            self.stop()
        elif self._scene is not None and self._scene() is not context.scene:
            self._end_worker()
            self._scene = weakref.ref(context.scene)
        while self._waiting:
            kind, point = self._waiting[0]
            surface = KINDS[kind].surface(placed if KINDS[kind].most != 1 else 0)
            if surface is not None and self._worker is None:
                self._worker = _worker(context, point, surface)
            if self._worker is not None and not self._worker.finished:
                return None
            worker, self._worker = self._worker, None
            self._waiting.pop(0)
            if worker is None or worker.error is None:
                return kind, replace(point, fit=worker.result, beyond=None) if worker is not None else point
            line = str(worker.error)
            context.toast(line[:1].upper() + line[1:])
        return None

    def _end_worker(self) -> None:
        if self._worker is not None:
            self._worker.cancel()
        self._worker = None


def _worker(context: "ToolContext", point: MeasuredPoint, surface: str) -> Worker:
    """Fits a surface of a kind of viewer.work.fits.fit.KINDS to the drawn points around ``point``."""
    scene, kept = context.scene, drawn_points(context)
    assert scene is not None
    return Worker(lambda: fit_at(scene, point.position, surface, kept), "Fitting the surface", context.wake)
