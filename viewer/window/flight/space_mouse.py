"""The 3D mouse: a cap that is pushed and twisted along six axes moves and turns the camera, or the scene where drags orbit.

GLFW reports it as a joystick without a gamepad's mapping.  Its axes are taken as 3Dconnexion's devices report them: right,
toward the person, down, and right-handed turns about these.  That is an assumption: no device was at hand.
"""

import re
from dataclasses import replace
from typing import Any

from .gamepad import STILL, Push

DEAD_ZONE = 0.04
"""Share of an axis's way that counts as none: a hand that rests on the cap; the springs bring it back to less."""
SLOWEST, FASTEST = 0.25, 4.0
"""Range of the setting that its axes are multiplied by."""
_NAMES = re.compile(r"3dconnexion|space ?(mouse|navigator|explorer|pilot|ball|traveler)", re.IGNORECASE)
_AXES = 6


class SpaceMouse:
    """The first connected 3D mouse.  glfw: the module, or what stands for it in a test."""

    def __init__(self, glfw: Any):
        self._glfw = glfw
        self._number: int | None = None

    def find(self) -> None:
        """Looks which joysticks are connected: at the start, and when one came or went."""
        glfw = self._glfw
        numbers = range(glfw.JOYSTICK_1, glfw.JOYSTICK_LAST + 1)
        self._number = next((number for number in numbers if glfw.joystick_present(number) and _is_one(
            glfw.get_joystick_name(number), self._axes(number))), None)

    @property
    def connected(self) -> bool:
        return self._number is not None

    def _axes(self, number: int) -> list[float]:
        values, count = self._glfw.get_joystick_axes(number)
        return [float(values[axis]) for axis in range(count)] if values else []

    def read(self) -> Push:
        """What the cap asks for now, as a person holds it: a push forward is forward, whatever that moves."""
        axes = self._axes(self._number) if self._number is not None else []
        if len(axes) < _AXES:  # none, or gone and not reported yet
            return STILL
        right, back, down, pitch, _roll, turn = (_beyond(value) for value in axes[:_AXES])
        return Push(-back, right, -down, turn, pitch)


def _is_one(name: bytes | str | None, axes: list[float]) -> bool:
    text = name.decode("utf-8", "replace") if isinstance(name, bytes) else name or ""
    return len(axes) >= _AXES and _NAMES.search(text) is not None


def _beyond(value: float) -> float:
    """An axis without its dead zone: from 0 at its edge to 1 at the end of its way; 0 for what is no number."""
    share = (min(abs(value), 1.0) - DEAD_ZONE) / (1.0 - DEAD_ZONE)
    return (share if value > 0 else -share) if share > 0 else 0.0


def scaled(push: Push, factor: float) -> Push:
    """The push of an axis multiplied by ``factor``, at most 1."""
    values = {name: min(max(getattr(push, name) * factor, -1.0), 1.0) for name in ("forward", "right", "up", "turn", "tilt")}
    return replace(push, **values)


def added(one: Push, other: Push) -> Push:
    """Two pushes at the same time."""
    return Push(one.forward + other.forward, one.right + other.right, one.up + other.up, one.turn + other.turn,
                one.tilt + other.tilt)


def of_scene(twist: Push) -> Push:
    """What moves the camera where the cap moves the scene: the other way.  Its turns are those of an orbit."""
    return Push(-twist.forward, -twist.right, -twist.up)
