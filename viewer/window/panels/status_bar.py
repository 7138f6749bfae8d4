"""The status bar: columns of fixed width, so that nothing moves while figures change."""

from dataclasses import dataclass

import numpy as np
from imgui_bundle import ImVec2, imgui

from ...common.text import count_text
from ...preprocess.scan_description import ScanDescription
from ...work.measuring.measure_text import length_text
from ..kit import theme
from ..kit.theme import Theme, fitted, packed, text_in
from ..kit.widgets import begin_docked, hint
from ..session.session import Session


def drawn_text(drawn: int, total: int, *, fewer: bool) -> str:
    """How many points are drawn.  fewer: clips or hidden scans take some of them away, point by point, where nobody counts."""
    return f"{'up to ' if fewer else ''}{count_text(drawn)} of {count_text(total)}"


def coordinates_text(point: np.ndarray | None, metres_per_unit: float | None) -> str:
    """A measured point in the file's coordinates, to a millimetre where the unit is known."""
    if point is None:
        return "no measured point"
    places = 3 if not metres_per_unit else max(0, min(6, round(3 + np.log10(metres_per_unit))))
    return "  ".join(f"{value:.{places}f}" for value in point)


def units_text(meta: ScanDescription) -> str:
    """The unit of the coordinates and the coordinate reference system, as far as they are known."""
    metres = meta.metres_per_unit
    named = {1.0: "m", 0.001: "mm", 0.01: "cm", 1000.0: "km", 0.3048: "ft", 1200 / 3937: "US ft"}
    unit = next((name for value, name in named.items() if metres and abs(value / metres - 1) < 1e-7), None)
    unit = unit or (f"{metres:g} m" if metres else "degrees" if meta.in_degrees else "unit unknown")
    return f"{unit} · {meta.crs}" if meta.crs else unit


@dataclass(frozen=True)
class _Column:
    """text: what it says.  width: design units; 0: the rest.  explained: its tooltip."""

    text: str
    width: float
    explained: str
    warn: bool = False


def _columns(session: Session, fps: float | None) -> list[_Column]:
    meta = session.facts
    state, drawn = _picture(session)
    return [
        _Column(coordinates_text(session.point, meta.metres_per_unit), 270,
                "The measured point under the pointer, in the file's coordinates"),
        _Column(units_text(meta), 0, "Unit and coordinate reference system: of the file, or assigned with the Scene tool"),
        _moving(session),
        state,
        drawn,
        _Column(f"{fps:.0f} frames/s" if fps else "", 92,
                "Frames per second while the camera moves; F3 shows where the time goes"),
    ]


def _picture(session: Session) -> tuple[_Column, _Column]:
    """Whether the picture is exact, and how many points are drawn."""
    cost, approximations, reading = session.picture.cost, session.screen.approximations, session.loads.reading
    if session.picture.pending is not None or (session.screen.refining and not session.flight.moving):
        state = "refining…"
    elif session.flight.moving:
        state = "moving"
    else:
        state = "exact" if session.screen.exact and not approximations else "at rest"
    drawn, total = (0, 0) if cost is None else (cost.points_drawn, cost.facts.points_total)
    if session.shown_scan.preview and not reading.on:
        others = "are being read" if session.loads.current is not None else "were not read"
        return (_Column("preview", 176, f"A sample of the points; the others {others}.", True),
                _Column(f"{count_text(total)} of a preview" if total else "", 160, "Points of the preview"))
    more_to_come = bool(approximations) and not session.screen.exact  # else they are what the settings ask for: no warning
    rough = ", approximate" if more_to_come and state != "refining…" else ""
    text = "; ".join(approximations) if approximations else "Nothing is left out."
    if reading.on:
        state = reading.short or ("at rest" if state == "exact" else state)  # points finer than a pixel are not read
        rough, text = "" if reading.short else rough, "\n".join([reading.text, *approximations])
        total, more_to_come = max(total, reading.state.points), more_to_come or bool(reading.state.problem)
    drops = session.document.drops
    return (_Column(state + rough, 176, text, more_to_come),
            _Column(drawn_text(drawn, total, fewer=drops) if total else "", 160, "Points drawn, of all points"
                    + drops * ": those in view before clips and hidden scans take points away"))


def _moving(session: Session) -> _Column:
    """How fast the camera flies or walks; of an orthographic one how much it shows."""
    flight = session.flight
    if flight.height is not None:
        text = f"{length_text(flight.height, session.facts.metres_per_unit)} high"
        return _Column(text, 116, "Height of the orthographic picture; the wheel changes it, X for perspective")
    on_foot = "on foot, " if flight.walker is not None else ""
    return _Column(on_foot + session.speed_text, 116,
                   "Flying or walking speed; the wheel changes it, G walks on the floor or flies again")


_ORDER = (0, 3, 5, 2, 4, 1)  # what is kept first where the window is narrow


def draw_status_bar(session: Session, style: Theme, *, fps: float | None) -> None:
    """At the bottom of the window.  fps: frames per second while something moves, None at rest."""
    bar = session.area.layout.status
    if bar is None:
        return
    px = style.px
    begin_docked("status", bar, style, padding=(12, 6), scroll=False)
    imgui.push_font(style.regular, theme.SMALL)
    columns, room, kept = _columns(session, fps), bar.width - px(24), set()
    for number in _ORDER:
        needed = px(columns[number].width or 130)
        if needed <= room or not kept:
            kept.add(number)
            room -= needed
    x = bar.left + px(12)
    for number, column in enumerate(columns):
        if number not in kept:
            continue
        width = px(column.width) if column.width else px(130) + max(room, 0.0)
        imgui.set_cursor_screen_pos(ImVec2(x, bar.top + px(7)))
        text_in(theme.WARN if column.warn else theme.TEXT if number in (0, 3) else theme.DIM,
                fitted(column.text, min(width - px(14), bar.left + bar.width - x - px(8))))
        hint(column.explained, style)
        x += width
    draw = imgui.get_window_draw_list()
    draw.add_line(ImVec2(bar.left, bar.top), ImVec2(bar.left + bar.width, bar.top), packed(theme.LINE), 1.0)
    imgui.pop_font()
    imgui.end()
