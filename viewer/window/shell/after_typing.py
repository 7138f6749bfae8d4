"""Actions that wait until imgui has taken what was typed before them.

imgui takes a key or two a frame, so that where frames take long, keys wait in its queue.  Ctrl+S at once would save a name
without its last letters, Ctrl+Q would close the window without a question, and Enter that was typed before would answer it.
"""

from collections.abc import Callable
from typing import Any


class AfterTyping:
    """The actions that wait.  imgui: with a context."""

    def __init__(self, imgui: Any):
        self._imgui = imgui
        self._waiting: list[tuple[int, Callable[[], object]]] = []

    def __bool__(self) -> bool:
        """Whether an action waits."""
        return bool(self._waiting)

    @property
    def behind_click(self) -> bool:
        """Whether imgui has not taken a click yet, so that it is not known whether a text is being typed."""
        imgui = self._imgui
        queue = imgui.get_current_context().input_events_queue
        return any(event.type == imgui.internal.InputEventType.mouse_button for event in queue)

    def do(self, action: Callable[[], object]) -> None:
        """Calls ``action`` from a later :meth:`follow`, when imgui has taken all events that it has now."""
        self._waiting.append((self._imgui.get_current_context().input_events_next_event_id, action))

    def follow(self, *, drawn: bool = True) -> None:
        """Called in every turn of the loop.  drawn: whether the interface is drawn at all; imgui takes no events otherwise."""
        while self._waiting:
            queue = self._imgui.get_current_context().input_events_queue
            number, action = self._waiting[0]
            if drawn and len(queue) and queue[0].event_id < number:
                return
            del self._waiting[0]
            action()
