"""The photographs in the panel of the Stations tool: the lists, and how the one that is shown is laid over the view.

tool: the Stations tool.
"""

from typing import Any

import numpy as np

from ....readers.e57.e57_pictures import StoredPicture
from ....work.measuring.measure_text import length_text
from ...kit import icons
from ...kit.sliders import slider_float
from ...kit.theme import fitted
from ...kit.widgets import compact_button, compact_width, tooltip_beside
from ...viewport.photo_blend import strength
from ..editing import metres_per_unit
from ..tool import ToolContext
from .photo_switch import about_view, coloured_surfaces
from .picture_viewer import of_scan
from .stand_at_photo import show_photo, stand_at


def draw_photographs(ui: Any, tool: Any, context: ToolContext) -> None:
    """The photographs in place, those by themselves, those placed by a search, and the one that is shown."""
    ui.separator()
    if tool.reading:
        ui.text_wrapped("Reading photographs…")
    elif not tool.photos and not tool.pictures:
        ui.text_wrapped("This scan holds no photographs." if not tool.warnings else tool.warnings[0])
    shown = context.session.work.photo
    if tool.photos:
        ui.text_unformatted("Photographs in place")
    for number, photo in enumerate(tool.photos):
        ui.push_id(1000 + number)
        room = ui.get_content_region_avail().x - compact_width((icons.PHOTOGRAPH,), context.theme)
        chosen = shown is not None and shown.photo is photo
        ui.push_style_var(ui.StyleVar_.selectable_text_align, (0.0, 0.5))
        clicked, _ = ui.selectable(f"{photo.title} ({photo.kind})", chosen, 0, (max(room, 1.0), ui.get_frame_height()))
        ui.pop_style_var()
        if clicked:
            tool.viewer.close_picture()
            show_photo(context, photo)
        if (stored := tool.stored.get(photo)) is not None:
            ui.same_line()
            if compact_button(icons.PHOTOGRAPH, context.theme):
                _look_at(tool, context, stored)
            if ui.is_item_hovered():
                tooltip_beside(ui, f"{stored.text}: look at it by itself")
        ui.pop_id()
    alone = [picture for picture in tool.pictures if picture not in tool.stored.values()]
    if alone:
        ui.text_unformatted("Photographs by themselves")
    for number, picture in enumerate(alone):
        ui.push_id(5000 + number)
        if ui.selectable(fitted(picture.text, ui.get_content_region_avail().x), tool.viewer.shows(picture))[0]:
            _look_at(tool, context, picture)
        if ui.is_item_hovered():
            where = "" if picture.placed else "; the file does not say where it was taken"
            tooltip_beside(ui, f"{picture.name}: look at it{where}")
        ui.pop_id()
    tool.viewer.draw(ui, context)
    viewed = tool.viewer.viewed.key if tool.viewer.viewed is not None else None
    tool.placer.draw(ui, context, viewed if isinstance(viewed, StoredPicture) else None)
    if tool.photos or context.document.photographs:
        coloured_surfaces(ui, context)
    _shown_photograph(ui, context)


def _look_at(tool: Any, context: ToolContext, picture: StoredPicture) -> None:
    """Shows a photograph by itself, or closes it where it is shown."""
    if tool.viewer.shows(picture):
        tool.viewer.close_picture()
    else:
        tool.viewer.open(context, of_scan(picture))


def _shown_photograph(ui: Any, context: ToolContext) -> None:
    shown = context.session.work.photo
    if shown is None:
        return
    ui.set_next_item_width(-1)
    _, percent = slider_float("##blend", 100.0 * shown.blend, 0.0, 100.0, "photograph %.0f %%")
    shown.blend = percent / 100.0 if np.isfinite(percent) else shown.blend  # "nan" may be typed
    _, shown.split = ui.checkbox("split against the view", shown.split)
    if shown.split:
        ui.set_next_item_width(-1)
        _, percent = slider_float("##split", 100.0 * shown.split_at, 0.0, 100.0, "line at %.0f %%")
        shown.split_at = percent / 100.0 if np.isfinite(percent) else shown.split_at
    ui.text_wrapped(state_text(context))
    if ui.button("Back to its place"):
        stand_at(context, shown.photo.position, shown.photo.forward)
    if ui.button("Hide photograph"):
        context.session.work.photo = None


def state_text(context: ToolContext) -> str:
    """What is said of the photograph that is shown: how well it agrees with the view, or why that is not known."""
    shown, layer = context.session.work.photo, context.viewport.photos
    assert shown is not None
    if layer.psnr is not None:
        return f"PSNR {layer.psnr:.1f} dB between photograph and view{about_view(context)}"
    if layer.waits:
        return "Preparing the photograph…"
    if layer.problem:
        return layer.problem
    away, metres = float(np.linalg.norm(context.camera.position - shown.photo.position)), metres_per_unit(context)
    if strength(away, metres, 1.0) <= 0:
        return f"{length_text(away, metres)} from its place: the photograph has faded out"
    return "Hidden by the slider" if shown.blend <= 0 else "No point lies behind it here: nothing to compare it with"
