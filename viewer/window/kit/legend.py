"""Legends over the picture: named colours, and a colour ramp with its range.  Bottom left, on a dark plate."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from imgui_bundle import ImVec2, imgui

from . import theme
from .theme import packed

if TYPE_CHECKING:
    from .overlay import OverlayCanvas

_TOOL_BAR, _LOW = 40.0, 700.0
"""Design units: width of the bar of tools at the left edge, and the height of the picture below which it reaches the legend."""
_MARGIN, _ROW, _SWATCH, _RAMP = 14.0, 22.0, 13.0, 220.0  # design units


def _plate(overlay: "OverlayCanvas", width: float, height: float) -> tuple[float, float]:
    """A dark plate of that size, which is kept free; returns its left and top."""
    px = overlay.theme.px
    left, top, _, down = overlay.area
    beside = px(_TOOL_BAR) if down < px(_LOW) else 0.0  # the bar of tools reaches down to the legend
    x, y = left + px(_MARGIN) + beside, top + down - px(_MARGIN) - height
    overlay.draw_list.add_rect_filled(ImVec2(x, y), ImVec2(x + width, y + height), packed(theme.PANEL, 0.92), px(5))
    overlay.keep_legend((x, y, width, height))
    return x, y


def draw_legend(overlay: "OverlayCanvas", rows: Sequence[tuple[tuple[int, int, int], str]], title: str = "") -> None:
    """rows: sRGB colour and text of each."""
    px, draw = overlay.theme.px, overlay.draw_list
    texts = [text for _, text in rows] + ([title] if title else [])
    width = max(imgui.calc_text_size(text).x for text in texts) + px(_SWATCH + 32)
    x, y = _plate(overlay, width, px(_ROW) * len(texts) + px(12))
    y += px(6)
    if title:
        draw.add_text(ImVec2(x + px(10), y + px(2)), packed(theme.TEXT), title)
        y += px(_ROW)
    for colour, text in rows:
        low = ImVec2(x + px(10), y + px(4))
        draw.add_rect_filled(low, ImVec2(low.x + px(_SWATCH), low.y + px(_SWATCH)), _colour(colour), px(2))
        draw.add_text(ImVec2(x + px(20 + _SWATCH), y + px(2)), packed(theme.TEXT), text)
        y += px(_ROW)


def draw_ramp(overlay: "OverlayCanvas", colours: np.ndarray, title: str, low: str, high: str) -> None:
    """colours: (256, 3) uint8, from the value ``low`` to ``high``."""
    px, draw = overlay.theme.px, overlay.draw_list
    width = max(px(_RAMP), imgui.calc_text_size(f"{low}    {high}").x, imgui.calc_text_size(title).x)
    x, y = _plate(overlay, width + px(20), 2 * px(_ROW) + px(_SWATCH + 12))
    x, y = x + px(10), y + px(6)
    draw.add_text(ImVec2(x, y + px(2)), packed(theme.TEXT), title)
    y += px(_ROW)
    edges = np.linspace(x, x + width, 65)
    for left, right, colour in zip(edges[:-1], edges[1:], colours[np.linspace(0, 255, 64).round().astype(int)]):
        draw.add_rect_filled(ImVec2(left, y), ImVec2(right, y + px(_SWATCH)), _colour(colour))
    y += px(_SWATCH + 3)
    draw.add_text(ImVec2(x, y), packed(theme.TEXT), low)
    draw.add_text(ImVec2(x + width - imgui.calc_text_size(high).x, y), packed(theme.TEXT), high)


def _colour(rgb) -> int:
    red, green, blue = (int(value) for value in rgb)
    return 0xFF000000 | blue << 16 | green << 8 | red
