"""The camera of a notebook's view: what mouse and keys do to it, and its pictures as JPEG.  Knows no widget and no kernel.

Frame: file coordinates; ``upright`` turns the axes of a world whose z is up into those of the file.  Pixels are logical ones of
the page.
"""

import io
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...picture.camera import Camera, from_fov

if TYPE_CHECKING:
    from ...grid.scene import Scene

LARGEST = 2160
"""Pixels along a side of a picture, at most: what a page asks for is not trusted."""
MOVING_SCALE = 0.5
"""Size of a picture in motion, of that at rest, along each side."""
MOVING_LOD = 1.0
"""Points drawn per pixel in motion."""
MOVING_VIEW = "filled"
_QUALITY = {True: 75, False: 90}
"""Of the JPEG, by whether the camera moves."""
_STEP = 0.25
"""Seconds of flight by one notch of the wheel."""
_LONGEST = 0.5
"""Seconds of held keys that one message counts for: after a pause of the kernel the camera does not leap."""
_LOOK = 0.0032
"""Radians a pixel of mouse movement, as in the window."""
_STEEPEST = np.radians(89.0)
_FAST, _SLOW, _FASTER = 4.0, 0.25, 1.25
_CROSSING = 12.0
"""Seconds in which the scan is crossed."""
_SPEEDS = (1e-4, 4.0)
"""Slowest and fastest, in diagonals of the scan a second."""


@dataclass(frozen=True, eq=False)
class Pose:
    """position: (3,).  yaw: radians about up, 0 looks along the first axis of ``upright`` (3, 3).  pitch: positive looks up.
    speed: file units a second."""

    position: np.ndarray
    yaw: float
    pitch: float
    speed: float
    upright: np.ndarray

    @property
    def forward(self) -> np.ndarray:
        """(3,) unit vector."""
        level = np.cos(self.pitch)
        return self.upright @ np.array([np.cos(self.yaw) * level, np.sin(self.yaw) * level, np.sin(self.pitch)])

    @property
    def right(self) -> np.ndarray:
        """(3,) unit vector, level."""
        return self.upright @ np.array([np.sin(self.yaw), -np.cos(self.yaw), 0.0])

    @property
    def camera_to_world(self) -> np.ndarray:
        """(4, 4), OpenGL axes."""
        matrix = np.eye(4)
        matrix[:3, 0], matrix[:3, 1], matrix[:3, 2] = self.right, np.cross(self.right, self.forward), -self.forward
        matrix[:3, 3] = self.position
        return matrix


def pose_along(position: np.ndarray, direction: np.ndarray, speed: float, upright: np.ndarray) -> Pose:
    """At ``position`` (3,), looking along ``direction`` (3,), not zero."""
    x, y, z = upright.T @ (np.asarray(direction, np.float64) / np.linalg.norm(direction))
    pitch = float(np.clip(np.arcsin(np.clip(z, -1, 1)), -_STEEPEST, _STEEPEST))
    return Pose(np.array(position, np.float64), float(np.arctan2(y, x)), pitch, speed, upright)


class GuidedView:
    """A camera that is led by events.

    scene: of the start viewpoint and the speed.  start: begins there instead.  render: ``Scan.render``.  view: at rest.
    """

    def __init__(self, scene: "Scene", render: Callable[..., Any], *, view: str, start: Camera | None, up: Any):
        from ...work.places.outside_view import outside_view
        from ...work.places.standing_place import FIELD_OF_VIEW, sample_scene
        from ...work.places.start_view import standing_view
        from ...work.places.up_axis import turned, upright_axes
        from ...work.scan_files import main_place

        self._render, self.view = render, view
        seen, upright = main_place(sample_scene(scene))[0], upright_axes(up)
        self._limits = (_SPEEDS[0] * seen.diagonal, _SPEEDS[1] * seen.diagonal)
        speed, self._fov = max(seen.diagonal / _CROSSING, 5 * seen.spacing), FIELD_OF_VIEW
        if start is not None:
            self.home = pose_along(start.position, start.forward, speed, upright)
            self._fov = float(np.degrees(2 * np.arctan(start.height / (2 * start.fy))))
        elif (inside := standing_view(scene, seen, upright)) is not None:
            self.home = pose_along(*inside, float(np.clip(speed, 0.8 * seen.metre, 4.0 * seen.metre)), upright)
        else:
            place, ahead = outside_view(turned(seen, upright), 4 / 3)
            self.home = pose_along(upright @ place, upright @ ahead, speed, upright)
        self.state = self.home
        self.size = (960, 720)

    def camera(self, scale: float = 1.0) -> Camera:
        """The present camera, with the size of the last picture at rest, times ``scale``."""
        width, height = (max(round(side * scale), 1) for side in self.size)
        return from_fov(width, height, self._fov, self.state.camera_to_world)

    def follow(self, event: dict[str, Any]) -> None:
        """Moves the camera.  event: from the page, any of them may be missing or nonsense, which does nothing:

        size: [width, height] in pixels.  look: [right, down], pan: [right, down], pixels of the mouse.  wheel: notches,
        positive: forward.  keys: pressed ones of "wasdqe", seconds: how long.  fast, slow: held.  faster: notches of speed.
        home: back to the start.
        """
        width, height = _numbers(event, "size", 2, self.size)
        self.size = (int(np.clip(width, 16, LARGEST)), int(np.clip(height, 16, LARGEST)))
        if event.get("home") is True:
            self.state = replace(self.home, speed=self.state.speed)
        look, pan = _numbers(event, "look", 2, (0.0, 0.0)), _numbers(event, "pan", 2, (0.0, 0.0))
        wheel, faster, seconds = (_numbers(event, name, 1, (0.0,))[0] for name in ("wheel", "faster", "seconds"))
        keys = event.get("keys")
        pressed = keys if isinstance(keys, str) else ""
        yaw = (self.state.yaw + _LOOK * look[0] + np.pi) % (2 * np.pi) - np.pi if look[0] else self.state.yaw
        pitch = float(np.clip(self.state.pitch + _LOOK * look[1], -_STEEPEST, _STEEPEST))
        state = replace(self.state, yaw=float(yaw), pitch=pitch)  # the scene follows the mouse
        across = -state.right * pan[0] + np.cross(state.right, state.forward) * pan[1]
        ahead, right, up = (float(one in pressed) - float(other in pressed) for one, other in ("ws", "da", "eq"))
        pace = state.speed * (_FAST if event.get("fast") is True else 1.0) * (_SLOW if event.get("slow") is True else 1.0)
        way = ahead * state.forward + right * state.right + up * state.upright[:, 2]
        moved = across * (state.speed / self.size[1]) + state.forward * (np.clip(wheel, -20, 20) * _STEP * state.speed)
        position = state.position + moved + way * pace * np.clip(seconds, 0, _LONGEST)
        speed = float(np.clip(state.speed * _FASTER ** np.clip(faster, -20, 20), *self._limits))
        self.state = replace(state, position=position, speed=speed)

    def picture(self, moving: bool) -> tuple[bytes, tuple[int, int]]:
        """The view as JPEG, and its size: a quick one while the camera moves, else as ``Scan.render`` makes it."""
        from PIL import Image

        if moving:
            made = self._render(self.camera(MOVING_SCALE), view=MOVING_VIEW, lod=MOVING_LOD)
        else:
            made = self._render(self.camera(), view=self.view)
        file = io.BytesIO()
        pixels = np.asarray(made)[..., :3]  # premultiplied: on black
        Image.fromarray(pixels).save(file, "JPEG", quality=_QUALITY[moving])
        return file.getvalue(), (pixels.shape[1], pixels.shape[0])


def _numbers(event: dict[str, Any], name: str, count: int, otherwise: tuple[float, ...]) -> tuple[float, ...]:
    """The finite numbers of an entry; ``otherwise`` where it is something else."""
    given = event.get(name)
    values: list[Any] = given if isinstance(given, list) else [given]
    usable = [value for value in values if isinstance(value, (int, float)) and abs(value) < 1e9]
    return tuple(float(value) for value in usable) if len(usable) == len(values) == count else otherwise
