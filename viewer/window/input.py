"""From hand to session: GLFW's callbacks, each passed to imgui first and then, where imgui has no use for it, on.

Pointer positions are logical pixels from the window's top left; the session counts framebuffer pixels.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from viewer.window.controls import Control, by_key
from viewer.window.session import Session
from viewer.window.theme import NARROW

if TYPE_CHECKING:
    from viewer.window.theme import Theme

_GRIP = 9.0  # logical pixels either side of the comparison's line that take hold of it


class Host(Protocol):
    """What the callbacks need of whoever owns the window.  window: GLFW's handle.  address: the same as a number."""

    glfw: Any
    imgui: Any
    window: Any
    address: int
    session: Session
    theme: "Theme"

    def wake(self) -> None: ...
    def linger(self) -> None: ...
    def act(self, action: str) -> None: ...
    def interface_scale(self) -> float: ...


class Input:
    """The callbacks of one window.  pointer: where the pointer is."""

    def __init__(self, host: Host):
        self._host = host
        self.pointer = (0.0, 0.0)
        self._by_key = {getattr(host.glfw, f"KEY_{key}"): control for key, control in by_key().items()}
        self._narrow, self._was_open = False, False
        self._connect()
        self._fold_where_narrow()

    def _connect(self) -> None:
        glfw, window = self._host.glfw, self._host.window
        glfw.set_key_callback(window, self.on_key)
        glfw.set_char_callback(window, self.on_char)
        glfw.set_cursor_pos_callback(window, self.on_pointer)
        glfw.set_cursor_enter_callback(window, self.on_enter)
        glfw.set_mouse_button_callback(window, self.on_button)
        glfw.set_scroll_callback(window, self.on_scroll)
        glfw.set_drop_callback(window, self.on_drop)
        glfw.set_window_focus_callback(window, self.on_focus)
        glfw.set_framebuffer_size_callback(window, self.on_resize)
        glfw.set_window_content_scale_callback(window, lambda *_: self._host.theme.rescale(self._host.interface_scale()))
        glfw.set_window_refresh_callback(window, lambda _: self._host.wake())

    def on_key(self, _window, key: int, scancode: int, action: int, mods: int) -> None:
        glfw, imgui = self._host.glfw, self._host.imgui
        self._host.wake()
        imgui.backends.glfw_key_callback(self._host.address, key, scancode, action, mods)
        control = self._by_key.get(key)
        if control is None:
            return
        if control.kind in ("hold", "modifier"):
            if action == glfw.RELEASE:
                self._host.session.flight.held.discard(control.action)
            elif action == glfw.PRESS and not imgui.get_io().want_text_input and not mods & glfw.MOD_CONTROL:
                self._host.session.flight.held.add(control.action)
        elif action == glfw.PRESS and not imgui.get_io().want_text_input:
            self._host.act(control.action)

    def on_char(self, _window, character: int) -> None:
        self._host.imgui.backends.glfw_char_callback(self._host.address, character)

    def on_enter(self, _window, entered: int) -> None:
        self._host.wake()
        self._host.imgui.backends.glfw_cursor_enter_callback(self._host.address, entered)

    def on_pointer(self, _window, x: float, y: float) -> None:
        self._host.imgui.backends.glfw_cursor_pos_callback(self._host.address, x, y)
        dx, dy = x - self.pointer[0], y - self.pointer[1]
        self.pointer = (x, y)
        self._host.wake()
        if self._host.imgui.get_io().want_capture_mouse:
            self._host.linger()
        if self._host.session.dragging_handle:
            self._host.session.move_split(x * self._density())
        elif self._host.session.flight.looking:
            self._host.session.flight.look(dx, dy)

    def on_button(self, _window, button: int, action: int, mods: int) -> None:
        glfw, session = self._host.glfw, self._host.session
        self._host.wake()
        self._host.imgui.backends.glfw_mouse_button_callback(self._host.address, button, action, mods)
        if button not in (glfw.MOUSE_BUTTON_LEFT, glfw.MOUSE_BUTTON_RIGHT):
            return
        if action == glfw.RELEASE:
            self.release_pointer()
        elif not self._host.imgui.get_io().want_capture_mouse and session.scene is not None:
            if button == glfw.MOUSE_BUTTON_LEFT and self.over_handle:
                session.dragging_handle = True
            else:
                session.flight.looking = True
                glfw.set_input_mode(self._host.window, glfw.CURSOR, glfw.CURSOR_DISABLED)

    def release_pointer(self) -> None:
        if self._host.session.flight.looking:
            self._host.glfw.set_input_mode(self._host.window, self._host.glfw.CURSOR, self._host.glfw.CURSOR_NORMAL)
            self.pointer = self._host.glfw.get_cursor_pos(self._host.window)
        self._host.session.flight.looking = self._host.session.dragging_handle = False

    @property
    def over_handle(self) -> bool:
        """Whether the pointer is on the line of a comparison."""
        session = self._host.session
        at = session.view_settings.split_at * session.size[0] / self._density()
        return session.view_settings.split and abs(self.pointer[0] - at) <= _GRIP * self._host.theme.scale

    def on_scroll(self, _window, dx: float, dy: float) -> None:
        self._host.wake()
        self._host.imgui.backends.glfw_scroll_callback(self._host.address, dx, dy)
        if not self._host.imgui.get_io().want_capture_mouse:
            self._host.session.wheel(dy)

    def on_drop(self, _window, paths: list[str]) -> None:
        self._host.wake()
        if paths:
            self._host.session.loads.open([Path(path) for path in paths])

    def on_focus(self, _window, focused: int) -> None:
        self._host.wake()
        self._host.imgui.backends.glfw_window_focus_callback(self._host.address, focused)
        if not focused:
            self.release_pointer()
            self._host.session.let_go()

    def on_resize(self, _window, width: int, height: int) -> None:
        self._host.wake()
        self._host.session.resize((width, height))
        if width and height:
            self._fold_where_narrow()

    def _fold_where_narrow(self) -> None:
        """Folds the panel when the window becomes too narrow for it beside the figures, and opens it again, where it was open
        before, when there is room; in between its button does."""
        session = self._host.session
        narrow = self._host.glfw.get_window_size(self._host.window)[0] < self._host.theme.px(NARROW)
        if narrow and not self._narrow:
            self._was_open, session.panel = session.panel, False
        elif self._narrow and not narrow:
            session.panel |= self._was_open
        self._narrow = narrow

    def _density(self) -> float:
        """Framebuffer pixels per logical pixel."""
        width = self._host.glfw.get_window_size(self._host.window)[0]
        return self._host.session.size[0] / width if width else 1.0

    def key_name(self, control: Control) -> str:
        """What this keyboard prints on a letter's key; the table's name otherwise."""
        if len(control.name) != 1 or not control.name.isalpha():
            return control.name
        key = getattr(self._host.glfw, f"KEY_{control.keys[0]}")
        return (self._host.glfw.get_key_name(key, 0) or control.name).upper()
