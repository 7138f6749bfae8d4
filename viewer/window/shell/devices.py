"""Gamepad and 3D mouse of a window: what they ask for goes to the camera, their buttons to the table of controls."""

from typing import Any, Protocol

from ..flight.gamepad import STILL, Gamepad
from ..flight.space_mouse import SpaceMouse
from ..session.session import Session


class Host(Protocol):
    """What the devices need of the window."""

    glfw: Any
    window: Any
    session: Session

    @property
    def asking(self) -> bool: ...
    def wake(self) -> None: ...
    def act(self, action: str) -> None: ...


class Devices:
    """Those of one window."""

    def __init__(self, host: Host):
        self._host, glfw = host, host.glfw
        self.space_mouse = SpaceMouse(glfw)
        self.gamepad = Gamepad(glfw, self._focused, self.space_mouse.find)

    def _focused(self) -> bool:
        """Whether the window has the keyboard: else the devices are another program's."""
        return bool(self._host.glfw.get_window_attrib(self._host.window, self._host.glfw.FOCUSED))

    @property
    def connected(self) -> bool:
        """Whether they must be read: nothing tells that an axis has moved."""
        return self.gamepad.connected or self.space_mouse.connected

    def follow(self) -> None:
        """Called in every turn of the loop."""
        host, flight = self._host, self._host.session.flight
        if not self.space_mouse.connected:
            flight.twist = None
        if not self.connected:
            flight.push = STILL
            return
        push, actions = self.gamepad.read()
        free = host.session.notices.message is None and not host.asking
        moves = free and host.session.scene is not None
        flight.push = push if moves else STILL
        if self.space_mouse.connected:
            flight.twist = self.space_mouse.read() if moves and self._focused() else STILL
        for action in actions if free else ():
            host.wake()
            flight.stop_glide()
            host.act(action)

    def close(self) -> None:
        """The window closes."""
        self.gamepad.close()
