"""What lies over the picture: the profiler, the handle of a comparison, the arrow back to the scene, passing messages."""

import numpy as np
from imgui_bundle import ImVec2, imgui

from ...common.text import counted
from ...picture.drawn_lines import Area
from ...picture.views import VIEWS
from ...work.measuring.measure_text import length_text
from ...work.pictures.picture_scale_bar import LONGEST, bar_length
from ..kit import theme
from ..kit.theme import Theme, fitted, packed, text_in
from ..kit.widgets import FLOATING, MARGIN, PASSIVE
from ..session.panel_actions import Actions
from ..session.session import Session
from ..viewport.photo_blend import strength
from .status_bar import drawn_text
from .tool_bar import WIDTH

_TITLE_WIDTH = 258.0  # as wide as the figures beneath it
_TOAST_ROOM = 400.0
"""Design units beside a legend, below which messages lie above it."""
_LOST_BOX = 112.0, 44.0
"""Half the width and height of the box that says how to get back, design units."""


def draw_profiler(session: Session, style: Theme, *, fps: float | None) -> None:
    """Top left of the picture (F3).  fps: frames per second while something moves, None at rest."""
    cost, px, area = session.picture.cost, style.px, session.area.layout.picture
    if session.scene is None or cost is None or not session.profiler:
        return
    imgui.set_next_window_pos(ImVec2(area.left + px(WIDTH + MARGIN), area.top + px(52)))
    imgui.begin("profiler", None, PASSIVE)
    imgui.push_font(style.bold, theme.FONT_SIZE)
    imgui.text_unformatted(fitted(session.shown_scan.title, px(_TITLE_WIDTH)))
    imgui.pop_font()
    total = sum(cost.stages.values()) if cost.stages else cost.total_ms
    rate = "at rest" if fps is None else f"{fps:.1f} fps" if fps < 10 else f"{fps:.0f} fps"
    imgui.push_font(style.regular, theme.SMALL)
    flags = imgui.TableFlags_.sizing_fixed_fit | imgui.TableFlags_.no_pad_outer_x
    bar = px(76)
    if imgui.begin_table("stages", 3, flags):
        imgui.table_setup_column("", 0, px(84))
        imgui.table_setup_column("", 0, bar)
        imgui.table_setup_column("", 0, px(74))
        for name, milliseconds in cost.stages.items():
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
    facts = cost.facts
    rows = [
        ("points", drawn_text(cost.points_drawn, facts.points_total, fewer=session.document.drops)),
        ("raster", f"{facts.raster} on {_short(facts.opengl)}"),
        ("size", f"{session.area.size[0]} × {session.area.size[1]}"),
        ("speed", session.speed_text),
    ]
    if facts.network:
        rows.insert(2, ("network", facts.network.split(" ")[0]))
        rows.insert(3, ("device", f"{facts.device}, {facts.bridge}"))
    if imgui.begin_table("facts", 2, flags):
        imgui.table_setup_column("", 0, px(84))
        for name, value in rows:
            imgui.table_next_row()
            imgui.table_next_column()
            text_in(theme.DIM, name)
            imgui.table_next_column()
            imgui.text_unformatted(value)
        for number, text in enumerate(session.screen.approximations or ["none"]):
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


def draw_handle(session: Session, style: Theme, *, hovered: bool) -> None:
    """The line between two views, its grip, and the names of the two."""
    if not session.view_settings.split or session.scene is None:
        return
    px, draw, area = style.px, imgui.get_background_draw_list(), session.area.layout.picture
    top, bottom = area.top, area.top + area.height
    x, middle = area.left + round(session.view_settings.split_at * area.width), (top + bottom) / 2
    active = hovered or session.dragging_handle
    line = theme.ACCENT if active else theme.TEXT
    draw.add_rect_filled(ImVec2(x - px(2), top), ImVec2(x + px(2), bottom), packed(theme.PANEL, 0.45))
    draw.add_rect_filled(ImVec2(x - px(1), top), ImVec2(x + px(1), bottom), packed(line))
    draw.add_circle_filled(ImVec2(x, middle), px(15), packed(theme.PANEL, 0.95), 32)
    draw.add_circle(ImVec2(x, middle), px(15), packed(line), 32, px(2))
    for side in (-1, 1):
        tip, wing = x + side * px(9), x + side * px(4)
        draw.add_triangle_filled(
            ImVec2(tip, middle), ImVec2(wing, middle - side * px(5)), ImVec2(wing, middle + side * px(5)), packed(line)
        )
    names = ("", "") if session.work.dates is None else session.work.dates.names
    for name, view, side in zip(names, session.screen.drawn, (-1, 1)):
        title = f"{name}, {VIEWS[view].title.lower()}" if name else VIEWS[view].title
        text = imgui.calc_text_size(title)
        pad, gap = ImVec2(px(10), px(5)), px(14)
        left = x - gap - text.x - 2 * pad.x if side < 0 else x + gap
        high = bottom - px(MARGIN) - text.y - 2 * pad.y
        corner = ImVec2(left + text.x + 2 * pad.x, high + text.y + 2 * pad.y)
        draw.add_rect_filled(ImVec2(left, high), corner, packed(theme.PANEL), px(5))
        draw.add_text(ImVec2(left + pad.x, high + pad.y), packed(theme.TEXT), title)


def draw_scale_bar(session: Session, style: Theme) -> None:
    """Bottom right of the picture, where it is orthographic: a round length in the scene's unit."""
    height, area, px = session.flight.height, session.area.layout.uncovered, style.px
    if height is None or session.scene is None:
        return
    unit = height / max(session.area.layout.picture.height, 1.0)  # file units an interface pixel
    length = bar_length(unit * px(LONGEST))
    wide, label = length / unit, length_text(length, session.facts.metres_per_unit)
    text = imgui.calc_text_size(label)
    left, bottom = area.right - px(MARGIN + 20) - max(wide, text.x), area.top + area.height - px(MARGIN)
    top = bottom - text.y - px(20)
    draw = imgui.get_background_draw_list()
    draw.add_rect_filled(ImVec2(left, top), ImVec2(left + max(wide, text.x) + px(20), bottom), packed(theme.PANEL, 0.92), px(5))
    start, line = left + px(10), bottom - px(9)
    draw.add_text(ImVec2(start, top + px(4)), packed(theme.TEXT), label)
    for x in (start, start + wide):
        draw.add_line(ImVec2(x, line - px(4)), ImVec2(x, line + px(1)), packed(theme.TEXT), px(1.5))
    draw.add_line(ImVec2(start, line), ImVec2(start + wide, line), packed(theme.TEXT), px(1.5))


def draw_toasts(session: Session, style: Theme, legend: Area | None = None) -> None:
    """Bottom centre of the picture, the latest lowest; above the labels of a comparison.  legend: left, top, width and height
    of it, which no message covers: they lie to the right of it, or above it where there is little room."""
    area, px = session.area.layout.picture, style.px
    bottom, left = area.top + area.height - px(MARGIN + 46), area.left
    if legend is not None:
        beside = legend[0] + legend[2]
        if area.right - beside >= px(_TOAST_ROOM):
            left = beside
        else:
            bottom = min(bottom, legend[1] - px(8))
    width = area.right - left
    lines = [toast.text for toast in session.notices.toasts]
    if session.view_settings.network_load is not None:
        lines.append("Loading the network…")
    for number, text in enumerate(reversed(lines)):
        imgui.set_next_window_pos(ImVec2(left + width / 2, bottom), 0, ImVec2(0.5, 1.0))
        imgui.set_next_window_bg_alpha(1.0)  # over labels
        imgui.begin(f"toast{number}", None, PASSIVE)
        imgui.push_text_wrap_pos(min(px(640), 0.8 * width))
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        bottom -= imgui.get_window_height() + px(8)
        imgui.end()


def draw_recording(session: Session, style: Theme) -> None:
    """A red dot and the number of frames, below the view switch, while frame times are recorded."""
    if session.recording is None:
        return
    area, px = session.area.layout.picture, style.px
    imgui.set_next_window_pos(ImVec2(area.left + area.width / 2, area.top + px(56)), 0, ImVec2(0.5, 0.0))
    imgui.begin("recording", None, PASSIVE)
    at, line = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
    imgui.get_window_draw_list().add_circle_filled(ImVec2(at.x + px(6), at.y + line / 2), px(5), packed(theme.BAD), 24)
    imgui.dummy(ImVec2(px(14), line))
    imgui.same_line()
    imgui.text_unformatted(f"{counted(len(session.recording), 'frame')} · F9 stops")
    imgui.end()


def _photograph_shows(session: Session) -> bool:
    """Whether a photograph lies over the view: it may show where no point lies."""
    shown = session.work.photo
    if shown is None:
        return False
    away = float(np.linalg.norm(session.camera.position - shown.photo.position))
    return strength(away, session.facts.metres_per_unit, shown.blend) > 0


def draw_lost(session: Session, actions: Actions, style: Theme) -> None:
    """Where the picture shows nothing, and no photograph lies over it: how to get back, and an arrow to the scene."""
    if not session.lost or session.scene is None or _photograph_shows(session):
        return
    px, area, draw = style.px, session.area.layout.picture, imgui.get_background_draw_list()
    middle = np.array([area.left + area.width / 2, area.top + area.height / 2])
    along = session.flight.direction_to_middle(session.camera)
    half = np.array([px(_LOST_BOX[0]), px(_LOST_BOX[1])])
    edge = float((half / np.maximum(np.abs(along), 1e-9)).min()) + px(14)  # where a ray leaves the box of buttons, and a gap
    start, tip = middle + along * edge, middle + along * (edge + px(44))
    side = np.array([-along[1], along[0]]) * px(9)
    base = tip - along * px(16)
    for colour, width in ((theme.SHADE, px(7)), (theme.ACCENT, px(4))):
        draw.add_line(ImVec2(*start), ImVec2(*base), packed(colour), width)
    draw.add_triangle_filled(ImVec2(*tip), ImVec2(*(base + side)), ImVec2(*(base - side)), packed(theme.ACCENT))
    imgui.set_next_window_pos(ImVec2(*middle), 0, ImVec2(0.5, 0.5))
    imgui.begin("lost", None, FLOATING)
    imgui.text_unformatted("Nothing in sight: Home, F")  # the keys of the two buttons
    if imgui.button("Home"):
        actions.do("home")
    imgui.same_line()
    if imgui.button("Whole scene"):
        actions.do("frame")
    imgui.end()
