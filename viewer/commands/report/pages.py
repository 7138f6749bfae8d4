"""Pages of standard paper that fill from top to bottom: headings, text that is wrapped, pictures, rows of a table.

Frame: millimetres from the lower left corner of an A4 page, upright.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import __version__
from ...common.fonts import families, in_order
from ...common.text import printable
from ...common.text_line import TextLine
from ..section.sheet_text import POINTS, fitting, write

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE = (210.0, 297.0)
"""Width and height of A4."""
MARGIN, FOOT = 18.0, 16.0
"""At the sides and the top; at the bottom, which has the number of the page."""
WIDTH = PAGE[0] - 2 * MARGIN
DPI = 170
"""Pixels an inch at which pictures are drawn: viewer.commands.report.view_pictures.SIZE as wide as the text."""
_MM = 25.4
_MOST_A_LINE = 1000
"""Letters of a line, at most: of the narrowest, at the smallest size."""
_INK, _QUIET, _LINE = "#16191d", "#6a7078", "#c9cdd3"
_BOLDER = 1.15
"""Width of bold letters, times that of others."""
_MEASURED = 64
"""Pixels of the font by which lines are measured."""
_LEADING = 1.45
"""Of a line of text, times its size."""


def line_width(text: str, size: float) -> float:
    """Millimetres of a line of text.  size: of the font, points.  By the fonts' own widths, fast for long texts."""
    return TextLine(text, _MEASURED).width / _MEASURED * size / POINTS


def wrapped(text: str, width: float, size: float) -> list[str]:
    """Lines of at most ``width`` mm: broken at line ends and between words, inside a word that is too long.  size: points."""
    lines: list[str] = []
    for paragraph in text.splitlines() or [""]:
        line = ""
        for word in printable(paragraph.expandtabs(4)).split():
            longer = f"{line} {word}" if line else word
            if line_width(longer, size) <= width:
                line = longer
                continue
            if line:
                lines.append(line)
            while line_width(word[:_MOST_A_LINE], size) > width:
                cut = _fitting_letters(word, width, size)
                lines.append(word[:cut])
                word = word[cut:]
            line = word
        lines.append(line)
    return lines


def _fitting_letters(word: str, width: float, size: float) -> int:
    """How many letters of a word that is too wide fit, at least one."""
    fits, too_many = 1, min(len(word), _MOST_A_LINE)
    while too_many - fits > 1:
        middle = (fits + too_many) // 2
        fits, too_many = (middle, too_many) if line_width(word[:middle], size) <= width else (fits, middle)
    return fits


class Pages:
    """Fills pages; each is a matplotlib figure.  foot: a line at the bottom of each."""

    def __init__(self, foot: str):
        self.figures: list[Figure] = []
        self._foot = foot
        self._y = 0.0
        self._page: Any = None
        self.new_page()

    def new_page(self) -> None:
        """Goes on at the top of a new page."""
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        figure = Figure(figsize=(PAGE[0] / _MM, PAGE[1] / _MM), dpi=DPI, facecolor="white")
        FigureCanvasAgg(figure)
        self._page = figure.add_axes((0, 0, 1, 1), frameon=False, zorder=2)
        self._page.set(xlim=(0, PAGE[0]), ylim=(0, PAGE[1]), xticks=[], yticks=[], autoscale_on=False)
        self.figures.append(figure)
        self._y = PAGE[1] - MARGIN

    def room(self, height: float) -> None:
        """Begins a new page where less than ``height`` mm are left."""
        if self._y - height < FOOT and self._y < PAGE[1] - MARGIN:
            self.new_page()

    def gap(self, height: float) -> None:
        """Leaves ``height`` mm free."""
        self._y -= height

    def heading(self, text: str, size: float = 13.0, *, follows: float = 30.0) -> None:
        """A heading, on the page on which ``follows`` mm after it have room."""
        tall = size / POINTS * _LEADING
        self.room(tall + follows)
        self._y -= tall
        write(self._page, MARGIN, self._y + 0.3 * size / POINTS, text, size, width=WIDTH, bold=True, color=_INK)

    def text(self, text: str, size: float = 9.5, *, quiet: bool = False) -> None:
        """Text over the whole width."""
        for line in wrapped(text, WIDTH, size):
            self.line([(0.0, line)], size, quiet=quiet, prose=True)

    def line(self, cells: Sequence[tuple[float, str]], size: float = 9.5, *, quiet: bool = False, bold: bool = False,
             mark: tuple[int, int, int] | None = None, right: str = "", prose: bool = False) -> None:  # fmt: skip
        """One line of texts, each at its distance in mm from the margin and cut off before the next.  mark: colour, sRGB, of
        a square before the first.  right: a text that ends at the right margin.  prose: whether a
        script from right to left decides the order of the whole line."""
        tall = size / POINTS * _LEADING
        self.room(tall)
        self._y -= tall
        base = self._y + 0.3 * size / POINTS
        ends = [*(begin for begin, _ in cells[1:]), WIDTH + 2.0 - (line_width(right, size) * _BOLDER + 4.0 if right else 0.0)]
        if right:
            self._page.text(PAGE[0] - MARGIN, base, printable(right), fontsize=size, color=_INK, parse_math=False, ha="right",
                            fontfamily=families(right), fontweight="bold" if bold else "normal")
        for (begin, text), end in zip(cells, ends, strict=True):
            short, fits = fitting(text, end - begin - 2.0, size, bold)
            self._page.text(MARGIN + begin, base, short if prose else in_order(short), fontsize=fits, parse_math=False,
                            color=_QUIET if quiet else _INK, fontfamily=families(short),
                            fontweight="bold" if bold else "normal")
        if mark is not None:
            from matplotlib.patches import Rectangle

            side = 0.75 * size / POINTS
            self._page.add_patch(Rectangle((MARGIN, base - 0.05 * side), side, side, linewidth=0,
                                           facecolor=tuple(part / 255 for part in mark)))

    def rule(self) -> None:
        """A thin line over the whole width."""
        self._y -= 1.5
        self._page.plot([MARGIN, PAGE[0] - MARGIN], [self._y, self._y], color=_LINE, linewidth=0.6)
        self._y -= 1.5

    def pictures(self, pictures: Sequence[tuple[np.ndarray, float]]) -> None:
        """Pictures, (H, W, 3) uint8, side by side with 4 mm between them, each with its width in mm."""
        heights = [width * image.shape[0] / image.shape[1] for image, width in pictures]
        tall = max(heights)
        self.room(tall + 2.0)
        left, top = MARGIN, self._y - 1.0
        for (image, width), height in zip(pictures, heights, strict=True):
            axes = self.figures[-1].add_axes((left / PAGE[0], (top - height) / PAGE[1], width / PAGE[0], height / PAGE[1]),
                                             frameon=False, zorder=1)
            axes.imshow(image, interpolation="none", aspect="auto")
            axes.set(xticks=[], yticks=[])
            left += width + 4.0
        self._y = top - tall - 1.0

    def diagram(self, height: float, below: float) -> Any:
        """Axes of matplotlib over most of the width.  height: mm, of these ``below`` for the texts under them."""
        self.room(height)
        self._y -= height
        beside = 14.0  # numbers and name of the upright axis
        return self.figures[-1].add_axes(((MARGIN + beside) / PAGE[0], (self._y + below) / PAGE[1], (WIDTH - beside) / PAGE[0],
                                          (height - below) / PAGE[1]), zorder=3)  # fmt: skip

    def finished(self) -> list["Figure"]:
        """All pages, with their foot lines."""
        for number, figure in enumerate(self.figures, 1):
            page = figure.axes[0]
            write(page, MARGIN, 9.0, self._foot, 7, width=WIDTH - 30, color=_QUIET)
            write(page, PAGE[0] - MARGIN, 9.0, f"{number} of {len(self.figures)}", 7, color=_QUIET, ha="right")
        return self.figures


FOOT_TEXT = f"pointglass {__version__}"
"""Of the program, in the foot line."""
