"""Input: GLFW's callbacks, given to imgui first and then, where imgui has no use for them, to the tools and the session.

Pointer positions arrive in logical pixels from the window's top left; tools receive pixels of the picture.
"""

from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Literal

from ..interaction.controls import Control
from ..interaction.tool import KeyEvent, Modifiers, PointerEvent
from ..kit.under_pointer import over_interface
from .after_typing import AfterTyping
from .in_order import InOrder
from .keyboard import Keyboard
from .list_keys import list_is_open
from .text_ahead import TextAhead
from .window_events import WindowEvents
from .window_host import Host

_GRIP = 9.0  # design units either side of the comparison's line that take hold of it
_CLICK = 4.0  # logical pixels that the pointer may move between press and release of a click
_DOUBLE_CLICK = 0.35  # seconds between the two releases of a double click


class Input:
    """The callbacks of one window.  pointer: its position, logical pixels.  clock: seconds.  keyboard: its keys.
    after_typing: actions that wait until imgui has taken what was typed before.  text_ahead: keys for a text to come."""

    def __init__(self, host: Host, clock: Callable[[], float] = perf_counter):
        self._host, self._clock = host, clock
        self.pointer = (0.0, 0.0)
        self.after_typing = AfterTyping(host.imgui)
        self.text_ahead = TextAhead(host.imgui, self.after_typing)
        self._in_order = InOrder(host.imgui, self.after_typing, self.text_ahead)
        glfw = host.glfw
        self.keyboard = Keyboard(glfw)
        self._buttons: dict[int, Literal["left", "right", "middle"]] = {
            glfw.MOUSE_BUTTON_LEFT: "left", glfw.MOUSE_BUTTON_RIGHT: "right", glfw.MOUSE_BUTTON_MIDDLE: "middle",
        }  # fmt: skip
        self._button: Literal["", "left", "right", "middle"] = ""
        self._held: set[int] = set()  # buttons, also of the interface
        self._held_over_interface = False  # where the first of them was pressed
        self._modifiers = Modifiers()  # of the event that came last
        self._given = Modifiers(), -1.0  # modifiers and time of the event that is given now: it may have waited
        self._travelled = 0.0
        self._last_click = (-1.0, "", (0.0, 0.0))  # when, with which button, where
        self.window_events = WindowEvents(host, self)
        self._connect()

    def _connect(self) -> None:
        glfw, window = self._host.glfw, self._host.window
        glfw.set_key_callback(window, self.on_key)
        glfw.set_char_callback(window, self.on_char)
        glfw.set_cursor_pos_callback(window, self.on_pointer)
        glfw.set_cursor_enter_callback(window, self.on_enter)
        glfw.set_mouse_button_callback(window, self.on_button)
        glfw.set_scroll_callback(window, self.on_scroll)
        self.window_events.connect()

    # -- keyboard ----------------------------------------------------------------------------------------------------

    def on_key(self, _window, key: int, scancode: int, action: int, mods: int) -> None:
        host = self._host
        glfw = host.glfw
        host.wake()
        host.answers.note()
        if action == glfw.PRESS:
            host.session.flight.stop_glide()
        self._modifiers = self.keyboard.modifiers(mods, key, action)
        give = self._later(self._take_key, key, scancode, action, mods)
        chord = bool(mods & glfw.MOD_CONTROL)
        letter = self.keyboard.chord(key, scancode, action, mods)[0] if chord and action == glfw.PRESS else ""
        if not self._in_order.keeps_key(letter, self._modifiers.control, give):
            give()

    def _later(self, take: Callable[..., object], *of_event: object) -> Callable[[], object]:
        """Gives an event that came now, whenever it is called, with the modifiers and the time that it has."""
        of_now = self._modifiers, self._clock()

        def give() -> None:
            self._given = of_now
            take(*of_event)

        return give

    def _take_key(self, key: int, scancode: int, action: int, mods: int) -> None:
        """Gives a key at once, or to the text that is coming."""
        give = partial(self._give_key, key, scancode, action, mods, self._given[0])
        glfw, coming = self._host.glfw, self._host.toolbox.text_coming
        if mods & glfw.MOD_CONTROL or not self.text_ahead.keeps_key(self.keyboard.names.get(key, ""), action != glfw.RELEASE,
                                                                    coming, give):
            give()

    def _give_key(self, key: int, scancode: int, action: int, mods: int, modifiers: Modifiers) -> None:
        """Gives a key to imgui, and to what else it is for."""
        host = self._host
        glfw, imgui = host.glfw, host.imgui
        clicked = self.after_typing.behind_click
        imgui.backends.glfw_key_callback(host.address, key, scancode, action, mods)
        name, chord = self.keyboard.chord(key, scancode, action, mods)
        if chord is not None and chord.everywhere:
            if action == glfw.PRESS:
                self.after_typing.do(partial(host.act, chord.action))
            return
        use = partial(self._use_key, key, name, chord, action, mods, modifiers)
        if self.after_typing or clicked:  # Esc after Ctrl+Q answers the question; a letter after a click into a text is typed
            self.after_typing.do(use)
        else:
            use()

    def _use_key(self, key: int, name: str, chord: Control | None, action: int, mods: int, modifiers: Modifiers) -> None:
        """What a key does beside what imgui makes of it."""
        host = self._host
        glfw = host.glfw
        asked = host.session.notices.message is not None
        typing = host.imgui.get_io().want_text_input or host.asking
        free = host.session.scene is not None and not asked
        control = self.keyboard.controls.get(key)
        if chord is None and control is not None and control.kind in ("hold", "modifier"):  # Z of a French keyboard lies on W
            if action == glfw.RELEASE:
                host.session.flight.held.discard(control.action)
            elif action == glfw.PRESS and free and not typing and not mods & glfw.MOD_CONTROL:
                host.session.flight.held.add(control.action)
            return
        if typing or (name != "ESCAPE" and (asked or list_is_open(host.imgui))):
            return
        if free:
            kinds: dict[int, Literal["press", "release", "repeat"]] = {
                glfw.PRESS: "press", glfw.RELEASE: "release", glfw.REPEAT: "repeat",
            }  # fmt: skip
            # of Esc the action "escape" gives to the tool what is not for something above it
            if name != "ESCAPE" and host.toolbox.key_event(KeyEvent(name, kinds[action], modifiers), host.tools):
                return
            if chord is not None:
                host.act(chord.action)
                return
        if control is not None and action == glfw.PRESS and not mods & glfw.MOD_CONTROL:
            host.act(control.action)

    def on_char(self, _window, character: int) -> None:
        give = partial(self._take_character, character)
        if not self._in_order.keeps_key("", self._modifiers.control, give):
            give()

    def _take_character(self, character: int) -> None:
        give = partial(self._host.imgui.backends.glfw_char_callback, self._host.address, character)
        if not self.text_ahead.keeps_character(self._host.toolbox.text_coming, give):
            give()

    def follow(self, *, drawn: bool) -> None:
        """Called in every turn of the loop.  drawn: as of AfterTyping."""
        self.text_ahead.follow(self._host.toolbox.text_coming)
        self._in_order.follow(drawn=drawn)
        if self._in_order:
            self._host.wake()
        self.after_typing.follow(drawn=drawn)

    # -- pointer -----------------------------------------------------------------------------------------------------

    def on_enter(self, _window, entered: int) -> None:
        self._host.wake()
        self._host.imgui.backends.glfw_cursor_enter_callback(self._host.address, entered)
        if not entered:
            self._host.session.pointer = None
            self._tool("leave")

    def on_pointer(self, _window, x: float, y: float) -> None:
        self._host.wake()
        give = self._later(self._take_pointer, x, y)
        if not self._in_order.keeps_pointer(self._modifiers.control, give, move=True):
            give()

    def _take_pointer(self, x: float, y: float) -> None:
        host = self._host
        host.imgui.backends.glfw_cursor_pos_callback(host.address, x, y)
        delta = (x - self.pointer[0], y - self.pointer[1])
        self.pointer = (x, y)
        self._travelled += abs(delta[0]) + abs(delta[1])
        over_interface = self._over_interface
        if over_interface:
            host.linger()
        if host.session.dragging_handle:
            host.session.move_split(self.position[0])
        elif host.session.scene is not None and (not over_interface or host.toolbox.holding):
            host.session.pointer = self.position
            self._tool("move", delta=delta)
        else:
            host.session.pointer = None

    @property
    def _over_interface(self) -> bool:
        """Whether the pointer is imgui's; as it was at the press while a button is held."""
        return self._held_over_interface if self._held else over_interface(self._host.imgui, self.pointer)

    @property
    def position(self) -> tuple[float, float]:
        """The pointer in pixels of the picture."""
        session = self._host.session
        left, top = session.area.origin
        return self.pointer[0] * session.area.density - left, self.pointer[1] * session.area.density - top

    def _tool(self, kind: Literal["press", "release", "move", "wheel", "leave"], *, delta: tuple[float, float] = (0.0, 0.0),
              clicks: int = 0, notches: float = 0.0) -> None:
        event = PointerEvent(kind, self.position, delta, self._button, clicks, notches, self._given[0])
        self._host.toolbox.pointer(event, self._host.tools)

    def on_button(self, _window, button: int, action: int, mods: int) -> None:
        host = self._host
        glfw = host.glfw
        host.wake()
        host.answers.note()
        if action == glfw.PRESS:
            host.session.flight.stop_glide()
        self._modifiers = self.keyboard.modifiers(mods)
        give = self._later(self._take_button, button, action, mods)
        if not self._in_order.keeps_pointer(self._modifiers.control, give):
            give()

    def _take_button(self, button: int, action: int, mods: int) -> None:
        host = self._host
        glfw, session = host.glfw, host.session
        over_interface = self._over_interface
        if action == glfw.RELEASE:
            self._held.discard(button)
        elif not self._held:
            self._held_over_interface = over_interface
        if action == glfw.PRESS:
            self._held.add(button)
        self._give_button(button, action == glfw.PRESS)
        if button not in self._buttons:
            return
        name = self._buttons[button]
        if action == glfw.RELEASE:
            if name == self._button:
                self._release(name)
        elif not self._button and not over_interface and session.scene is not None:
            self._button, self._travelled = name, 0.0
            if button == glfw.MOUSE_BUTTON_LEFT and self.over_handle:
                session.dragging_handle = True
            else:
                self._tool("press")

    def _give_button(self, button: int, pressed: bool) -> None:
        """Gives a button to imgui, as its backend does, but with the modifiers of the event: those that are held now may be
        others."""
        imgui, modifiers = self._host.imgui, self._given[0]
        io, key = imgui.get_io(), imgui.Key
        for mod, held in ((key.mod_ctrl, modifiers.control), (key.mod_shift, modifiers.shift), (key.mod_alt, modifiers.alt)):
            io.add_key_event(mod, held)
        if 0 <= button < imgui.MouseButton_.count:
            io.add_mouse_button_event(button, pressed)

    def _release(self, name: str) -> None:
        now, clicks = self._given[1], 0
        if self._travelled <= _CLICK:
            before, button, place = self._last_click
            near = abs(self.pointer[0] - place[0]) + abs(self.pointer[1] - place[1]) <= _CLICK
            clicks = 2 if button == name and near and now - before <= _DOUBLE_CLICK else 1
            self._last_click = (now, name if clicks == 1 else "", self.pointer)
        if not self._host.session.dragging_handle:
            self._tool("release", clicks=clicks)
        self._host.session.dragging_handle, self._button = False, ""

    def release_all(self) -> None:
        """Lets go of all keys and buttons, as the window has lost the keys."""
        self._held.clear()
        self.release_pointer()
        self._host.session.let_go()

    def release_pointer(self) -> None:
        """Ends a drag that is under way."""
        self._host.toolbox.release(self._host.tools)
        self._host.session.dragging_handle, self._button = False, ""

    def set_captured(self, captured: bool) -> None:
        """Hides the pointer and lets it move without end, or shows it where it was hidden."""
        glfw, window = self._host.glfw, self._host.window
        glfw.set_input_mode(window, glfw.CURSOR, glfw.CURSOR_DISABLED if captured else glfw.CURSOR_NORMAL)
        self.pointer = glfw.get_cursor_pos(window)  # the next event counts from here

    @property
    def over_handle(self) -> bool:
        """Whether the pointer is on the line of a comparison."""
        session = self._host.session
        at = session.view_settings.split_at * session.area.size[0]
        grip = _GRIP * self._host.theme.scale * session.area.density
        x, y = self.position
        return session.view_settings.split and abs(x - at) <= grip and 0 <= y < session.area.size[1]

    def on_scroll(self, _window, dx: float, dy: float) -> None:
        self._host.wake()
        self._host.answers.note()
        give = self._later(self._take_scroll, dx, dy)
        if not self._in_order.keeps_pointer(self._modifiers.control, give):
            give()

    def _take_scroll(self, dx: float, dy: float) -> None:
        host = self._host
        host.imgui.backends.glfw_scroll_callback(host.address, dx, dy)
        if not host.imgui.get_io().want_capture_mouse and host.session.scene is not None:
            self._tool("wheel", notches=dy)
