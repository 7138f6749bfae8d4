"""Dimensions on a sheet: measured lengths that lie in its cut, with extension lines, ticks and texts, moved off each other.

Frame: paper coordinates of the cut, file units, which the caller places on its page.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...common.text import printable
from ...work.dimensioning.dimensions import Dimension, dimensions_of, laid_apart
from ...work.measuring.measure_text import unit_name
from ...work.measuring.measurement import Measurement
from .cut import Cut
from .sheet_text import POINTS, text_width

if TYPE_CHECKING:
    from ...grid.scene import Scene

LETTERS = 1.9
"""Height of a text, millimetres of paper."""
_LEAST = 2.0
"""Millimetres of paper: shorter ways are not seen as one."""
_COLOUR, _WIDTH = "#12489c", 0.18 * POINTS
"""sRGB, dark enough for white paper, unlike traced lines; width of lines, points (ISO 128)."""
_BESIDE, _TICK = 0.35, 0.35
"""Gap and overshoot of extension lines, and half a tick along each axis, in heights of the text."""


def cut_dimensions(cut: Cut, measurements: Sequence[Measurement], scene: "Scene", millimetre: float) -> list[Dimension]:
    """The measured lengths that lie in a cut.  millimetre: of paper, file units."""
    plane = np.array([0.0, 0.0, cut.near if cut.kind == "elevation" and np.isfinite(cut.near) else 0.0])
    return dimensions_of(measurements, lambda xyz: cut.paper(xyz) - plane, lambda paper: cut.contains(paper + plane),
                         unit_name(scene.meta.metres_per_unit), _LEAST * millimetre)


def draw_dimensions(page: Any, dimensions: Sequence[Dimension], millimetre: float, area: np.ndarray, *,
                    placed=lambda paper: paper, edge: Any = None) -> None:
    """Draws into matplotlib axes.

    millimetre: of paper, file units.  area: (2, 2) lower left and upper right corner of the drawing, paper coordinates.
    placed: coordinates of the axes of (n, 2) paper coordinates.  edge: a patch that cuts lines.
    """
    height = LETTERS * millimetre
    for each in laid_apart(dimensions, height, lambda text: text_width(text, LETTERS * POINTS) * millimetre, area):
        ends, line = np.array([each.start, each.end]), each.line
        way = (line[0] - ends[0]) / abs(each.offset)
        turn = np.radians(each.angle)
        tick = _TICK * height * np.array([np.cos(turn + np.pi / 4), np.sin(turn + np.pi / 4)]) * np.sqrt(2.0)
        strokes = [line, *(np.array([at - tick, at + tick]) for at in line)]
        strokes += [np.array([end + way * _BESIDE * height, at + way * _BESIDE * height])
                    for end, at in zip(ends, line, strict=True)]
        for stroke in strokes:
            for drawn in page.plot(*placed(stroke).T, color=_COLOUR, linewidth=_WIDTH, solid_capstyle="butt"):
                if edge is not None:
                    drawn.set_clip_path(edge)
        middle = line.mean(axis=0) + height * np.array([-np.sin(turn), np.cos(turn)])
        x, y = placed(middle[None])[0]
        page.text(x, y, printable(each.told), fontsize=LETTERS * POINTS, color=_COLOUR, rotation=each.angle, ha="center",
                  va="center", rotation_mode="anchor", parse_math=False, zorder=4,
                  bbox={"facecolor": "white", "alpha": 0.8, "edgecolor": "none", "pad": 0.6})
