"""Ctrl+A, C, X, V, Y and Z in a text, where a frame takes longer than the keys are held.

imgui gives a chord to the text that has the keys only if Ctrl is down in the frame before, and still in the one that takes the
letter.  With a software renderer Ctrl is often pressed or released within that frame, and nothing happens.  Here the
letter waits until imgui has taken Ctrl, and what is typed behind it waits until imgui has taken the letter.
"""

from collections import deque
from collections.abc import Callable
from typing import Any

LETTERS = "ACVXYZ"
"""What they do in a text: select all, copy, paste, cut, redo, undo."""


class TextChords:
    """The keys that wait.  imgui: with a context."""

    def __init__(self, imgui: Any):
        self._imgui = imgui
        self._kept: deque[tuple[str, bool, Callable[[], object]]] = deque()
        self._given = False  # whether the last one was a letter, which imgui takes before Ctrl is released

    def __bool__(self) -> bool:
        """Whether an event waits: imgui takes what is before it only in a frame."""
        return bool(self._kept)

    def keeps(self, letter: str, ctrl: bool, give: Callable[[], object]) -> bool:
        """Whether an event waits; it is kept then.  letter: of a chord with Ctrl that is pressed, "" of another event.
        ctrl: whether Ctrl is down after it.  give: gives it to imgui and to what uses keys."""
        letter = letter if letter in tuple(LETTERS) and self._imgui.get_io().want_text_input else ""
        if not (letter or self._kept or self._given):
            return False
        self._kept.append((letter, ctrl, give))
        return True

    def follow(self, *, drawn: bool) -> None:
        """Called in every turn of the loop.  drawn: whether the interface is drawn at all; imgui takes no events otherwise."""
        taken = not (drawn and len(self._imgui.get_current_context().input_events_queue))
        self._given = self._given and not taken
        while self._kept:
            letter, ctrl, give = self._kept[0]
            if self._given or (letter and not taken):
                return
            self._kept.popleft()
            self._given = bool(letter)
            taken = taken and not drawn
            io, keys = self._imgui.get_io(), self._imgui.Key
            if not letter:
                give()
            io.add_key_event(keys.mod_ctrl, ctrl)  # the backend adds what is down now
            if letter:
                io.add_key_event(getattr(keys, letter.lower()), True)
