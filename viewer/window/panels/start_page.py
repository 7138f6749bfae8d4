"""The start page: open scans, try the demo, recent scans with thumbnails, and a drop area."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from imgui_bundle import ImVec2, imgui

from ...common.text import count_text
from ...readers.formats import KNOWN_FILES, KNOWN_FOLDERS
from ...readers.remote.address import address_text
from ..flight.mouse import PRESETS
from ..kit import theme
from ..kit.image_texture import texture_of
from ..kit.theme import Theme, fitted, packed, text_in
from ..kit.widgets import DOCKED, button, heading, hint, small
from ..session.panel_actions import Actions
from ..session.recent import RecentScan, load_thumbnail, recent_scans
from ..session.recovery import Recoverable
from .mouse_choice import draw_mouse_choice

if TYPE_CHECKING:
    import moderngl

_CARD, _PICTURE = 200.0, 125.0  # width of a card and height of its picture, design units


class StartPage:
    """Owns the thumbnails' textures."""

    def __init__(self, context: "moderngl.Context"):
        self._context = context
        self._recent: list[RecentScan] | None = None
        self._textures: list[moderngl.Texture | None] = []

    def renew(self) -> None:
        """Reads the recent scans again when the page is shown next."""
        for texture in self._textures:
            if texture is not None:
                texture.release()
        self._recent, self._textures = None, []

    def _load(self) -> list[RecentScan]:
        if self._recent is None:
            self._recent = recent_scans()
            self._textures = [self._thumbnail(scan) for scan in self._recent]
        return self._recent

    def _thumbnail(self, scan: RecentScan) -> "moderngl.Texture | None":
        image = load_thumbnail(scan)
        return None if image is None else texture_of(self._context, image)

    def draw(self, offers: Sequence[Recoverable], mouse: str, actions: Actions, style: Theme) -> None:
        """Draws the page, where no scan is shown or being opened.  offers: unsaved work of windows that are gone.  mouse: what
        it does, a key of viewer.window.flight.mouse.PRESETS."""
        px, size = style.px, imgui.get_io().display_size
        recent = self._load()
        width = min(size.x - px(32), px(4 * _CARD + 3 * 12 + 32))
        imgui.set_next_window_pos(ImVec2(size.x / 2, size.y / 2), 0, ImVec2(0.5, 0.5))
        imgui.set_next_window_size_constraints(ImVec2(width, 0), ImVec2(width, size.y - px(24)))
        imgui.push_style_color(imgui.Col_.window_bg, (0, 0, 0, 0))
        imgui.push_style_var(imgui.StyleVar_.window_border_size, 0.0)
        flags = (DOCKED & ~imgui.WindowFlags_.no_scrollbar) | imgui.WindowFlags_.always_auto_resize
        imgui.begin("start", None, flags | imgui.WindowFlags_.no_bring_to_front_on_focus)
        imgui.pop_style_var()
        imgui.pop_style_color()
        imgui.push_font(style.bold, theme.TITLE + 8)
        imgui.text_unformatted("pointglass")
        imgui.pop_font()
        text_in(theme.DIM, "Walk through a laser scan.")
        imgui.dummy(ImVec2(0, px(6)))
        self._buttons(actions, style)
        self._drop_area(style)
        imgui.dummy(ImVec2(0, px(4)))
        draw_mouse_choice(mouse, actions, style, width=px(140))
        imgui.same_line(0, px(12))
        text_in(theme.DIM, fitted(PRESETS[mouse].text, imgui.get_content_region_avail().x))
        self._unsaved(offers, actions, style)
        if recent:
            heading("Recent scans", style)
            self._cards(actions, style, recent)
        imgui.end()

    def _buttons(self, actions: Actions, style: Theme) -> None:
        narrow = imgui.get_content_region_avail().x < style.px(620)
        gap = 0 if narrow else style.px(8)
        width = -1.0 if narrow else style.px(140)
        if button("Open scans…", style, width=width, primary=True,
                  explained="Choose one file or several, which make one scene"):
            actions.do("open")
        if not narrow:
            imgui.same_line(0, gap)
        if button("Open a folder…", style, width=width,
                  explained=f"A folder of scans, or a {KNOWN_FOLDERS} folder"):
            actions.do("open_folder")
        if not narrow:
            imgui.same_line(0, gap)
        if button("Open an address…", style, width=width,
                  explained="A scan on a server: https://…, s3://…"):
            actions.do("open_address")
        if not narrow:
            imgui.same_line(0, gap)
        if button("Try the demo", style, width=width,
                  explained="A small scan that came with pointglass"):
            actions.do("demo")

    def _unsaved(self, offers: Sequence[Recoverable], actions: Actions, style: Theme) -> None:
        """Work that windows which ended before it was saved have left."""
        if offers:
            heading("Unsaved work", style)
        for number, found in enumerate(offers):
            imgui.push_id(number)
            if button("Restore", style, width=style.px(110), primary=True, explained="Opens the scan with this work"):
                actions.restore(found)
            imgui.same_line(0, style.px(8))
            if button("Discard…", style, width=style.px(110)):
                actions.ask_to_discard(found)
            imgui.same_line(0, style.px(12))
            imgui.align_text_to_frame_padding()
            told = f"{found.unsaved.title}, {found.when}: {found.text}"
            imgui.text_unformatted(fitted(told, imgui.get_content_region_avail().x))
            hint("\n".join(scan.path for scan in found.unsaved.document.scans[:8]), style)
            imgui.pop_id()

    def _drop_area(self, style: Theme) -> None:
        px, width = style.px, imgui.get_content_region_avail().x
        imgui.dummy(ImVec2(0, px(4)))
        at, height, draw = imgui.get_cursor_screen_pos(), px(104), imgui.get_window_draw_list()
        corner = ImVec2(at.x + width, at.y + height)
        draw.add_rect_filled(at, corner, packed(theme.PANEL), px(10))
        _dashed(draw, at, corner, packed(theme.EDGE), px(1.5), px(7))
        texts = (("Drop scans here", style.bold, theme.TITLE, theme.TEXT, 18),
                 (KNOWN_FILES, style.regular, theme.SMALL, theme.DIM, 50),
                 (f"{KNOWN_FOLDERS} folders, and folders of scans. F1 shows the controls.",
                  style.regular, theme.SMALL, theme.DIM, 72))
        for text, font, tall, colour, down in texts:
            imgui.push_font(font, tall)
            shown = fitted(text, width - px(24))
            left = at.x + (width - imgui.calc_text_size(shown).x) / 2
            draw.add_text(ImVec2(left, at.y + px(down)), packed(colour), shown)
            imgui.pop_font()
        imgui.dummy(ImVec2(width, height))

    def _cards(self, actions: Actions, style: Theme, recent: list[RecentScan]) -> None:
        px = style.px
        columns = max(1, int((imgui.get_content_region_avail().x + px(12)) / px(_CARD + 12)))
        for number, (scan, texture) in enumerate(zip(recent, self._textures)):
            if number % columns:
                imgui.same_line(0, px(12))
            imgui.push_id(number)
            imgui.begin_group()
            self._card(actions, style, scan, texture)
            imgui.end_group()
            imgui.pop_id()

    def _card(self, actions: Actions, style: Theme, scan: RecentScan, texture: "moderngl.Texture | None") -> None:
        px, reason = style.px, scan.missing
        at, size = imgui.get_cursor_screen_pos(), ImVec2(px(_CARD), px(_PICTURE))
        imgui.begin_disabled(bool(reason))
        pressed = imgui.invisible_button("card", size)
        imgui.end_disabled()
        over = imgui.is_item_hovered()
        hint(reason or "\n".join(map(address_text, scan.paths[:8])), style)
        draw, corner = imgui.get_window_draw_list(), ImVec2(at.x + size.x, at.y + size.y)
        if texture is not None:
            shade = imgui.get_color_u32((1.0, 1.0, 1.0, 0.35 if reason else 1.0))
            draw.add_image_rounded(imgui.ImTextureRef(texture.glo), at, corner, ImVec2(0, 0), ImVec2(1, 1), shade, px(6))
        else:
            draw.add_rect_filled(at, corner, packed(theme.FIELD), px(6))
        draw.add_rect(at, corner, packed(theme.ACCENT if over else theme.EDGE), px(6), px(2 if over else 1))
        imgui.push_font(style.regular, theme.FONT_SIZE - 1)
        text_in(theme.DIM if reason else theme.TEXT, fitted(scan.title, size.x))
        imgui.pop_font()
        small((reason and "not there any more") or f"{count_text(scan.points)} points", style)
        if pressed:
            actions.open([Path(path) for path in scan.paths])

    def release(self) -> None:
        self.renew()


def _dashed(draw, low: ImVec2, high: ImVec2, colour: int, width: float, dash: float) -> None:
    """A dashed rectangle."""
    for start, end in (((low.x, low.y), (high.x, low.y)), ((high.x, low.y), (high.x, high.y)),
                       ((high.x, high.y), (low.x, high.y)), ((low.x, high.y), (low.x, low.y))):  # fmt: skip
        length = abs(end[0] - start[0]) + abs(end[1] - start[1])
        count = max(1, int(length / (2 * dash)))
        for number in range(count):
            a, b = (number + 0.25) / count, (number + 0.75) / count
            draw.add_line(ImVec2(start[0] + a * (end[0] - start[0]), start[1] + a * (end[1] - start[1])),
                          ImVec2(start[0] + b * (end[0] - start[0]), start[1] + b * (end[1] - start[1])), colour, width)
