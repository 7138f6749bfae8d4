"""Clicks that ask what lies under the pointer while the picture is not at rest: they wait for it, in order, and none is lost.

A scan has just been opened, the camera has just stopped, points are still being uploaded: what is under the pointer is known a
moment later.  A click is answered then, at the place in the picture where it was made; where the camera is elsewhere by then,
that place shows something else, and a line says that the click was not answered.
"""

from time import perf_counter
from typing import TYPE_CHECKING, Generic, Protocol, TypeVar

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ..session.session import Session
    from ..viewport.viewport import Viewport

Event = TypeVar("Event")

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
        self._events: list[tuple[Event, tuple, float]] = []

    def keeps(self, event: Event, context: Host, *, click: bool = True) -> bool:
        """Whether an event waits; it is kept then.  click: it is one; a key waits only behind a click."""
        if not self._events and (not click or at_rest(context, points=True)):
            return False
        self._events.append((event, _place(context), perf_counter()))
        return True

    def answerable(self, context: Host) -> list[Event]:
        """The events that can be answered now; none waits any more then.  Where the picture has moved since, says so."""
        if not self._events:
            return []
        if context.scene is None:
            self.forget()
            return []
        if not at_rest(context, points=perf_counter() - self._events[-1][2] < POINTS_S):
            return []
        events, place = self._events, _place(context)
        self.forget()
        context.wake()
        if any(there != place for _, there, _ in events):
            context.toast(_MOVED)
            return []
        return [event for event, _, _ in events]

    def forget(self) -> None:
        """Another tool is selected, or what was begun is given up."""
        self._events = []


def at_rest(context: Host, *, points: bool) -> bool:
    """Whether the picture on the screen tells what is under the pointer.  points: only where none is missing in it."""
    frame, session = context.viewport.frame, context.session
    if frame is None or session.flight.moving or session.screen.needs_picture:
        return False
    return not (points and frame.facts.points_missing)


def _place(context: Host) -> tuple:
    """What a position in the picture depends on."""
    camera = context.camera
    return camera.width, camera.height, camera.fy, camera.camera_to_world.tobytes()
