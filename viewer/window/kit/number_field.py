"""Fields in which a person types a number.  What is no number is said at the field, and the value stays as it was.

imgui reads such a text when the field is left, as C does: letters are ignored without a word, "12abc" is 12, "nan" a number.
"""

import re
from collections.abc import Iterable
from math import isfinite
from typing import Any

from .widgets import tooltip_beside

_SHOWN = re.compile(r"%[.\d]*[fg]")
_NUMBER = re.compile(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?", re.IGNORECASE)


class _Said:
    """What was said at the field that was left last."""

    field, text = 0, ""


def number_in(text: str, form: str) -> float | None:
    """The number that a person typed; None where it is none, or has letters other than those of ``form``."""
    before, after = (part.replace("%%", "%").strip() for part in _SHOWN.split(form, 1))
    text = text.strip().removeprefix(before).strip()
    found = _NUMBER.match(text)
    if found is None or not after.startswith(text[found.end() :].strip()):
        return None
    value = float(found[0])
    return value if isfinite(value) else None


def number_input(ui: Any, name: str, value: float, form: str) -> tuple[bool, float]:
    """A field: (whether another number was typed, the number now), once, when it is left.  ui: the ``imgui`` module, inside a
    window.  form: of what is shown, as imgui has it: "%.3f m".  A field that is left as it was keeps the digits that it does
    not show."""
    ui.input_double(name, value, 0.0, 0.0, form)
    return _when_left(ui, value, form)


def number_inputs(ui: Any, name: str, values: Iterable[float], form: str) -> tuple[bool, list[float]]:
    """As :func:`number_input`, of several fields that share the width that was set."""
    found = list(values)
    gap = ui.get_style().item_inner_spacing.x
    width, changed = (ui.calc_item_width() - gap * (len(found) - 1)) / len(found), False
    for number, value in enumerate(found):
        if number:
            ui.same_line(0.0, gap)
        ui.set_next_item_width(width)
        typed, found[number] = number_input(ui, f"{name}{number}", value, form)
        changed = changed or typed
    return changed, found


def say_at_field(ui: Any, text: str) -> None:
    """Says beside the field that was drawn last what became of the number that was typed, until something is clicked."""
    _Said.field, _Said.text = ui.get_item_id(), text
    _draw(ui)


def _when_left(ui: Any, value: float, form: str) -> tuple[bool, float]:
    field = ui.get_item_id()
    if _Said.field == field:
        if ui.is_item_activated() or ui.is_mouse_clicked(0):
            _Said.field = 0
        else:
            _draw(ui)
    state = ui.internal.get_input_text_state(field) if ui.is_item_deactivated() else None
    text = "" if state is None else state.text_src.strip()
    if not text:
        return False, value
    read = number_in(text, form)
    if read is None:
        say_at_field(ui, f"\u201c{text}\u201d is not a number: the value stays")
    shown = _SHOWN.search(form)
    if read is None or (shown is not None and read == float(shown[0] % value)):
        return False, value
    return True, read


def _draw(ui: Any) -> None:
    tooltip_beside(ui, _Said.text)
