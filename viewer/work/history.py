"""Undo and redo: a stack of whole states.

States are immutable values that share what did not change, so keeping hundreds costs little.  Changes that follow each other in
one gesture (dragging a slider or a handle) share a ``gesture`` and become one step.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

State = TypeVar("State")

MOST_STEPS = 500
"""Steps that can be undone; older ones are dropped."""


@dataclass(frozen=True)
class _Step(Generic[State]):
    label: str
    state: State  # after the step
    gesture: object


class History(Generic[State]):
    """The states of one document.  ``current`` is what is shown and saved."""

    def __init__(self, state: State):
        self._done: list[_Step[State]] = [_Step("", state, None)]
        self._undone: list[_Step[State]] = []

    @property
    def current(self) -> State:
        """The present state."""
        return self._done[-1].state

    @property
    def undo_label(self) -> str | None:
        """What the next undo takes back, None where nothing can be."""
        return self._done[-1].label if len(self._done) > 1 else None

    @property
    def redo_label(self) -> str | None:
        """What the next redo does again, None where nothing can be."""
        return self._undone[-1].label if self._undone else None

    def do(self, label: str, state: State, gesture: object = None) -> None:
        """Makes ``state`` the present one; whatever was undone can no longer be redone.  Equal states are no step.

        label: what the step does, for menus ("Move clip").  gesture: steps with the same one, not None, in a row are one.
        """
        if state == self.current:
            return
        self._undone.clear()
        if gesture is not None and len(self._done) > 1 and self._done[-1].gesture == gesture:
            self._done[-1] = _Step(label, state, gesture)
            if state == self._done[-2].state:  # back where it began: nothing is left to be undone
                self._done.pop()
        else:
            self._done.append(_Step(label, state, gesture))
        del self._done[: max(0, len(self._done) - 1 - MOST_STEPS)]

    def undo(self) -> str | None:
        """Goes one step back.  Returns its label, None where there is none."""
        if len(self._done) == 1:
            return None
        self._undone.append(self._done.pop())
        return self._undone[-1].label

    def redo(self) -> str | None:
        """Does the step again that was undone last.  Returns its label, None where there is none."""
        if not self._undone:
            return None
        self._done.append(self._undone.pop())
        return self._done[-1].label

    def replace(self, state: State) -> None:
        """Changes the present state without a step: for what is not undone, such as where the camera stands."""
        last = self._done[-1]
        self._done[-1] = _Step(last.label, state, last.gesture)

    def revise(self, change: Callable[[State], State]) -> None:
        """Corrects every state, those that were undone among them, without a step: what was measured is known better now."""
        self._done, self._undone = ([replace(step, state=change(step.state)) for step in steps]
                                    for steps in (self._done, self._undone))

    def end_gesture(self) -> None:
        """The next step is a step of its own, whatever its gesture."""
        last = self._done[-1]
        self._done[-1] = _Step(last.label, last.state, None)
