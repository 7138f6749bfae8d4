"""The view cube at the top right of the picture: it follows the camera, and a click turns it to a face, edge or corner."""

from typing import Any

import numpy as np
from imgui_bundle import ImVec2, ImVec4, imgui

from ..flight.cube_regions import FACES, Region, cells_of, region_at
from ..kit import theme
from ..kit.theme import Theme, packed
from ..kit.widgets import DOCKED
from ..session.panel_actions import Actions
from ..session.session import Session

SIDE, RIGHT, TOP = 92.0, 62.0, 10.0
"""Design units: of the square that holds the cube, from the right edge past the buttons of the corner, and from the top."""
_NARROW = 560.0
"""Design units: width of the picture below which there is no room for the cube."""
_BESIDE, _BELOW = 700.0, 56.0
"""Design units: width of the picture below which the cube would lie on the view switch, and how far from the top it is then."""
_REACH = 1.78
"""Half the square in half sides of the cube, whose corners reach to the square root of three."""
_LABELLED = 0.65
"""Cosine to the viewer from which on a face carries its name."""


def draw_view_cube(session: Session, actions: Actions, style: Theme) -> None:
    """Drawn where it is switched on."""
    if session.scene is None or not session.area.panels.cube:
        return
    px, area = style.px, session.area.layout.uncovered
    if area.width < px(_NARROW):
        return
    side = px(SIDE)
    left, top = area.right - px(RIGHT) - side, area.top + px(TOP if area.width >= px(_BESIDE) else _BELOW)
    imgui.set_next_window_pos(ImVec2(left, top))
    imgui.set_next_window_size(ImVec2(side, side))
    imgui.set_next_window_bg_alpha(0.0)
    imgui.push_style_var(imgui.StyleVar_.window_padding, ImVec2(0, 0))
    imgui.push_style_var(imgui.StyleVar_.window_border_size, 0.0)
    imgui.begin("view cube", None, DOCKED)
    imgui.pop_style_var(2)
    pressed = imgui.invisible_button("##cube", ImVec2(side, side))
    state = session.flight.state
    to_view = (state.upright.T @ state.camera_to_world[:3, :3]).T
    middle, unit = np.array([left + side / 2, top + side / 2]), side / 2 / _REACH
    under = None
    if imgui.is_item_hovered():
        mouse = imgui.get_mouse_pos()
        under = region_at(to_view, (mouse.x - middle[0]) / unit, -(mouse.y - middle[1]) / unit)
    _draw(to_view, middle, unit, under, style)
    imgui.end()
    if pressed and under is not None:
        actions.turn_to(under)


def _draw(to_view: np.ndarray, middle: np.ndarray, unit: float, under: Region | None, style: Theme) -> None:
    draw = imgui.get_window_draw_list()

    def placed(corners: np.ndarray) -> list[Any]:
        seen = corners @ to_view.T
        return [ImVec2(float(x), float(y)) for x, y in middle + unit * seen[:, :2] * (1, -1)]

    lit = [] if under is None else cells_of(under)
    imgui.push_font(style.bold, theme.SMALL - 3)
    for name, normal in FACES.items():
        facing = float((to_view @ normal)[2])
        if facing <= 1e-6:
            continue
        axis = int(np.flatnonzero(normal)[0])
        corners = np.zeros((4, 3))
        corners[:, axis] = normal[axis]
        corners[:, (axis + 1) % 3], corners[:, (axis + 2) % 3] = (-1, 1, 1, -1), (-1, -1, 1, 1)
        shade = 0.5 + 0.4 * facing
        draw.add_convex_poly_filled(placed(corners), packed(ImVec4(shade * 0.96, shade * 0.98, shade, 0.94)))
        for part in lit:
            if (part[:, axis] == normal[axis]).all():
                draw.add_convex_poly_filled(placed(part), packed(theme.ACCENT, 0.85))
        ends = placed(corners)
        for a, b in zip(ends, ends[1:] + ends[:1]):  # no joints, which are long spikes where a face is a sliver
            draw.add_line(a, b, packed(theme.PANEL), style.px(1.2))
        if facing >= _LABELLED:
            size = imgui.calc_text_size(name)
            (at,) = placed(np.array([normal], float))
            draw.add_text(ImVec2(at.x - size.x / 2, at.y - size.y / 2), packed(theme.PANEL), name)
    imgui.pop_font()
