"""The camera of a notebook's view: what mouse and keys do to it, and its pictures as JPEG.  Knows no widget and no kernel.

Frame: as viewer.window.flight.navigation; pixels are logical ones of the page.
"""

import io
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...picture.camera import Camera, from_fov
from ...window.flight.navigation import FlyState, Motion, changed_speed, step, view_along

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
FIELD_OF_VIEW = 60.0
"""Degrees, vertical."""


class GuidedView:
    """A camera that is led by events.

    scene: of the start viewpoint and the speed.  start: begins there instead.  render: ``Scan.render``.  view: at rest.
    """

    def __init__(self, scene: "Scene", render: Callable[..., Any], *, view: str, start: Camera | None, up: Any):
        from ...window.flight.start_viewpoint import start_state, survey
        from ...work.places.up_axis import upright_axes

        self._render, self.view = render, view
        seen = survey(scene)
        self._limits = seen.limits
        self._fov = FIELD_OF_VIEW
        if start is None:
            self.home: FlyState = start_state(scene, seen, 4 / 3, up)
        else:
            self.home = view_along(start.position, start.forward, seen.speed, upright_axes(up))
            self._fov = float(np.degrees(2 * np.arctan(start.height / (2 * start.fy))))
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
        still = replace(self.state, velocity=np.zeros(3))
        state = step(still, Motion(look=(-look[0], -look[1])), 0.0)  # the scene follows the mouse
        pixel = state.speed / max(self.size[1], 1)
        across = -state.right * pan[0] + np.cross(state.right, state.forward) * pan[1]
        wheel, faster, seconds = (_numbers(event, name, 1, (0.0,))[0] for name in ("wheel", "faster", "seconds"))
        pressed = event.get("keys") if isinstance(event.get("keys"), str) else ""
        assert isinstance(pressed, str)
        ahead, right, up = (float(one in pressed) - float(other in pressed) for one, other in ("ws", "da", "eq"))
        pace = state.speed * (4.0 if event.get("fast") is True else 1.0) * (0.25 if event.get("slow") is True else 1.0)
        way = ahead * state.forward + right * state.right + up * state.upright[:, 2]
        moved = across * pixel + state.forward * (np.clip(wheel, -20, 20) * _STEP * state.speed)
        state = replace(state, position=state.position + moved + way * pace * np.clip(seconds, 0, _LONGEST))
        self.state = changed_speed(state, float(np.clip(faster, -20, 20)), self._limits)

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
