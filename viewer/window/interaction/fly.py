"""Fly: drags that look around, the wheel for the speed.  The held keys (W, A, S, D, E, Q) move the camera with every tool.

The gestures about a point (orbit, pan, zoom, double click) are in ``around_point``.  Which button does what is chosen by the
person (viewer.window.flight.mouse).
"""

from typing import TYPE_CHECKING

from ..kit import icons
from .around_point import DRAG, AroundPoint
from .tool import PointerEvent, Tool, ToolContext
from .walk_mode import WalkMode

if TYPE_CHECKING:
    from ..kit.overlay import OverlayCanvas


class Fly(Tool):
    """The default tool.  It also receives what the selected tool does not use."""

    name, label, icon = "fly", "Fly", icons.FLY
    help = "drag to look around; W, A, S, D, E and Q fly"

    def __init__(self) -> None:
        self._pressed = False
        self._dragged = (0.0, 0.0)
        self.around_point, self.walk_mode = AroundPoint(), WalkMode()

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        flight = context.session.flight
        about_point = self.around_point.pointer(event, context)
        mouse = flight.preset
        if event.kind == "press" and mouse.drag(event.button, shift=event.modifiers.shift) == "look":
            self._pressed, self._dragged = True, (0.0, 0.0)
            return True
        if event.kind == "move" and self._pressed:
            self._look(event.delta, context)
            return True
        if event.kind in ("release", "leave") and self._pressed:
            self._pressed = False
            if flight.looking:
                flight.looking = False
                context.capture_pointer(False)
            return True
        if event.kind == "wheel" and not about_point:
            context.session.wheel(event.notches)
            return True
        return about_point

    def _look(self, delta: tuple[float, float], context: ToolContext) -> None:
        flight = context.session.flight
        if flight.looking:
            flight.look(*delta)
            return
        self._dragged = (self._dragged[0] + delta[0], self._dragged[1] + delta[1])
        if abs(self._dragged[0]) + abs(self._dragged[1]) > DRAG:
            flight.looking = True
            context.capture_pointer(True)
            flight.look(*self._dragged)

    def follow(self, context: ToolContext) -> None:
        self.walk_mode.follow(context)

    def close(self) -> None:
        self.walk_mode.close()

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        self.around_point.draw(overlay, context)
