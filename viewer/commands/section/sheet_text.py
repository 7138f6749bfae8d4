"""Text on sheets: as wide as its place, never taken for formulas, free of control characters."""

from functools import lru_cache
from typing import Any

from ...common.fonts import families, in_order, needs_shape
from ...common.text import printable

POINTS = 72 / 25.4
"""Typographic points of a millimetre."""
_SMALLEST = 0.7
"""Share of its size to which a text is reduced before its end is left out."""


@lru_cache(maxsize=1024)
def text_width(text: str, size: float, bold: bool = False) -> float:
    """Millimetres that a line of text takes.  size: of the font, points."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextPath

    if not any(map(needs_shape, text)):
        return 0.0
    plain = text.replace("$", "S")  # which begins a formula, and is as wide
    font = FontProperties(family=families(text), weight="bold" if bold else "normal")
    path = TextPath((0, 0), plain, size=size, prop=font, usetex=False)
    return float(path.get_extents().x1) / POINTS


def fitting(text: str, width: float, size: float, bold: bool = False) -> tuple[str, float]:
    """The text and the size at which it is at most ``width`` mm wide: reduced to 70 %, then cut off with an ellipsis."""
    text = printable(" ".join(text.split()))
    wide = text_width(text, size, bold)
    if wide <= width:
        return text, size
    size *= max(_SMALLEST, width / wide)
    if wide * _SMALLEST <= width:
        return text, size
    fits, too_long = 0, len(text)
    while too_long - fits > 1:
        middle = (fits + too_long) // 2
        if text_width(text[:middle].rstrip() + "…", size, bold) <= width:
            fits = middle
        else:
            too_long = middle
    return text[:fits].rstrip() + "…", size


def write(page: Any, x: float, y: float, text: str, size: float, *, width: float = float("inf"), bold: bool = False,
          **looks: Any) -> None:  # fmt: skip
    """Puts a line of text on a matplotlib axes in millimetres.  size: of the font, points.  width: of its place, mm."""
    text, size = fitting(text, width, size, bold)
    page.text(x, y, in_order(text), fontsize=size, fontweight="bold" if bold else "normal", parse_math=False,
              fontfamily=families(text), **looks)
