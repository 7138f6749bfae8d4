"""The view switch over the picture: the lit segment is drawn, the outlined one was requested and is being made.  A neural view
that a smaller network draws while the camera moves is lit and outlined."""

from imgui_bundle import ImVec2, imgui

from ...picture.views import VIEWS
from ..kit import theme
from ..kit.theme import Theme, packed
from ..kit.widgets import DOCKED, LIT, MARGIN, hint
from ..session.panel_actions import Actions
from ..session.session import Session

_WIDTH, _SHORT_WIDTH, _HEIGHT = 84.0, 46.0, 30.0


def draw_view_switch(session: Session, actions: Actions, style: Theme) -> None:
    """Top centre of the picture."""
    if session.scene is None:
        return
    px, area, chosen = style.px, session.area.layout.picture, session.view_settings
    short = area.width < px(len(VIEWS) * _WIDTH + 60 + 2 * MARGIN)
    width, height = px(_SHORT_WIDTH if short else _WIDTH), px(_HEIGHT)
    whole = len(VIEWS) * width + px(8) + px(40)
    imgui.set_next_window_pos(ImVec2(area.left + max((area.width - whole) / 2, 0.0), area.top + px(10)))
    imgui.set_next_window_size(ImVec2(whole, height + px(8)))
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(px(4), px(4)))
    imgui.begin("view switch", None, DOCKED)
    imgui.pop_style_var()
    imgui.push_font(style.regular, theme.SMALL)
    wanted = chosen.shown_settings.view
    for number, (view, row) in enumerate(VIEWS.items()):
        if number:
            imgui.same_line(0, 0)
        lit, asked = view in session.screen.drawn, view == wanted
        smaller = session.screen.smaller_network if "network" in row.passes and lit else None
        coming = asked and (not lit or smaller is not None)
        if _segment(row.short if short else row.title, width, height, style, lit=lit, asked=coming):
            actions.show_view(view)
        state = ""
        if smaller is not None:
            state = f"\nDrawn by the {smaller} network while the camera moves; {chosen.settings.quality} at rest."
        elif coming:
            loading = chosen.network_load is not None
            state = "\nAsked for; " + ("its network is being loaded." if loading else "shown as soon as it is made.")
        hint(f"{row.text} ({number + 1}){state}", style)
    imgui.same_line(0, px(4))
    if _segment("||", px(36), height, style, lit=chosen.split, asked=False):
        actions.compare(not chosen.split)
    hint("Compare two views side by side (V)", style)
    imgui.pop_font()
    imgui.end()


def _segment(text: str, width: float, height: float, style: Theme, *, lit: bool, asked: bool) -> bool:
    colours = LIT if lit else ()
    for slot, colour in colours:
        imgui.push_style_color(slot, colour)
    pressed = imgui.button(text, ImVec2(width, height))
    imgui.pop_style_color(len(colours))
    if asked:
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        inset = style.px(1.5)
        colour = packed(theme.ACCENT_TEXT if lit else theme.ACCENT)
        imgui.get_window_draw_list().add_rect(
            ImVec2(low.x + inset, low.y + inset), ImVec2(high.x - inset, high.y - inset), colour, style.px(5), style.px(2.5))
    return pressed
