"""What the system tells of the window itself: closing, files dropped on it, focus, its size and that of its screen's pixels."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Protocol

from .after_typing import AfterTyping
from .window_host import Host


class Events(Protocol):
    """What the callbacks need of the events of keys and mouse."""

    after_typing: AfterTyping

    def release_all(self) -> None: ...


class WindowEvents:
    """The callbacks of one window.  events: those of its keys and its mouse."""

    def __init__(self, host: Host, events: Events):
        self._host, self._events = host, events

    def connect(self) -> None:
        glfw, window = self._host.glfw, self._host.window
        glfw.set_drop_callback(window, self.on_drop)
        glfw.set_window_focus_callback(window, self.on_focus)
        glfw.set_framebuffer_size_callback(window, self.on_resize)
        glfw.set_window_content_scale_callback(window, self.on_scale)
        glfw.set_window_close_callback(window, self.on_close)
        glfw.set_window_refresh_callback(window, lambda _: self._host.wake())

    def on_close(self, window) -> None:
        self._host.wake()
        self._host.glfw.set_window_should_close(window, False)  # GLFW sets it before it tells
        self._events.after_typing.do(self._host.request_close)

    def on_drop(self, _window, paths: Sequence[str]) -> None:
        self._host.wake()
        if not paths:
            return
        opening = partial(self._host.open, [Path(path) for path in paths])
        if self._events.after_typing:  # an Esc that was pressed before does not cancel the loading
            self._events.after_typing.do(opening)
        else:
            opening()

    def on_focus(self, _window, focused: int) -> None:
        self._host.wake()
        self._host.imgui.backends.glfw_window_focus_callback(self._host.address, focused)
        if not focused:
            self._events.release_all()

    def on_resize(self, _window, width: int, height: int) -> None:
        self._host.wake()
        self._host.session.resize((width, height))

    def on_scale(self, _window, _x: float, _y: float) -> None:
        self._host.theme.rescale(self._host.interface_scale())
        self._host.wake()
