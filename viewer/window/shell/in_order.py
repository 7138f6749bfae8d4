"""Keys and clicks in the order in which a person makes them, where a frame takes longer than that.

imgui gives a chord (Ctrl+A, C, X, V, Y and Z) to the text that has the keys only if Ctrl is down in the frame before, and still
in the one that takes the letter.  With a software renderer Ctrl is often pressed or released within that frame, and nothing
happens.  Here the letter waits until imgui has taken Ctrl, and what comes behind it waits until imgui has taken the letter.

A click behind typed keys waits until imgui has taken them: it would move the keys to another text, where the rest of a number
would arrive, or end a note without its last letters.
"""

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Literal

if TYPE_CHECKING:
    from .after_typing import AfterTyping
    from .text_ahead import TextAhead

LETTERS = "ACVXYZ"
"""What they do in a text: select all, copy, paste, cut, redo, undo."""


class InOrder:
    """The events that wait.  imgui: with a context.  clicks: whether it has taken the clicks.  text_ahead: keys before them."""

    def __init__(self, imgui: Any, clicks: "AfterTyping", text_ahead: "TextAhead"):
        self._imgui, self._clicks, self._text_ahead = imgui, clicks, text_ahead
        self._kept: deque[tuple[Literal["key", "pointer"], str, bool, Callable[[], object]]] = deque()
        self._given = False  # whether the last one was a letter, which imgui takes before Ctrl is released

    def __bool__(self) -> bool:
        """Whether an event waits: imgui takes what is before it only in a frame."""
        return bool(self._kept)

    @property
    def _queue(self) -> Any:
        return self._imgui.get_current_context().input_events_queue

    @property
    def _typing(self) -> bool:
        """Whether keys are, or may be, for a text."""
        return bool(self._text_ahead) or self._imgui.get_io().want_text_input or self._clicks.behind_click

    @property
    def _typed_waits(self) -> bool:
        """Whether there are keys before a click that imgui has not taken, or that wait for their text."""
        types = self._imgui.internal.InputEventType
        return bool(self._text_ahead) or any(event.type in (types.key, types.text) for event in self._queue)

    def keeps_key(self, letter: str, ctrl: bool, give: Callable[[], object]) -> bool:
        """Whether a key, or what it writes, waits; it is kept then.  letter: of a chord with Ctrl that is pressed, "" of
        another key.  ctrl: whether Ctrl is down after it.  give: gives it to imgui and to what uses keys."""
        chord = letter in tuple(LETTERS) and self._imgui.get_io().want_text_input
        if not (chord or self._kept or self._given):
            return False
        self._kept.append(("key", letter if chord else "", ctrl, give))
        return True

    def keeps_pointer(self, ctrl: bool, give: Callable[[], object], *, move: bool = False) -> bool:
        """As ``keeps_key``, of the mouse.  move: a move, which takes the keys from no text; else a button or the wheel."""
        if not (self._kept or self._given or (not move and self._typing and self._typed_waits)):
            return False
        self._kept.append(("pointer", "", ctrl, give))
        return True

    def follow(self, *, drawn: bool) -> None:
        """Called in every turn of the loop.  drawn: whether the interface is drawn at all; imgui takes no events otherwise."""
        taken = not (drawn and len(self._queue))
        self._given = self._given and not taken
        while self._kept:
            kind, letter, ctrl, give = self._kept[0]
            if self._given or (letter and not taken) or (kind == "pointer" and drawn and self._typed_waits):
                return
            self._kept.popleft()
            io, keys = self._imgui.get_io(), self._imgui.Key
            self._given = bool(letter) and io.want_text_input  # a click before it may have left the text
            taken = taken and not drawn
            if not self._given:
                give()
            io.add_key_event(keys.mod_ctrl, ctrl)  # the backend adds what is down now
            if self._given:
                io.add_key_event(getattr(keys, letter.lower()), True)
