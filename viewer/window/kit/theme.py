"""How the interface looks: one dark style, one accent colour, one typeface, at any pixel density.

Sizes are design units; ``scale`` is logical pixels per design unit.  Logical pixels, or pixels of the interface, are GLFW's
and imgui's coordinates in the window; ``WindowArea.density`` is pixels of the framebuffer, as of the picture, per logical one.
Contrast (WCAG 2.1) is at least 4.5:1 for text and 3:1 for the edge or body of every control;
tests/unit/window/test_window_theme.py computes it.
"""

from collections.abc import Callable
from pathlib import Path

import imgui_bundle
from imgui_bundle import ImVec2, ImVec4, imgui

from ....model.common.linear_light import LUMINANCE, to_linear
from .drawable_text import accept_any_text
from .font_fallback import FontFallback

FONTS = Path(imgui_bundle.__file__).parent / "assets" / "fonts"
ICONS = FONTS / "Font_Awesome_6_Free-Solid-900.otf"
FONT_SIZE = 16.0
SMALL = 14.0
TITLE = 20.0


def _colour(text: str, alpha: float = 1.0) -> ImVec4:
    red, green, blue = (int(text[i : i + 2], 16) / 255 for i in (1, 3, 5))
    return ImVec4(red, green, blue, alpha)


TEXT = _colour("#E9EBEE")
DIM = _colour("#A3A9B3")
ACCENT = _colour("#5CC4C0")
SLIDER = _colour("#1F6663")
ACCENT_TEXT = _colour("#0E1B1B")
PANEL = _colour("#1D2025", 0.96)
FIELD = _colour("#2C3038")
FIELD_OVER = _colour("#383D47")
FIELD_DOWN = _colour("#454B57")
NOTHING = _colour("#000000", 0.0)
LINE = _colour("#3A3F49")
EDGE = _colour("#828996")
WARN = _colour("#F0B95B")
BAD = _colour("#F27A76")
SHADE = _colour("#0B0D10", 0.75)
OVERLAY_COLOURS = {
    "accent": ACCENT, "text": TEXT, "dim": DIM, "warn": WARN, "bad": BAD, "shade": SHADE,
    "blue": _colour("#7DB4FF"), "violet": _colour("#C3A2FF"), "green": _colour("#7FD88B"), "pink": _colour("#FF9CC8"),
}  # fmt: skip
"""Colours of lines, markers and labels over the picture, each drawn with a dark edge (``shade``)."""


class Theme:
    """Owns fonts and style of the current imgui context.  Fonts: regular and bold; fallback: those of other letters.  wake: as
    of FontFallback."""

    def __init__(self, scale: float, wake: Callable[[], None] = lambda: None):
        accept_any_text(imgui)
        folder = FONTS / "Roboto"
        fonts = imgui.get_io().fonts
        self.regular = fonts.add_font_from_file_ttf(str(folder / "Roboto-Regular.ttf"), FONT_SIZE)
        self._add_icons(fonts)
        self.bold = fonts.add_font_from_file_ttf(str(folder / "Roboto-Bold.ttf"), FONT_SIZE)
        self._add_icons(fonts)
        self.fallback = FontFallback((self.regular, self.bold), FONT_SIZE, wake)
        self.rescale(scale)

    @staticmethod
    def _add_icons(fonts: imgui.ImFontAtlas) -> None:
        """Adds the icons to the font that was added last."""
        merged = imgui.ImFontConfig()
        merged.merge_mode, merged.glyph_offset = True, ImVec2(0.0, 0.5)
        fonts.add_font_from_file_ttf(str(ICONS), FONT_SIZE - 1, merged)

    def rescale(self, scale: float) -> None:
        """Adapts to a screen of another density."""
        style = imgui.get_style()
        plain = imgui.Style()  # imgui truncates what it scales: always from the sizes as they were drawn up
        for name in dir(plain):
            if isinstance(value := getattr(plain, name), (float, ImVec2)) and not name.startswith(("_", "font_")):
                setattr(style, name, value)
        self._style()
        style.scale_all_sizes(scale)
        style.font_scale_dpi = scale
        self.scale = scale

    def px(self, size: float) -> float:
        """A length in design units, in logical pixels."""
        return size * self.scale

    @staticmethod
    def _style() -> None:
        imgui.style_colors_dark()
        style = imgui.get_style()
        style.window_padding = ImVec2(16, 14)
        style.frame_padding = ImVec2(10, 5)
        style.item_spacing = ImVec2(8, 8)
        style.item_inner_spacing = ImVec2(8, 6)
        style.cell_padding = ImVec2(6, 3)
        style.window_rounding, style.popup_rounding = 8, 6
        style.frame_rounding, style.grab_rounding = 5, 4
        style.scrollbar_size, style.scrollbar_rounding = 10, 5
        style.grab_min_size = 8
        style.window_border_size, style.popup_border_size, style.frame_border_size = 1, 1, 1
        style.window_title_align = ImVec2(0.0, 0.5)
        style.separator_text_border_size = 1
        style.separator_text_padding = ImVec2(0, 6)
        colours = {
            "text": TEXT, "text_disabled": DIM, "window_bg": PANEL, "popup_bg": _colour("#23262C"),
            "border": EDGE, "separator": LINE, "frame_bg": FIELD, "frame_bg_hovered": FIELD_OVER,
            "frame_bg_active": FIELD_DOWN, "button": FIELD, "button_hovered": FIELD_OVER, "button_active": FIELD_DOWN,
            "header": _colour("#5CC4C0", 0.28), "header_hovered": FIELD_OVER, "header_active": FIELD_DOWN, "check_mark": ACCENT,
            "slider_grab": SLIDER, "slider_grab_active": ACCENT,
            "plot_histogram": ACCENT, "nav_cursor": ACCENT,
            "text_selected_bg": _colour("#5CC4C0", 0.35), "modal_window_dim_bg": _colour("#000000", 0.45),
            "title_bg": PANEL, "title_bg_active": PANEL, "scrollbar_bg": _colour("#000000", 0.0),
            "scrollbar_grab": EDGE,
        }  # fmt: skip
        for name, value in colours.items():
            style.set_color_(getattr(imgui.Col_, name), value)


def luminance(colour: ImVec4) -> float:
    """Relative luminance (WCAG 2.1) of an opaque sRGB colour, 0 to 1."""
    return float(to_linear((colour.x, colour.y, colour.z)) @ LUMINANCE)


def contrast(one: ImVec4, other: ImVec4) -> float:
    """Contrast ratio (WCAG 2.1) of two opaque colours, 1 to 21."""
    dark, light = sorted((luminance(one), luminance(other)))
    return (light + 0.05) / (dark + 0.05)


def over(colour: ImVec4, behind: ImVec4) -> ImVec4:
    """A colour laid over an opaque one."""
    share = colour.w
    red, green, blue = (
        share * a + (1 - share) * b for a, b in zip((colour.x, colour.y, colour.z), (behind.x, behind.y, behind.z))
    )
    return ImVec4(red, green, blue, 1.0)


def packed(colour: ImVec4, alpha: float | None = None) -> int:
    """The colour for draw lists."""
    return imgui.get_color_u32(ImVec4(colour.x, colour.y, colour.z, colour.w if alpha is None else alpha))


def text_in(colour: ImVec4, text: str) -> None:
    """Text in a colour."""
    imgui.push_style_color(imgui.Col_.text, colour)
    imgui.text_unformatted(text)
    imgui.pop_style_color()


def fitted(text: str, width: float) -> str:
    """The text, or as much of its beginning and end as ``width`` pixels hold in the present font."""
    if imgui.calc_text_size(text).x <= width:
        return text
    least, most = 0, len(text)  # characters kept
    while least < most:
        kept = (least + most + 1) // 2
        if imgui.calc_text_size(_elided(text, kept)).x <= width:
            least = kept
        else:
            most = kept - 1
    return _elided(text, least)


def _elided(text: str, kept: int) -> str:
    return f"{text[: kept - kept // 2]}…{text[len(text) - kept // 2 :]}"
