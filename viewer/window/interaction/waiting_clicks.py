"""Clicks that ask what lies under the pointer while the picture is not at rest: they wait for it, in order, and none is lost.

A scan has just been opened, the camera has just stopped, points are still being uploaded: what is under the pointer is known a
moment later.  A click is answered then, at what it was made at, also where the picture has another size by then (a panel has
opened beside it); where the camera is elsewhere, a line says that the click was not answered.
"""

from time import perf_counter
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

import numpy as np

from ...picture.camera import Camera

if TYPE_CHECKING:
    from ..session.session import Session
    from ..viewport.viewport import Viewport

Event = TypeVar("Event")
Place = tuple[float, float]
"""Column and row in pixels of the picture."""

POINTS_S = 3.0
"""Seconds that a click waits for points that are being uploaded; then the points that are there answer it, as in a scan that
does not fit the GPU.  Reading and checking take 8 ms of a processor a million points (studio.laz, in the system's cache): 3 s
bring 370 million, 4.5 GB.  It is below the 10 s that a person attends to a task without an answer (Nielsen 1993)."""
KEYS = ("ENTER", "KP_ENTER", "BACKSPACE", "DELETE")
"""Keys that mean the click before them, and wait behind it."""
_MOVED = "The picture moved before the click could be answered: click again"


class Host(Protocol):
    """What the picture's rest is known by: the parts of a ToolContext."""

    session: "Session"
    viewport: "Viewport"

    @property
    def scene(self) -> object: ...
    @property
    def camera(self) -> "Camera": ...
    def toast(self, text: str) -> None: ...
    def wake(self) -> None: ...


class WaitingClicks(Generic[Event]):
    """The events that wait, of the tool that is selected."""

    def __init__(self) -> None:
        self._events: list[tuple[Event, Place | None, Camera, float]] = []

    def __bool__(self) -> bool:
        """Whether an event waits."""
        return bool(self._events)

    def keeps(self, event: Event, context: Host, at: Place | None = None) -> bool:
        """Whether an event waits; it is kept then.  at: the click's place in the picture; None: a key, which waits only behind
        a click."""
        if not self._events and (at is None or at_rest(context, points=True)):
            return False
        self._events.append((event, at, context.camera, perf_counter()))
        return True

    def answerable(self, context: Host) -> list[tuple[Event, Place | None]]:
        """The events that can be answered now, each with its place in the picture; none waits any more then.  Where the picture
        has moved since, says so."""
        if not self._events:
            return []
        if context.scene is None:
            self.forget()
            return []
        if not at_rest(context, points=perf_counter() - self._events[-1][3] < POINTS_S):
            return []
        events, camera = self._events, context.camera
        self.forget()
        context.wake()
        found = [(event, at, at if at is None else _same_ray(at, there, camera)) for event, at, there, _ in events]
        if any(at is not None and now is None for _, at, now in found):
            context.toast(_MOVED)
            return []
        return [(event, now) for event, _, now in found]

    def forget(self) -> None:
        """Another tool is selected, or what was begun is given up."""
        self._events = []


def at_rest(context: Host, *, points: bool) -> bool:
    """Whether the picture on the screen tells what is under the pointer.  points: only where none is missing in it."""
    frame, session = context.viewport.frame, context.session
    if frame is None or session.flight.moving or session.screen.needs_picture:
        return False
    return not (points and frame.facts.points_missing)


def _same_ray(at: Place, there: Camera, here: Camera) -> Place | None:
    """The place in the picture of one camera that shows what ``at`` shows in that of another; None where they do not stand and
    look alike, or where it is outside."""
    if not np.array_equal(there.camera_to_world, here.camera_to_world) or there.orthographic != here.orthographic:
        return None
    column = here.cx + (at[0] - there.cx) * (here.fx / there.fx)
    row = here.cy + (at[1] - there.cy) * (here.fy / there.fy)
    return (column, row) if 0 <= column <= here.width and 0 <= row <= here.height else None
