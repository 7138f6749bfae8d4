"""A line of text in pixels, each letter in a font that has it, to be measured and drawn with Pillow."""

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from .fonts import in_order, plain_font, runs


@cache
def font_at(path: Path, size: int) -> Any:
    """A font, ``size`` pixels tall."""
    from PIL import ImageFont

    return ImageFont.truetype(path, size)


class TextLine:
    """text: without line breaks.  size: pixels.  first: fonts tried before the machine's; none: the plain one.

    width: pixels.  ascent, descent: pixels above and below the baseline, of the first font: equal for all lines of a size.
    """

    def __init__(self, text: str, size: int, first: Sequence[Path] = ()):
        self.text, self.size = text, size
        self._runs = [(part, font_at(path, size)) for part, path in runs(in_order(text), first)]
        self.width = sum(font.getlength(part) for part, font in self._runs)
        self.ascent, self.descent = font_at(first[0] if first else plain_font(), size).getmetrics()

    def draw(self, draw: Any, x: float, baseline: float, fill: Any) -> None:
        """Draws it with an ImageDraw, from ``x`` on."""
        for part, font in self._runs:
            draw.text((x, baseline), part, font=font, fill=fill, anchor="ls")
            x += font.getlength(part)
