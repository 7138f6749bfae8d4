"""A key or a click is answered before the next picture is made.

A picture takes longer than a person wants to wait for a button to light up.  Where an event asks for a new picture, the
interface is drawn over the last one first: menus, tools, dialogs and marks show at once what the event has changed, and the
picture follows.
"""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..planning.picture_plan import RefinementState

_FRAMES = 3
"""Interface frames after an event that answer it: imgui takes the press in one, the release in the next, and shows in the third
what a button has changed."""
_QUICK_MS = 20.0
"""Milliseconds of a picture up to which nobody waits for it: on a processor the interface alone takes as long."""


class Answers:
    """Counts the frames of the interface that are owed to a key or a click."""

    def __init__(self) -> None:
        self._owed = 0

    def note(self) -> None:
        """A key or a button of the mouse was pressed or released, or the wheel was turned."""
        self._owed = _FRAMES

    @property
    def begun(self) -> bool:
        """Whether the next frame of the interface is the first after an event.  It is laid out twice: imgui sizes a window by
        its text of the frame before, and hides one that it has no size of."""
        return self._owed == _FRAMES

    def drawn(self) -> None:
        """The interface is on the screen."""
        self._owed = max(0, self._owed - 1)

    def come_first(self, picture: "RefinementState") -> bool:
        """Whether the interface is to be drawn over the last picture before the next one is made."""
        there = picture.made is not None and picture.spec is not None
        return self._owed > 0 and there and picture.cost is not None and picture.cost.total_ms > _QUICK_MS
