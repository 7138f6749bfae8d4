"""Dimensions on a sheet: measured lengths that lie in its cut, with extension lines, ticks and texts, moved off each other;
and what is written of measured areas and whole polylines.

Frame: paper coordinates of the cut, file units, which the caller places on its page.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...common.text import counted, printable
from ...work.dimensioning.dimensions import CutDimensions, dimensions_of, laid_apart
from ...work.measuring.measurement import Measurement
from .cut import Cut
from .sheet_text import POINTS, text_width

LETTERS = 1.9
"""Height of a text, millimetres of paper."""
_LEAST = 2.0
"""Millimetres of paper: shorter ways are not seen as one."""
_COLOUR, _WIDTH = "#12489c", 0.18 * POINTS
"""sRGB, dark enough for white paper, unlike traced lines; width of lines, points (ISO 128)."""
_BESIDE, _TICK = 0.35, 0.35
"""Gap and overshoot of extension lines, and half a tick along each axis, in heights of the text."""


def cut_dimensions(cut: Cut, measurements: Sequence[Measurement], unit: str, millimetre: float) -> CutDimensions:
    """What was measured in a cut.  unit: its name on the drawing.  millimetre: of paper, file units."""
    plane = np.array([0.0, 0.0, cut.near if cut.kind == "elevation" and np.isfinite(cut.near) else 0.0])
    return dimensions_of(measurements, lambda xyz: cut.paper(xyz) - plane, lambda paper: cut.contains(paper + plane),
                         unit, _LEAST * millimetre)


def short_text(dimensions: CutDimensions) -> list[str]:
    """A line about lengths in the cut that have no dimension; none where all have one."""
    return [f"{counted(dimensions.short, 'measured length')} without a dimension: shorter than {_LEAST:g} mm on paper, or seen "
            "from the end"] if dimensions.short else []  # fmt: skip


def draw_dimensions(page: Any, dimensions: CutDimensions, millimetre: float, area: np.ndarray, *,
                    placed=lambda paper: paper, edge: Any = None) -> None:
    """Draws into matplotlib axes.

    millimetre: of paper, file units.  area: (2, 2) lower left and upper right corner of the drawing, paper coordinates.
    placed: coordinates of the axes of (n, 2) paper coordinates.  edge: a patch that cuts lines.
    """
    height = LETTERS * millimetre

    def write(place: np.ndarray, text: str, angle: float) -> None:
        x, y = placed(place[None])[0]
        page.text(x, y, printable(text), fontsize=LETTERS * POINTS, color=_COLOUR, rotation=angle, ha="center", va="center",
                  rotation_mode="anchor", parse_math=False, zorder=4,
                  bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.6})

    def stroke(line: np.ndarray) -> None:
        for drawn in page.plot(*placed(line).T, color=_COLOUR, linewidth=_WIDTH, solid_capstyle="butt"):
            if edge is not None:
                drawn.set_clip_path(edge)

    def width(text: str) -> float:
        return text_width(text, LETTERS * POINTS) * millimetre

    for each_text in dimensions.texts:
        if each_text.outline is not None:
            stroke(np.concatenate([each_text.outline, each_text.outline[:1]]))
        for middle, line in zip(each_text.middles(height, width, area), each_text.lines, strict=True):
            write(middle, line, 0.0)
    for each in laid_apart(dimensions.lines, height, width, area, dimensions.texts):
        ends, line = np.array([each.start, each.end]), each.line
        way = (line[0] - ends[0]) / abs(each.offset)
        turn = np.radians(each.angle)
        tick = _TICK * height * np.array([np.cos(turn + np.pi / 4), np.sin(turn + np.pi / 4)]) * np.sqrt(2.0)
        strokes = [line, *(np.array([at - tick, at + tick]) for at in line)]
        strokes += [np.array([end + way * _BESIDE * height, at + way * _BESIDE * height])
                    for end, at in zip(ends, line, strict=True)]
        for each_stroke in strokes:
            stroke(each_stroke)
        write(line.mean(axis=0) + height * np.array([-np.sin(turn), np.cos(turn)]), each.told, each.angle)
