"""The row that chooses what drags and the wheel do: in the inspector, and on the start page, where a person begins."""

from ..flight.mouse import PRESETS
from ..kit.theme import Theme
from ..kit.widgets import combo, label
from ..session.panel_actions import Actions


def draw_mouse_choice(chosen: str, actions: Actions, style: Theme, *, width: float = -1.0) -> None:
    """chosen: a key of PRESETS.  width: of the list, pixels; -1: the rest of the row."""
    table = {name: f"{preset.title}: {preset.text}" for name, preset in PRESETS.items()}
    label("mouse", table[chosen], style, width=width)
    asked = combo("##mouse", chosen, table, style, names={name: preset.title for name, preset in PRESETS.items()})
    if asked != chosen:
        actions.choose_mouse(asked)
