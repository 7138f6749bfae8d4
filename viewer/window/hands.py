"""From hand to session: GLFW's callbacks, each passed to imgui first and then, where imgui has no use for it, on.

Pointer positions are logical pixels from the window's top left; the session counts framebuffer pixels.
"""

from pathlib import Path
from typing import TYPE_CHECKING

from viewer.window.controls import Control, by_key

if TYPE_CHECKING:
    from viewer.window.app import App

_GRIP = 9.0  # logical pixels either side of the comparison's line that take hold of it


class Hands:
    """The callbacks of one window.  pointer: where the pointer is."""

    def __init__(self, app: "App"):
        self._app = app
        self.pointer = (0.0, 0.0)
        self._by_key = {getattr(app.glfw, f"KEY_{key}"): control for key, control in by_key().items()}
        self._connect()

    def _connect(self) -> None:
        glfw, window = self._app.glfw, self._app.window
        glfw.set_key_callback(window, self.on_key)
        glfw.set_char_callback(window, self.on_char)
        glfw.set_cursor_pos_callback(window, self.on_pointer)
        glfw.set_cursor_enter_callback(window, self.on_enter)
        glfw.set_mouse_button_callback(window, self.on_button)
        glfw.set_scroll_callback(window, self.on_scroll)
        glfw.set_drop_callback(window, self.on_drop)
        glfw.set_window_focus_callback(window, self.on_focus)
        glfw.set_framebuffer_size_callback(window, self.on_resize)
        glfw.set_window_content_scale_callback(window, lambda *_: self._app.theme.rescale(self._app.interface_scale()))
        glfw.set_window_refresh_callback(window, lambda _: self._app.wake())

    def on_key(self, _window, key: int, scancode: int, action: int, mods: int) -> None:
        glfw, imgui = self._app.glfw, self._app.imgui
        self._app.wake()
        imgui.backends.glfw_key_callback(self._app.address, key, scancode, action, mods)
        control = self._by_key.get(key)
        if control is None:
            return
        if control.kind in ("hold", "modifier"):
            if action == glfw.RELEASE:
                self._app.session.held.discard(control.action)
            elif action == glfw.PRESS and not imgui.get_io().want_text_input and not mods & glfw.MOD_CONTROL:
                self._app.session.held.add(control.action)
        elif action == glfw.PRESS and not imgui.get_io().want_text_input:
            self._app.act(control.action)

    def on_char(self, _window, character: int) -> None:
        self._app.imgui.backends.glfw_char_callback(self._app.address, character)

    def on_enter(self, _window, entered: int) -> None:
        self._app.wake()
        self._app.imgui.backends.glfw_cursor_enter_callback(self._app.address, entered)

    def on_pointer(self, _window, x: float, y: float) -> None:
        self._app.imgui.backends.glfw_cursor_pos_callback(self._app.address, x, y)
        dx, dy = x - self.pointer[0], y - self.pointer[1]
        self.pointer = (x, y)
        self._app.wake()
        if self._app.imgui.get_io().want_capture_mouse:
            self._app.linger()
        if self._app.session.dragging_handle:
            self._app.session.move_split(x * self._density())
        elif self._app.session.looking:
            self._app.session.look(dx, dy)

    def on_button(self, _window, button: int, action: int, mods: int) -> None:
        glfw, session = self._app.glfw, self._app.session
        self._app.wake()
        self._app.imgui.backends.glfw_mouse_button_callback(self._app.address, button, action, mods)
        if button not in (glfw.MOUSE_BUTTON_LEFT, glfw.MOUSE_BUTTON_RIGHT):
            return
        if action == glfw.RELEASE:
            self.release_pointer()
        elif not self._app.imgui.get_io().want_capture_mouse and session.scene is not None:
            if button == glfw.MOUSE_BUTTON_LEFT and self.over_handle:
                session.dragging_handle = True
            else:
                session.looking = True
                glfw.set_input_mode(self._app.window, glfw.CURSOR, glfw.CURSOR_DISABLED)

    def release_pointer(self) -> None:
        if self._app.session.looking:
            self._app.glfw.set_input_mode(self._app.window, self._app.glfw.CURSOR, self._app.glfw.CURSOR_NORMAL)
            self.pointer = self._app.glfw.get_cursor_pos(self._app.window)
        self._app.session.looking = self._app.session.dragging_handle = False

    @property
    def over_handle(self) -> bool:
        """Whether the pointer is on the line of a comparison."""
        session = self._app.session
        at = session.split_at * session.size[0] / self._density()
        return session.split and abs(self.pointer[0] - at) <= _GRIP * self._app.theme.scale

    def on_scroll(self, _window, dx: float, dy: float) -> None:
        self._app.wake()
        self._app.imgui.backends.glfw_scroll_callback(self._app.address, dx, dy)
        if not self._app.imgui.get_io().want_capture_mouse:
            self._app.session.wheel(dy)

    def on_drop(self, _window, paths: list[str]) -> None:
        self._app.wake()
        if paths:
            self._app.session.open([Path(path) for path in paths])

    def on_focus(self, _window, focused: int) -> None:
        self._app.wake()
        self._app.imgui.backends.glfw_window_focus_callback(self._app.address, focused)
        if not focused:
            self.release_pointer()
            self._app.session.let_go()

    def on_resize(self, _window, width: int, height: int) -> None:
        self._app.wake()
        self._app.session.resize((width, height))

    def _density(self) -> float:
        """Framebuffer pixels per logical pixel."""
        width = self._app.glfw.get_window_size(self._app.window)[0]
        return self._app.session.size[0] / width if width else 1.0

    def key_name(self, control: Control) -> str:
        """What this keyboard prints on a letter's key; the table's name otherwise."""
        if len(control.name) != 1 or not control.name.isalpha():
            return control.name
        key = getattr(self._app.glfw, f"KEY_{control.keys[0]}")
        return (self._app.glfw.get_key_name(key, 0) or control.name).upper()
