"""The points of a measurement that is not ended: what a person is told about them, and how they come back once given up."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ....common.text import counted
from ....work.measuring.measurement import KINDS, Begun, MeasuredPoint

if TYPE_CHECKING:
    from ....work.document import Document
    from ....work.history import History


@dataclass(frozen=True)
class GivenUp:
    """What another kind has given up.  points: those set.  waiting: those whose surface was being fitted.  history, step: of
    the work then, and the step that would be undone: once there is another, that one is undone first."""

    kind: str
    points: list[MeasuredPoint]
    waiting: list[MeasuredPoint]
    history: "History[Document]" = field(repr=False)
    step: str | None

    @property
    def text(self) -> str:
        """What was given up, and how it comes back."""
        count = len(self.points) + len(self.waiting)
        return (f"{counted(count, 'point')} of the {KINDS[self.kind].name.lower()} given up; "
                f"Ctrl+Z brings {'it' if count == 1 else 'them'} back")

    def is_last(self, history: "History[Document]") -> bool:
        """Whether nothing has been done since that would be undone first."""
        return history is self.history and history.undo_label == self.step


def goes_over(points: list[MeasuredPoint], kind: str) -> bool:
    """Whether a measurement of another kind begins with ``points``: surfaces that it measures too, and room for more.  Places
    that were clicked for one kind are no corners of another."""
    new = KINDS[kind]
    room = new.most is None or len(points) < new.most
    return room and all(point.fit is not None and point.fit.kind == new.surface(number) for number, point in enumerate(points))


def left_text(begun: Begun) -> str:
    """What is said of points that were set before the tool was selected again."""
    name = KINDS[begun.kind].name.lower()
    article = "an" if name[0] in "aeiou" else "a"
    return f"{counted(len(begun.points), 'point')} of {article} {name} that is not ended: go on, or Esc"
