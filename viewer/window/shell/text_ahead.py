"""Keys that are typed before the text is there that a click asks for: they wait for it, and none acts as a shortcut.

A click with Notes writes a note whose text takes the keys.  The note is made when the picture is at rest, and its field takes
the keys some frames later; what a quick hand types in between belongs to the text.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .after_typing import AfterTyping

_NEVER_KEPT = {"ESCAPE", *(f"{side}_{name}" for side in ("LEFT", "RIGHT") for name in ("SHIFT", "CONTROL", "ALT", "SUPER"))}
"""Keys that act at once: Esc gives the click up."""
_SURE = 2
"""Turns of the loop: in the one in which imgui takes the release of the click, it still says that the text has the keys."""


class TextAhead:
    """The keys that wait.  imgui: with a context.  clicks: whether it has taken the clicks."""

    def __init__(self, imgui: Any, clicks: "AfterTyping"):
        self._imgui, self._clicks = imgui, clicks
        self._kept: list[Callable[[], object]] = []
        self._taken = 0  # turns for which a text has had the keys
        self._pressed: set[str] = set()

    def __bool__(self) -> bool:
        """Whether a key waits."""
        return bool(self._kept)

    @property
    def _typing(self) -> bool:
        return self._imgui.get_io().want_text_input and not self._clicks.behind_click

    def keeps_key(self, name: str, pressed: bool, coming: bool, give: Callable[[], object]) -> bool:
        """Whether a key waits; it is kept then.  name: GLFW's.  pressed: else released.  coming: whether a text is.
        give: gives it to imgui and to what uses keys."""
        if pressed:
            if name in _NEVER_KEPT or not self._waits(coming):
                return False
            self._pressed.add(name)
        elif name not in self._pressed:  # it was pressed before
            return False
        else:
            self._pressed.discard(name)
            if not self._kept:  # its press has been given
                return False
        self._kept.append(give)
        return True

    def keeps_character(self, coming: bool, give: Callable[[], object]) -> bool:
        """As ``keeps_key``, of what a key writes."""
        if not self._waits(coming):
            return False
        self._kept.append(give)
        return True

    def _waits(self, coming: bool) -> bool:
        return bool(self._kept) or (coming and self._taken < _SURE)

    def follow(self, coming: bool) -> None:
        """Called in every turn of the loop: gives the keys to the text, or forgets them where none comes."""
        self._taken = self._taken + 1 if self._typing else 0
        if not self._kept or (coming and self._taken < _SURE):
            return
        kept, self._kept = self._kept, []
        if self._taken:
            for give in kept:
                give()
        else:
            self._pressed.clear()
