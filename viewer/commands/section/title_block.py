"""The strip at the bottom of a sheet on standard paper: north arrow, scale bar, and the title block at the right.

Frame: millimetres of paper, as viewer.work.sheets.paper_layout.
"""

from dataclasses import dataclass
from typing import Any

from ...work.sheets.paper_layout import Layout
from .sheet_text import POINTS, write

INK, QUIET = "#16191d", "#6a7078"
THIN, MIDDLE, THICK = 0.18 * POINTS, 0.35 * POINTS, 0.7 * POINTS
"""Widths of lines, points (ISO 128: 0.18, 0.35 and 0.7 mm)."""
_WIDEST = 180.0
"""Of the title block (ISO 7200)."""
_SHARE = 0.66
"""Of the strip that the title block takes at most."""
_ARROW = 14.0
"""Width of the place of the north arrow."""
_LABEL, _VALUE, _TITLE = 1.7 * POINTS, 2.5 * POINTS, 4.6 * POINTS
"""Heights of fonts; capitals are 0.7 of it."""


@dataclass(frozen=True)
class Facts:
    """What the title block says, texts.  reference: system and unit.  picture: dpi, points and spacing.  notes: lines beneath
    the scale bar.  north: whether an arrow is drawn, upwards.  bar: (metres, mm on paper) of the scale bar.
    """

    title: str
    scan: str
    kind: str
    scale: str
    paper: str
    date: str
    author: str
    number: str
    reference: str
    picture: str
    notes: tuple[str, ...]
    north: bool
    bar: tuple[float, float]


def block_width(layout: Layout) -> float:
    """Of the title block, mm; the scale bar has what is left of it."""
    return min(_WIDEST, _SHARE * layout.strip[2])


def bar_room(layout: Layout) -> float:
    """The longest scale bar that has room, mm."""
    return min(80.0, layout.strip[2] - block_width(layout) - _ARROW - 12.0)


def draw_strip(page: Any, layout: Layout, facts: Facts) -> None:
    """page: matplotlib axes whose coordinates are millimetres."""
    left, bottom, width, height = layout.strip
    page.plot([left, left + width], [bottom + height] * 2, color=INK, linewidth=MIDDLE)
    block = block_width(layout)
    _title_block(page, (left + width - block, bottom, block, height), facts)
    if facts.north:
        _north(page, left + _ARROW / 2, bottom + height - 15.5)
    start = left + (_ARROW if facts.north else 5.0)
    _scale_bar(page, start, bottom + height - 10.5, *facts.bar)
    room = width - block - 7.0
    for row, note in enumerate(facts.notes):
        write(page, left + 3.5, bottom + 2.2 + 2.9 * (len(facts.notes) - 1 - row), note, _LABEL, width=room, color=QUIET)


def _title_block(page: Any, place: tuple[float, float, float, float], facts: Facts) -> None:
    left, bottom, width, height = place
    rows: tuple[tuple[float, tuple[tuple[str, str, float], ...]], ...] = (
        (0.34, (("Title", facts.title, 1.0),)),
        (0.22, (("Scan", facts.scan, 0.38), ("Kind", facts.kind, 0.62))),
        (0.22, (("Scale", facts.scale, 0.17), ("Paper", facts.paper, 0.23), ("Date", facts.date, 0.19),
                ("Author", facts.author, 0.28), ("Sheet", facts.number, 0.13))),
        (0.22, (("Reference system and unit", facts.reference, 0.52), ("Picture", facts.picture, 0.48))),
    )  # fmt: skip
    page.plot([left, left], [bottom, bottom + height], color=INK, linewidth=MIDDLE)
    top = bottom + height
    for share, cells in rows:
        tall, x = share * height, left
        for number, (label, value, part) in enumerate(cells):
            if number:
                page.plot([x, x], [top - tall, top], color=INK, linewidth=THIN)
            wide = part * width
            write(page, x + 1.4, top - 2.5, label, _LABEL, width=wide - 2, color=QUIET)
            big = label == "Title"
            write(page, x + 1.4, top - tall + (2.8 if big else 1.8), value, _TITLE if big else _VALUE, width=wide - 2.8,
                  bold=label in ("Title", "Scale"), color=INK)  # fmt: skip
            x += wide
        top -= tall
        if top > bottom + 0.1:
            page.plot([left, left + width], [top, top], color=INK, linewidth=THIN)


def _north(page: Any, x: float, y: float) -> None:
    from matplotlib.patches import Polygon

    for side, fill in ((2.6, INK), (-2.6, "white")):
        half = [(x, y + 9.0), (x + side, y), (x, y + 1.9)]
        page.add_patch(Polygon(half, closed=True, facecolor=fill, edgecolor=INK, linewidth=THIN))
    write(page, x, y + 10.2, "N", 3.2 * POINTS, bold=True, color=INK, ha="center")


def _scale_bar(page: Any, x: float, y: float, metres: float, length: float) -> None:
    from matplotlib.patches import Rectangle

    for part in range(4):
        page.add_patch(Rectangle((x + part * length / 4, y), length / 4, 1.6, facecolor=INK if part % 2 == 0 else "white",
                                 edgecolor=INK, linewidth=THIN))  # fmt: skip
    for share in (0.0, 0.5, 1.0):
        text = f"{metres * share:g}{' m' if share == 1.0 else ''}"
        write(page, x + share * length, y + 2.6, text, _LABEL * 1.15, color=INK, ha="center")
