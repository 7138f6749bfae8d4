"""Walk mode: begins and ends walking on the floor, and builds the map of the floor on a thread when it is first needed."""

from functools import partial
from typing import TYPE_CHECKING

from ...picture.regions import hidden_regions
from ...work.places.walk_map import WalkMap, build_walk_map
from ...work.selection import Selection
from ..flight.walking import PACE, stand
from ..kit.notices import ToastSubject
from ..kit.worker import Worker
from .editing import end, ended, metres_per_unit

if TYPE_CHECKING:
    from .tool import ToolContext


def _more_to_come(context: "ToolContext") -> bool:
    """Whether the points shown are a preview and the others are being loaded."""
    session = context.session
    return session.shown_scan.preview and session.loads.current is not None


class WalkMode:
    """One window's.  on: whether the person walks, or will as soon as there is a floor: of a preview it may not be seen yet."""

    def __init__(self) -> None:
        self.on = False
        self._map: WalkMap | None = None
        self._of: tuple | None = None  # what the map is of: scene, direction that is up, unit, clips, hidden stations
        self._build: Worker | None = None
        self._flying_speed = 0.0
        self._waits = False  # for a floor to begin on
        self._work: object = None  # the history of the work that the map is for

    def toggle(self, context: "ToolContext") -> None:
        """Walks from where the camera is, or flies again."""
        if context.scene is None:
            return
        if self.on:
            self._fly(context, "Flying")
            return
        self.on = self._waits = True
        if self._of == self._wanted(context) and self._build is None:
            self._begin(context)
        else:
            self._start_build(context)
            context.session.notices.toast("Finding the floor…", subject=ToastSubject.FLOOR)

    def _wanted(self, context: "ToolContext") -> tuple:
        document, scene = context.document, context.scene
        hidden = frozenset() if scene is None else scene.hidden_stations(context.document)
        hiding = document.hidden_classes, hidden_regions(document.regions)
        return scene, tuple(document.up), metres_per_unit(context), document.clips, hidden, hiding

    def _start_build(self, context: "ToolContext") -> None:
        scene, _, metres, *_ = self._of = self._wanted(context)
        self._work = context.session.work.history
        if self._build is not None:
            self._build.cancel()
        sight = Selection.in_sight(scene, context.document)
        work = partial(build_walk_map, sight, context.session.flight.state.upright, 1.0 / (metres or 1.0))
        self._map, self._build = None, Worker(work, "Finding the floor", context.session.loads.wake)

    def _begin(self, context: "ToolContext") -> None:
        flight, metres = context.session.flight, metres_per_unit(context)
        if self._map is None and _more_to_come(context):
            return  # follow() looks again when they are there
        if self._map is None:
            self._fly(context, "No walking here: the points in sight are too far apart to tell a step from a wall")
            return
        flight.to_perspective()  # nobody stands where an orthographic camera is
        walker = stand(self._map, flight.state)
        if walker is None and _more_to_come(context):
            return
        if walker is None:
            self._fly(context, "No floor below: still flying")
            return
        self._waits = False
        if flight.walker is None:
            self._flying_speed = flight.state.speed
        flight.walk(walker, PACE * self._map.metre)
        message = "Walking; G flies again" if metres else "Walking; one unit of the file is taken for a metre"
        context.session.notices.toast(message, subject=ToastSubject.FLOOR)

    def _fly(self, context: "ToolContext", text: str) -> None:
        flight, self.on, self._waits = context.session.flight, False, False
        flight.fly(self._flying_speed or flight.state.speed)
        self._flying_speed = 0.0
        context.session.notices.toast(text, subject=ToastSubject.FLOOR)

    def follow(self, context: "ToolContext") -> None:
        """Takes the map when it is built; notes that a walk has ended."""
        flight = context.session.flight
        if self._of is not None and self._of != self._wanted(context):
            self._drop()
            goes_on = self._work is context.session.work.history and (self._waits or flight.walker is not None)
            if self.on and goes_on and context.scene is not None:  # more points, or a unit
                self._start_build(context)
                return
            self._waits = False
            self._flying_speed = 0.0  # another scan begins with its own
            if context.scene is None:
                self.on, flight.walker = False, None
        if (done := ended(self._build, context, "The floor cannot be found")) is not None:
            self._build, self._map = None, done.result
            if done.error is not None:
                self._drop()
                self.on = self._waits = False
            elif self.on and context.scene is not None:
                self._begin(context)
        elif self.on and self._waits and self._build is None and context.scene is not None:
            if not _more_to_come(context):  # the load was given up
                self._begin(context)
        elif self.on and flight.walker is None and self._build is None:
            self._fly(context, "No floor below: flying again" if flight.floor_lost else "Flying")

    def _drop(self) -> None:
        if self._build is not None:
            self._build.cancel()
        self._map = self._of = self._build = None

    def close(self) -> None:
        """Ends the work under way."""
        end(self._build)
