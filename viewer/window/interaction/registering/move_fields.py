"""Rows in which a person moves a scan or a mesh by numbers, and takes that back."""

from typing import Any, Protocol

import numpy as np

from ....common.rigid_transform import IDENTITY, Rows, motion_text
from ...kit.number_field import number_input
from ...kit.widgets import tooltip_beside
from ..editing import unit_of
from ..tool import ToolContext

_LABEL = "m" * 5
"""As wide as the names of the numbers."""


class Moving(Protocol):
    """What the rows show and change.  shift: along x, y, z, file units.  degrees: counter-clockwise, seen from above."""

    shift: list[float]
    degrees: float

    def move_by_numbers(self, context: ToolContext) -> None: ...
    def put_back(self, context: ToolContext) -> None: ...


def move_fields(ui: Any, tool: Moving, context: ToolContext) -> None:
    """The fields and the button that moves by them; another button may follow on its line."""
    unit = unit_of(context)
    for axis, name in enumerate("xyz"):
        changed, value = number_field(ui, f"move {name}", tool.shift[axis], f"%.4f {unit}")
        if changed:
            tool.shift[axis] = value
    changed, value = number_field(ui, "turn", tool.degrees, "%.4f°")
    if changed:
        tool.degrees = value
    ui.begin_disabled(not (any(tool.shift) or tool.degrees))
    if ui.button("Move"):
        tool.move_by_numbers(context)
    ui.end_disabled()


def moved_rows(ui: Any, tool: Moving, transform: Rows, context: ToolContext) -> bool:
    """How it was moved, with a button that takes it back; nothing where it was not.  Returns whether there are rows."""
    if transform == IDENTITY:
        return False
    middle = np.zeros(3) if context.scene is None else context.scene.bounds.mean(axis=0)
    ui.text_wrapped(f"Moved: {motion_text(transform, middle)}")
    if ui.button("Put back"):
        tool.put_back(context)
    if ui.is_item_hovered():
        tooltip_beside(ui, "To where its file has it")
    return True


def number_field(ui: Any, name: str, value: float, form: str) -> tuple[bool, float]:
    """A number behind its name: (whether it was changed, the number)."""
    ui.align_text_to_frame_padding()
    ui.text_unformatted(name)
    ui.same_line(ui.calc_text_size(_LABEL).x)
    ui.set_next_item_width(-1)
    return number_input(ui, f"##{name}", value, form)
