"""What the keys of a keyboard are called and mean: GLFW's numbers, the table of controls, and what a layout prints on them."""

from typing import Any

from ..interaction.controls import Control, by_chord, by_key
from ..interaction.tool import Modifiers


class Keyboard:
    """The keys of one window.  glfw: the module.  names: GLFW's number -> its name without ``KEY_``.  controls: number -> what
    the key does by itself."""

    def __init__(self, glfw: Any):
        self._glfw = glfw
        self.controls: dict[int, Control] = {getattr(glfw, f"KEY_{key}"): control for key, control in by_key().items()}
        self._chords = by_chord()
        self.names = {value: name.removeprefix("KEY_") for name, value in vars(glfw).items() if name.startswith("KEY_")}
        self._modifiers: dict[int, int] = {
            getattr(glfw, f"KEY_{side}_{name}"): getattr(glfw, f"MOD_{name}")
            for side in ("LEFT", "RIGHT") for name in ("SHIFT", "CONTROL", "ALT")
        }  # fmt: skip

    def chord(self, key: int, scancode: int, action: int, mods: int) -> tuple[str, Control | None]:
        """The name of a key and, where it is pressed or repeated, the chord that it makes with the keys held.

        With Ctrl a letter is named as this keyboard prints it, where it prints a Latin one; else by its place.
        """
        glfw, name = self._glfw, self.names.get(key, "")
        if not mods & glfw.MOD_CONTROL:
            return name, None
        printed = (glfw.get_key_name(key, scancode) or "").upper()
        if len(printed) == 1 and "A" <= printed <= "Z":
            name = printed
        if action == glfw.RELEASE or mods & (glfw.MOD_ALT | glfw.MOD_SUPER):
            return name, None
        return name, self._chords.get(f"CTRL_{'SHIFT_' if mods & glfw.MOD_SHIFT else ''}{name}")

    def modifiers(self, mods: int, key: int | None = None, action: int = 0) -> Modifiers:
        """The modifiers held after an event.  mods: GLFW's.  key, action: the key whose event it is; X11 leaves a modifier out
        of the event of its own key."""
        glfw = self._glfw
        own = self._modifiers.get(key, 0) if key is not None else 0
        mods = mods & ~own if action == glfw.RELEASE else mods | own
        return Modifiers(bool(mods & glfw.MOD_SHIFT), bool(mods & glfw.MOD_CONTROL), bool(mods & glfw.MOD_ALT))

    def printed(self, control: Control) -> str:
        """What this keyboard prints on a letter's key; the table's name otherwise."""
        if len(control.name) != 1 or not control.name.isalpha():
            return control.name
        key = getattr(self._glfw, f"KEY_{control.keys[0]}")
        return (self._glfw.get_key_name(key, 0) or control.name).upper()
