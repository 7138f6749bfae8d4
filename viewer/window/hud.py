"""What is laid over the picture: what it is and what it cost, the handle of a comparison, passing messages."""

from imgui_bundle import ImVec2, imgui

from viewer.readers.formats import KNOWN_FILES, KNOWN_FOLDERS
from viewer.text import counted
from viewer.window import theme
from viewer.window.session import Session
from viewer.window.theme import Theme, fitted, packed, text_in

OVERLAY = (
    imgui.WindowFlags_.no_decoration
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.no_nav
)
PASSIVE = OVERLAY | imgui.WindowFlags_.always_auto_resize | imgui.WindowFlags_.no_inputs
MARGIN = 14.0
_TITLE_WIDTH = 258.0  # as wide as the figures beneath it


def count_text(number: int) -> str:
    """A count a person takes in at a glance: 950, 12.3 k, 1.04 M, 2.10 G."""
    for unit, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if number >= size:
            return f"{number / size:.3g} {unit}" if number / size >= 100 else f"{number / size:#.3g} {unit}"
    return str(number)


def _panel_alone(session: Session, look: Theme) -> bool:
    """Whether the panel is open where the window has no room for anything beside it."""
    return session.panel and session.scene is not None and imgui.get_io().display_size.x < look.px(theme.NARROW)


def draw_hud(session: Session, look: Theme, *, fps: float | None) -> None:
    """Top left.  fps: frames a second while something moves, None at rest."""
    stats, px = session.picture.stats, look.px
    if session.scene is None or stats is None or _panel_alone(session, look):
        return
    imgui.set_next_window_pos(ImVec2(px(MARGIN), px(MARGIN)))
    imgui.set_next_window_bg_alpha(0.9)
    imgui.begin("hud", None, PASSIVE)
    imgui.push_font(look.bold, theme.FONT_SIZE)
    imgui.text_unformatted(fitted(session.title, px(_TITLE_WIDTH)))
    imgui.pop_font()
    total = sum(stats["stages"].values()) if stats["stages"] else stats["total_ms"]
    rate = "at rest" if fps is None else f"{fps:.1f} fps" if fps < 10 else f"{fps:.0f} fps"
    imgui.push_font(look.regular, theme.SMALL)
    flags = imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.no_pad_outer_x
    bar = px(76)
    if imgui.begin_table("stages", 3, flags):
        imgui.table_setup_column("", 0, px(84))
        imgui.table_setup_column("", 0, bar)
        imgui.table_setup_column("", 0, px(74))
        for name, milliseconds in stats["stages"].items():
            imgui.table_next_row()
            imgui.table_next_column()
            text_in(theme.DIM, name)
            imgui.table_next_column()
            at, height = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
            width = max(bar * milliseconds / max(total, 1e-9), 1.0)
            top, bottom = at.y + 0.3 * height, at.y + 0.75 * height
            imgui.get_window_draw_list().add_rect_filled(
                ImVec2(at.x, top), ImVec2(at.x + width, bottom), packed(theme.ACCENT, 0.85), px(2)
            )
            imgui.table_next_column()
            _right(f"{milliseconds:.1f} ms")
        imgui.table_next_row()
        imgui.table_next_column()
        text_in(theme.DIM, "all")
        imgui.table_next_column()
        imgui.text_unformatted(rate)
        imgui.table_next_column()
        _right(f"{total:.1f} ms")
        imgui.end_table()
    imgui.dummy(ImVec2(0, px(1)))
    rows = [
        ("points", f"{count_text(stats['points_drawn'])} of {count_text(stats['points_total'])}"),
        ("raster", f"{stats['raster']} on {_short(stats['opengl'])}"),
        ("size", f"{session.size[0]} × {session.size[1]}"),
        ("speed", session.speed_text),
    ]
    if stats["network"]:
        rows.insert(2, ("network", stats["network"].split(" ")[0]))
        rows.insert(3, ("device", f"{stats['device']}, {stats['bridge']}"))
    if imgui.begin_table("facts", 2, flags):
        imgui.table_setup_column("", 0, px(84))
        for name, value in rows:
            imgui.table_next_row()
            imgui.table_next_column()
            text_in(theme.DIM, name)
            imgui.table_next_column()
            imgui.text_unformatted(value)
        for number, text in enumerate(session.approximations or ["none"]):
            imgui.table_next_row()
            imgui.table_next_column()
            text_in(theme.DIM, "approximate" if number == 0 else "")
            imgui.table_next_column()
            text_in(theme.TEXT if text == "none" else theme.WARN, text)
        imgui.end_table()
    imgui.pop_font()
    imgui.end()


def _right(text: str) -> None:
    """Text that ends where its column ends, so that figures line up."""
    space = imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
    imgui.set_cursor_pos_x(imgui.get_cursor_pos_x() + max(space, 0.0))
    imgui.text_unformatted(text)


def _short(renderer: str) -> str:
    """A GPU's name without the driver's small print."""
    return renderer.split(" (")[0].split("/")[0]


def draw_handle(session: Session, look: Theme, *, hovered: bool) -> None:
    """The line between two views, its grip, and what is on either side."""
    if not session.view_settings.split or session.scene is None:
        return
    px, draw, size = look.px, imgui.get_background_draw_list(), imgui.get_io().display_size
    x, middle = round(session.view_settings.split_at * size.x), size.y / 2
    active = hovered or session.dragging_handle
    line = theme.ACCENT if active else theme.TEXT
    draw.add_rect_filled(ImVec2(x - px(2), 0), ImVec2(x + px(2), size.y), packed(theme.PANEL, 0.45))
    draw.add_rect_filled(ImVec2(x - px(1), 0), ImVec2(x + px(1), size.y), packed(line))
    draw.add_circle_filled(ImVec2(x, middle), px(15), packed(theme.PANEL, 0.95), 32)
    draw.add_circle(ImVec2(x, middle), px(15), packed(line), 32, px(2))
    for side in (-1, 1):
        tip, wing = x + side * px(9), x + side * px(4)
        draw.add_triangle_filled(
            ImVec2(tip, middle), ImVec2(wing, middle - side * px(5)), ImVec2(wing, middle + side * px(5)), packed(line)
        )
    for view, side in zip(session.drawn, (-1, 1)):
        text = imgui.calc_text_size(view)
        pad, gap = ImVec2(px(10), px(5)), px(14)
        left = x - gap - text.x - 2 * pad.x if side < 0 else x + gap
        top = size.y - px(MARGIN) - text.y - 2 * pad.y
        corner = ImVec2(left + text.x + 2 * pad.x, top + text.y + 2 * pad.y)
        draw.add_rect_filled(ImVec2(left, top), corner, packed(theme.PANEL), px(5))
        draw.add_text(ImVec2(left + pad.x, top + pad.y), packed(theme.TEXT), view)


def draw_toasts(session: Session, look: Theme) -> None:
    """Bottom centre, the latest lowest; above the labels of a comparison."""
    size, px = imgui.get_io().display_size, look.px
    bottom = size.y - px(MARGIN + 46)
    lines = [toast.text for toast in session.notices.toasts]
    if session.view_settings.network_load is not None:
        lines.append("Loading the network…")
    for number, text in enumerate(reversed(lines)):
        imgui.set_next_window_pos(ImVec2(size.x / 2, bottom), 0, ImVec2(0.5, 1.0))
        imgui.begin(f"toast{number}", None, PASSIVE)
        imgui.push_text_wrap_pos(min(px(640), 0.8 * size.x))
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        bottom -= imgui.get_window_height() + px(8)
        imgui.end()


def draw_recording(session: Session, look: Theme) -> None:
    """A red dot and the number of frames, top centre or where the figures have made room, while frame times are recorded."""
    if session.recording is None:
        return
    size, px = imgui.get_io().display_size, look.px
    at_left = _panel_alone(session, look)
    place = ImVec2(px(MARGIN) if at_left else size.x / 2, px(MARGIN))
    imgui.set_next_window_pos(place, 0, ImVec2(0.0 if at_left else 0.5, 0.0))
    imgui.begin("recording", None, PASSIVE)
    at, line = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
    imgui.get_window_draw_list().add_circle_filled(
        ImVec2(at.x + px(6), at.y + line / 2), px(5), imgui.get_color_u32((0.93, 0.33, 0.31, 1.0)), 24
    )
    imgui.dummy(ImVec2(px(14), line))
    imgui.same_line()
    frames = counted(len(session.recording), "frame")
    imgui.text_unformatted(frames if at_left else f"{frames} · F9 stops")
    imgui.end()


def draw_start(session: Session, look: Theme) -> None:
    """The empty start page."""
    if session.scene is not None or session.loads.current is not None:
        return
    size, px, draw = imgui.get_io().display_size, look.px, imgui.get_background_draw_list()
    half = ImVec2(min(px(260), 0.42 * size.x), min(px(110), 0.36 * size.y))
    centre = ImVec2(size.x / 2, size.y / 2)
    draw.add_rect(
        ImVec2(centre.x - half.x, centre.y - half.y), ImVec2(centre.x + half.x, centre.y + half.y),
        packed(theme.LINE), px(12), px(2),
    )  # fmt: skip
    explained = (KNOWN_FILES, f"{KNOWN_FOLDERS} folders; several make one scene")
    lines = (
        ("Drop a scan here", look.bold, theme.TITLE + 4, theme.TEXT, -54),
        *(
            (text, look.regular, theme.FONT_SIZE, theme.DIM, 28 * number - 12)
            for number, text in enumerate((*explained, "F1 shows the controls"))
        ),
    )
    for text, font, height, colour, offset in lines:
        imgui.push_font(font, height)
        width = imgui.calc_text_size(text).x
        draw.add_text(ImVec2(centre.x - width / 2, centre.y + px(offset)), packed(colour), text)
        imgui.pop_font()
