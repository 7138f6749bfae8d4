"""The part of a flight that concerns orthographic cameras: changing to one and back, zooming, and turns about a point.

Frame: file coordinates; pixels as in viewer.picture.camera.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ...picture.camera import Camera
from . import mouse as presets
from .framing import SIDES
from .glide import Glide, Turn
from .navigation import PITCH_LIMIT, FlyState, Motion, view_along
from .parallel_moves import bounded, state_of_camera, stepped, whole_scan, zoomed_at
from .start_viewpoint import Survey
from .walking import Walker

REST = 0.25
"""Seconds without a change of camera that count as rest."""


class ParallelFlight:
    """orthographic: the distance of the scale of an orthographic camera (viewer.picture.camera), None of a pinhole.  plane:
    view depth, file units, at which a pinhole in its place would have that scale.  The other attributes are Flight's."""

    state: FlyState
    field_of_view: float
    mouse: str
    walker: Walker | None
    orthographic: float | None = None
    plane: float = 1.0
    _seen: Survey | None
    _glide: tuple[float, Glide | Turn] | None
    _clock: Callable[[], float]
    _moved: float

    def camera(self, size: tuple[int, int]) -> Camera:
        """The camera of a picture of so many pixels."""
        raise NotImplementedError

    def go(self, state: FlyState) -> None:
        """Puts the camera somewhere else at once."""
        raise NotImplementedError

    def glide_to(self, state: FlyState) -> None:
        """Begins a short flight."""
        raise NotImplementedError

    def drag(self, state: FlyState) -> None:
        """Puts the camera somewhere else as part of a movement."""
        raise NotImplementedError

    @property
    def middle(self) -> np.ndarray:
        """(3,) the middle of the scene, file coordinates."""
        return np.zeros(3) if self._seen is None else (self._seen.low + self._seen.high) / 2

    @property
    def preset(self) -> presets.MousePreset:
        """What drags and the wheel do now."""
        chosen = presets.PRESETS[self.mouse]
        return chosen if self.orthographic is None else chosen.orthographic

    @property
    def lens(self) -> float:
        """Focal length over the picture's height."""
        return float(0.5 / np.tan(np.radians(self.field_of_view) / 2))

    @property
    def height(self) -> float | None:
        """Of an orthographic picture, file units; None of a pinhole's."""
        return None if self.orthographic is None else self.orthographic / self.lens

    @property
    def steepest(self) -> float:
        """The most that the camera looks up or down, radians: plans are looked at straight down."""
        return PITCH_LIMIT if self.orthographic is None else np.pi / 2

    def to_orthographic(self, depth: float) -> None:
        """Parallel rays from now on, at the scale that the picture has at a view depth.  This ends a walk."""
        self._glide = self.walker = None
        assert self._seen is not None
        self.orthographic, self.plane = bounded(depth, self._seen, self.lens), depth
        self.state = replace(self.state, velocity=np.zeros(3))
        self._moved = self._clock() - REST

    def to_perspective(self, depth: float | None = None) -> None:
        """A pinhole from now on, from where it has the scale of the picture at a view depth; None: at that of the last time."""
        if self.orthographic is None:
            return
        ahead = (self.plane if depth is None else depth) - self.orthographic
        pitch = float(np.clip(self.state.pitch, -PITCH_LIMIT, PITCH_LIMIT))
        self.state = replace(self.state, position=self.state.position + self.state.forward * ahead, pitch=pitch)
        self._glide, self.orthographic = None, None
        self._moved = self._clock() - REST

    def zoom_at(self, size: tuple[int, int], pixel: tuple[float, float], factor: float) -> None:
        """Of an orthographic camera: the scale becomes that of ``factor`` times its distance; what lies at the pixel stays."""
        if self.orthographic is not None and self._seen is not None:
            distance = bounded(self.orthographic * factor, self._seen, self.lens)
            state = zoomed_at(self.state, self.camera(size), pixel, distance)
            self.orthographic = distance
            self.drag(state)

    def show(self, camera: Camera, *, glide: bool = False) -> None:
        """Goes, or flies, to where a camera is that was kept, with its lens."""
        if camera.orthographic is None:
            self.to_perspective()
            state = view_along(camera.position, camera.forward, self.state.speed, self.state.upright)
            self.field_of_view = camera.vertical_fov
            (self.glide_to if glide else self.go)(state)
            return
        self._glide = self.walker = None
        self.field_of_view = camera.vertical_fov
        self.state, self.orthographic = state_of_camera(camera, self.state), camera.orthographic
        depth = float((self.middle - camera.position) @ camera.forward)
        self.plane = depth if depth > 0 else camera.orthographic
        self._moved = self._clock() - REST

    def turn_about(self, pivot: np.ndarray, yaw: float, pitch: float) -> None:
        """Turns about a point, which keeps its place in the picture and its distance, until the camera looks another way."""
        state = replace(self.state, velocity=np.zeros(3))
        end = replace(state, yaw=yaw, pitch=float(np.clip(pitch, -self.steepest, self.steepest)))
        offset = state.camera_to_world[:3, :3].T @ (pivot - state.position)
        end = replace(end, position=pivot - end.camera_to_world[:3, :3] @ offset)
        self._turn(pivot, end, self.orthographic)

    def centre(self, point: np.ndarray) -> None:
        """Of an orthographic camera: pans until a point is in the middle of the picture."""
        turned = self.state.camera_to_world[:3, :3]
        across = turned[:, :2] @ (turned[:, :2].T @ (point - self.state.position))
        self._turn(point, replace(self.state, position=self.state.position + across), self.orthographic)

    def _turn(self, pivot: np.ndarray, end: FlyState, scale: float | None) -> None:
        self.state, self.walker = replace(self.state, velocity=np.zeros(3)), None
        scales = None if self.orthographic is None or scale is None else (self.orthographic, scale)
        self._glide = self._clock(), Turn(self.state, end, pivot, scales)

    def fit(self, aspect: float) -> None:
        """Of an orthographic camera: the whole scan is in view.  aspect: width over height."""
        if self._seen is not None:
            self.state, self.orthographic, self.plane = whole_scan(self._seen, self.state, aspect, self.lens)
            self._glide, self._moved = None, self._clock() - REST

    def turn_to_side(self, side: str, aspect: float) -> None:
        """Of an orthographic camera: turns to the whole scan from one of viewer.window.flight.framing.SIDES."""
        if self._seen is not None:
            x, y, z = SIDES[side].direction
            like = replace(self.state, yaw=float(np.arctan2(y, x)), pitch=float(np.arctan2(z, np.hypot(x, y))))
            end, scale, self.plane = whole_scan(self._seen, like, aspect, self.lens)
            self._turn(self.middle, end, scale)

    def _step_orthographic(self, motion: Motion, height: float, dt: float) -> None:
        assert self.orthographic is not None and self._seen is not None
        self.state, factor = stepped(self.state, motion, height, dt)
        self.orthographic = bounded(self.orthographic * factor, self._seen, self.lens)
