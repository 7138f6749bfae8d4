"""The switch in the panel of stations that has photographs colour surfaces from any viewpoint."""

from typing import Any

from ...kit.widgets import tooltip_beside
from ..tool import ToolContext


def coloured_surfaces(ui: Any, context: ToolContext) -> None:
    """The switch for surfaces coloured by photographs."""
    chosen = context.session.view_settings
    changed, on = ui.checkbox("Colour by photographs", chosen.shown_settings.photos != "off")
    if changed:
        chosen.show_photographs(on)
    if ui.is_item_hovered():
        tooltip_beside(ui, "in the filled and neural views, where photographs are finer than the points")


def about_view(context: ToolContext) -> str:
    """What is said of a comparison between a photograph and the view, where photographs have coloured the view."""
    frame = context.viewport.frame
    return ", which photographs colour" if frame is not None and frame.facts.photographs else ""
