"""The gestures about a point of the scene: drags that orbit or move it, the wheel that zooms, a double click that flies there.
They work with every tool; Fly receives them.  Which drag does what: viewer.window.flight.mouse.

The point is the nearest measured one around the pointer, read from the depth of the picture that is on the screen.  Where
nothing was measured, it is the middle of the scan.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...work.places.approach import approach
from ...work.places.pick import nearest_pixel
from ..flight.navigation import view_along
from ..flight.orbit import orbited, panned, zoomed
from ..flight.parallel_moves import zoom_of
from .editing import frame_at, metres_per_unit

if TYPE_CHECKING:
    from ..kit.overlay import OverlayCanvas
    from .tool import PointerEvent, ToolContext

RADIUS = 24.0
"""Design units around the pointer within which a measured point is taken; for measuring, where a wrong one harms, fewer."""
DRAG = 3.0
"""Logical pixels that the pointer moves before a press becomes a drag; a click must not turn the camera or hide the pointer."""
NEAREST = 4.0
"""Point spacings from the point at which zooming stops: nearer, a picture holds a handful of points."""


def measured_under(context: "ToolContext", position: tuple[float, float]) -> np.ndarray | None:
    """(3,) the nearest measured point around a position of the picture on the screen; None where none is near."""
    if (frame := frame_at(context, position)) is None:
        return None
    read = context.viewport.pixels.read
    depth, mask = read(frame, "depth", wait=True), read(frame, "mask", wait=True)
    assert depth is not None and mask is not None, "waited for"
    scale = depth.shape[0] / context.camera.height
    pixel = nearest_pixel(mask, depth, (position[0] * scale, position[1] * scale), context.pixels(RADIUS) * scale)
    if pixel is None:
        return None
    return frame.camera.unproject([(pixel[0] + 0.5, pixel[1] + 0.5)], float(depth[pixel[1], pixel[0]]))[0]


def pivot_at(context: "ToolContext", position: tuple[float, float]) -> np.ndarray:
    """(3,) the measured point around a position; else the middle of the scan or, where that is behind the camera, a point as
    far away as it on the ray through the position."""
    point = measured_under(context, position)
    if point is not None:
        return point
    middle, camera = context.session.flight.middle, context.camera
    if float(camera.project([middle])[1][0]) > 0:
        return middle
    origin, along = context.ray(position)
    return origin + along * max(float(np.linalg.norm(middle - origin)), NEAREST * _spacing(context))


def _spacing(context: "ToolContext") -> float:
    """Of the scan's points, file units, above 0."""
    scene = context.scene
    return max(scene.spacing, scene.step) if scene is not None else 1.0


class AroundPoint:
    """pivot: (3,) the point that a gesture under way is about, else None."""

    def __init__(self) -> None:
        self.pivot: np.ndarray | None = None
        self._begun: tuple[PointerEvent, str] | None = None  # the press of a drag, and its gesture
        self._dragged = (0.0, 0.0)  # since the press
        self._captured = False
        self._grabbed = (0.0, 0.0)  # from the pointer to the pixel of the pivot
        self._zoom: tuple[tuple[float, float], np.ndarray] | None = None  # where the wheel turned, and about what

    def pointer(self, event: "PointerEvent", context: "ToolContext") -> bool:
        """Handles an event.  Returns whether it was one of these gestures."""
        mouse, held = context.session.flight.preset, event.modifiers
        if event.kind == "press" and (gesture := mouse.drag(event.button, shift=held.shift)) in ("orbit", "pan"):
            self._begun, self._dragged, self._zoom = (event, gesture), (0.0, 0.0), None
            if event.button == "middle":  # no tool takes its clicks: the point is marked at once
                self._begin(event, context)
            return True
        if event.kind == "move" and self._begun is not None:
            self._drag(event, *self._begun, context)
            return True
        if event.kind in ("release", "leave") and self._begun is not None:
            self._end(context)
            if not (event.button == "left" and event.clicks == 2):
                return True
        if event.kind == "wheel" and context.session.flight.orthographic is not None:
            context.session.flight.zoom_at(context.session.area.size, event.position, zoom_of(event.notches))
            return True
        if event.kind == "wheel" and mouse.turn(control=held.control) == "zoom":
            self._turn_wheel(event, context)
            return True
        if event.kind == "release" and event.button == "left" and event.clicks == 2:
            self._fly_to(event, context)
            return True
        return False

    def _begin(self, event: "PointerEvent", context: "ToolContext") -> None:
        self.pivot = pivot_at(context, event.position)
        pixels, depth = context.camera.project([self.pivot])
        self._grabbed = (pixels[0, 0] - event.position[0], pixels[0, 1] - event.position[1]) if depth[0] > 0 else (0.0, 0.0)

    def _drag(self, event: "PointerEvent", press: "PointerEvent", gesture: str, context: "ToolContext") -> None:
        flight, delta = context.session.flight, event.delta
        if self.pivot is None:
            delta = self._dragged = (self._dragged[0] + delta[0], self._dragged[1] + delta[1])
            if abs(delta[0]) + abs(delta[1]) <= DRAG:
                return
            self._begin(press, context)
        assert self.pivot is not None
        if gesture == "pan":
            pixel = event.position[0] + self._grabbed[0], event.position[1] + self._grabbed[1]
            flight.drag(panned(flight.state, context.camera, self.pivot, pixel))
            return
        if not self._captured:
            self._captured = True
            context.capture_pointer(True)
        flight.drag(orbited(flight.state, self.pivot, *delta, flight.steepest))

    def _end(self, context: "ToolContext") -> None:
        self.pivot = self._begun = None
        if self._captured:
            self._captured = False
            context.capture_pointer(False)

    def _turn_wheel(self, event: "PointerEvent", context: "ToolContext") -> None:
        """The point keeps its pixel: while the pointer stays, it is the same one, and need not be read again."""
        if self._zoom is None or self._zoom[0] != event.position:
            self._zoom = event.position, pivot_at(context, event.position)
        flight = context.session.flight
        flight.drag(zoomed(flight.state, self._zoom[1], event.notches, NEAREST * _spacing(context)))

    def _fly_to(self, event: "PointerEvent", context: "ToolContext") -> None:
        scene, flight = context.scene, context.session.flight
        point = measured_under(context, event.position)
        if scene is None or point is None:
            context.toast("No measured point here to fly to")
            return
        if flight.orthographic is not None:
            flight.centre(point)
            return
        metre = 1.0 / (metres_per_unit(context) or 1.0)
        position, direction = approach(scene, flight.state.position, point, flight.state.upright[:, 2], metre)
        flight.glide_to(view_along(position, direction, flight.state.speed, flight.state.upright))

    def draw(self, overlay: "OverlayCanvas", context: "ToolContext") -> None:
        """Marks the point while a gesture is under way."""
        zooming = self._zoom is not None and context.session.flight.moving
        marked = self._zoom[1] if self.pivot is None and self._zoom is not None and zooming else self.pivot
        if marked is not None:
            overlay.marker(marked, "accent", 10.0, "ring")
            overlay.marker(marked, "accent", 3.0)
