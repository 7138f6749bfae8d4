"""The gamepad: sticks and triggers become a push of the camera, buttons become actions of the table of controls.

GLFW's gamepad mapping names the axes and buttons of any known pad.  Pads may come and go.  Where none is connected nothing is
read: GLFW reports a new one by a callback.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

DEAD_ZONE = 0.15
"""Share of a stick's way from its middle that counts as none: worn sticks rest at up to a tenth."""
POLL = 1 / 30
"""Seconds between two readings while nothing moves; while the camera moves, a pad is read once a picture."""
SPEED_NOTCHES = 2.0
"""Notches of the wheel that a bumper stands for."""
_BUTTONS = {
    "A": "walk", "B": "home", "START": "help", "LEFT_BUMPER": "slower", "RIGHT_BUMPER": "faster",
}  # fmt: skip
"""GLFW's name of a button -> its action."""


@dataclass(frozen=True)
class Push:
    """What the sticks and triggers ask for, each -1 to 1.  forward, right, up: movement.  turn: to the right; tilt: upward."""

    forward: float = 0.0
    right: float = 0.0
    up: float = 0.0
    turn: float = 0.0
    tilt: float = 0.0

    @property
    def moves(self) -> bool:
        return bool(self.forward or self.right or self.up)

    @property
    def looks(self) -> bool:
        return bool(self.turn or self.tilt)


STILL = Push()


def beyond_dead_zone(x: float, y: float) -> tuple[float, float]:
    """A stick's position without its dead zone, a disc: from 0 at its edge to 1 at the end of the stick's way."""
    length = (x * x + y * y) ** 0.5
    if not DEAD_ZONE < length < float("inf"):
        return 0.0, 0.0
    share = min((length - DEAD_ZONE) / (1.0 - DEAD_ZONE), 1.0) / length
    return x * share, y * share


class Gamepad:
    """The first connected pad.  focused: whether the window has the keyboard; else its pad is another program's.

    glfw: the module, or what stands for it in a test.  follows: called when joysticks are looked for, at the start and when one
    came or went: GLFW calls one function only.
    """

    def __init__(self, glfw: Any, focused: Callable[[], bool], follows: Callable[[], object] = lambda: None):
        self._glfw, self._focused = glfw, focused
        self._number: int | None = None
        self._pressed: set[str] = set()
        self._names = {name: getattr(glfw, f"GAMEPAD_BUTTON_{name}") for name in _BUTTONS}
        self._axes = [getattr(glfw, f"GAMEPAD_AXIS_{name}")
                      for name in ("LEFT_X", "LEFT_Y", "RIGHT_X", "RIGHT_Y", "LEFT_TRIGGER", "RIGHT_TRIGGER")]
        self._follows = follows
        glfw.set_joystick_callback(self._on_change)
        self._find()

    def _on_change(self, _number: int, _event: int) -> None:
        self._find()

    def _find(self) -> None:
        """Looks which pads are connected: at the start, and when one came or went."""
        glfw = self._glfw
        numbers = range(glfw.JOYSTICK_1, glfw.JOYSTICK_LAST + 1)
        self._number = next((number for number in numbers if glfw.joystick_is_gamepad(number)), None)
        self._pressed.clear()
        self._follows()

    @property
    def connected(self) -> bool:
        return self._number is not None

    def read(self) -> tuple[Push, list[str]]:
        """The push of this moment, and the actions whose buttons were pressed since the last call."""
        if self._number is None or not self._focused():
            self._pressed.clear()
            return STILL, []
        state = self._glfw.get_gamepad_state(self._number)
        if state is None:  # gone, and not reported yet
            return STILL, []
        held = {name for name, index in self._names.items() if state.buttons[index]}
        new, self._pressed = held - self._pressed, held
        left_x, left_y, right_x, right_y, left, right = (float(state.axes[axis]) for axis in self._axes)
        right_way, back = beyond_dead_zone(left_x, left_y)
        turn, down = beyond_dead_zone(right_x, right_y)
        up, _ = beyond_dead_zone((right - left) / 2, 0.0)  # a trigger rests at -1 and ends at 1
        return Push(-back, right_way, up, turn, -down), [_BUTTONS[name] for name in _BUTTONS if name in new]

    def close(self) -> None:
        """The window closes."""
        self._glfw.set_joystick_callback(None)
