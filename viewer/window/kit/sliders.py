"""Sliders that are filled from the left up to their value, with the value written over them: nothing covers the text."""

from collections.abc import Callable
from math import log
from typing import TypeVar

from imgui_bundle import ImVec2, imgui

from . import theme
from .theme import packed

CLAMP = imgui.SliderFlags_.always_clamp
LOGARITHMIC = imgui.SliderFlags_.logarithmic
_COLOURS = (imgui.Col_.slider_grab, imgui.Col_.slider_grab_active, imgui.Col_.frame_bg, imgui.Col_.frame_bg_hovered,
            imgui.Col_.frame_bg_active)  # fmt: skip
Number = TypeVar("Number", int, float)


def slider_float(name: str, value: float, least: float, most: float, form: str, flags: int = CLAMP) -> tuple[bool, float]:
    """As ``imgui.slider_float``: whether the value was changed, and the value; a person may type one, "nan" too."""
    share = log(value / least) / log(most / least) if flags & LOGARITHMIC else (value - least) / (most - least)
    return _filled(lambda: imgui.slider_float(name, value, least, most, form, flags), share)


def slider_int(name: str, value: int, least: int, most: int, form: str) -> tuple[bool, int]:
    """As ``imgui.slider_int``."""
    return _filled(lambda: imgui.slider_int(name, value, least, most, form, CLAMP), (value - least) / (most - least))


def _filled(draw_slider: Callable[[], tuple[bool, Number]], share: float) -> tuple[bool, Number]:
    """Draws a slider without grip or ground of its own, and a bar over ``share`` of its width below it."""
    draw = imgui.get_window_draw_list()
    draw.channels_split(2)
    draw.channels_set_current(1)
    for colour in _COLOURS:
        imgui.push_style_color(colour, theme.NOTHING)
    found = draw_slider()
    imgui.pop_style_color(len(_COLOURS))
    low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
    rounding = imgui.get_style().frame_rounding
    ground = theme.FIELD_OVER if imgui.is_item_hovered() else theme.FIELD
    draw.channels_set_current(0)
    draw.add_rect_filled(low, high, packed(ground), rounding)
    right = low.x + (high.x - low.x) * min(max(share, 0.0), 1.0)
    if right > low.x:
        draw.push_clip_rect(low, ImVec2(right, high.y), True)  # a narrow bar has the round corners of the whole, too
        draw.add_rect_filled(low, high, packed(theme.SLIDER), rounding)
        draw.pop_clip_rect()
        draw.add_line(ImVec2(right, low.y + 1), ImVec2(right, high.y - 1), packed(theme.ACCENT), 2.0)
    draw.channels_merge()
    return found
