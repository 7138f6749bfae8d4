"""Titles of a film: an opening title in the middle of the picture, captions at its lower left, drawn at the film's own size.

White letters over a soft shadow, which fade in and out.  The first line of an opening title is large, its further lines are
smaller.  Sizes are shares of the picture's shorter side.  The same title in the same fonts gives the same bytes.
"""

import hashlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ...common.errors import InputError
from ...common.fonts import REMEDY, runs, title_fonts, undrawable, undrawable_line
from ...common.text import printable
from ...common.text_line import TextLine
from ..document import FilmTitle
from .drawn_over import drawn_over

FADE = 0.8
"""Seconds in which a title appears, and in which it fades; at most a third of the time that it is shown."""
_LARGE, _SMALL, _CAPTION = 1 / 10, 1 / 26, 1 / 24
"""Letters of an opening title's first line, of its further lines, and of a caption: a share of the picture's shorter side."""
_LEADING = 1.2
"""From one baseline to the next, of the size of the letters."""
_MARGIN = 0.075
"""From a caption to the edge of the picture, of its shorter side: inside what television calls title safe."""
_WIDEST, _HIGHEST = 0.8, 0.55
"""Of the picture, the part that a title may take; longer ones are broken, then set smaller."""
_SHRINK, _LEAST = 0.92, 8
"""From one try to the next, and the least size in pixels."""
_EDGE, _EDGE_DARK, _GROUND, _GROUND_DARK = 0.10, 0.70, 0.75, 0.68
"""Blur (standard deviation, of the size of the letters) and darkness of the two shadows: an edge, and a soft ground."""
_WHITE = 250


@dataclass(frozen=True)
class TimedTitle:
    """begin, seconds: when it is shown, of the film.  opening: whether it is the opening title, else a caption."""

    text: str
    begin: float
    seconds: float
    opening: bool

    def opacity(self, at: float) -> float:
        """0 to 1 at a time of the film, with a smooth beginning and end."""
        fade = min(FADE, self.seconds / 3)
        share = min((at - self.begin) / fade, (self.begin + self.seconds - at) / fade, 1.0)
        return 0.5 - 0.5 * math.cos(math.pi * share) if share > 0 else 0.0


def timed_titles(title: FilmTitle | None, captions: Sequence[FilmTitle | None], arrivals: Sequence[float],
                 length: float) -> tuple[TimedTitle, ...]:
    """When titles are shown in a film of ``length`` seconds.  captions: of its keyframes, which it reaches after ``arrivals``
    seconds.  A caption begins with the arrival, near the film's end so much earlier that it is shown as long as it says, and
    ends where the next begins."""
    begun = [TimedTitle(caption.text, max(min(at, length - caption.seconds), 0.0), min(caption.seconds, length), False)
             for caption, at in zip(captions, arrivals) if caption is not None]
    begun.sort(key=lambda each: each.begin)
    for number, (one, after) in enumerate(pairwise(begun)):
        begun[number] = replace(one, seconds=min(one.seconds, after.begin - one.begin))
    first = [TimedTitle(title.text, 0.0, min(title.seconds, length), True)] if title is not None else []
    return tuple(each for each in (*first, *begun) if each.seconds > 0)


@dataclass(frozen=True)
class FilmTitles:
    """All titles of a film.  rate: its frames a second.  panorama: titles are drawn small, around the heading."""

    shown: tuple[TimedTitle, ...] = ()
    rate: float = 24.0
    panorama: bool = False

    def over(self, picture: np.ndarray, frame: int) -> np.ndarray:
        """The picture, (H, W, 3) uint8, of frame ``frame`` with the titles that are shown then."""
        return self.at(picture, frame / self.rate)

    def at(self, picture: np.ndarray, seconds: float) -> np.ndarray:
        """The same at a time of the film."""
        for title in self.shown:
            if (opacity := title.opacity(seconds)) > 0:
                sheet, left, top = title_sheet(title.text, title.opening, picture.shape[1], picture.shape[0], self.panorama)
                faded = sheet.copy()
                faded[..., 3] = np.rint(sheet[..., 3] * opacity)
                part = np.s_[top : top + sheet.shape[0], left : left + sheet.shape[1]]
                picture = picture.copy()
                picture[part] = drawn_over(picture[part], faded)
        return picture

    def check(self) -> None:
        """Raises InputError where no font has a letter of a title."""
        if letters := undrawable((title.text for title in self.shown), title_fonts()):
            raise InputError(f"a title cannot be drawn: {undrawable_line(letters)}", remedy=REMEDY)

    @cached_property
    def record(self) -> dict:
        """JSON-able: what determines how the titles are drawn; with the fonts, which another machine may have in other
        versions."""
        used = {path for title in self.shown for line in lines_of(title.text) for first in title_fonts()
                for _, path in runs(line, _fonts(first))}
        return {"titles": [[title.text, title.opening, title.begin, title.seconds] for title in self.shown],
                "fonts": {path.name: hashlib.sha256(path.read_bytes()).hexdigest()[:16] for path in sorted(used)}}


NO_TITLES = FilmTitles()


def lines_of(text: str) -> list[str]:
    """The lines of a title: what moves a cursor or turns the direction of writing is shown escaped."""
    return ["".join(_shown(letter) for letter in line).strip() for line in text.strip().splitlines()]


def _shown(letter: str) -> str:
    """Spaces of any width are one space; joiners are kept, on which the shape of letters depends."""
    return " " if letter.isspace() else letter if letter in "\u200c\u200d" else printable(letter)


def _fonts(first: Path) -> tuple[Path, ...]:
    return first, *(path for path in title_fonts() if path != first)


def _wrapped(line: str, width: float, size: int, first: Sequence[Path]) -> list[TextLine]:
    """A line broken at spaces, and inside what is wider than ``width`` pixels, as texts without spaces are."""
    if (whole := TextLine(line, size, first)).width <= width:
        return [whole]
    found, now = [], ""
    for word in _words(line):
        if now and TextLine((now + word).rstrip(), size, first).width > width:
            found.append(now.rstrip())
            now = ""
        now += word
        while TextLine(now.rstrip(), size, first).width > width and len(now) > 1:
            kept = next(count for count in range(len(now) - 1, 0, -1)
                        if count == 1 or TextLine(now[:count], size, first).width <= width)
            found.append(now[:kept])
            now = now[kept:]
    return [TextLine(text, size, first) for text in (*found, now.rstrip()) if text]


def _words(line: str) -> Iterable[str]:
    """Parts after which a line may be broken, each with the space behind it."""
    return [part + " " for part in line.split(" ")]


def _set(text: str, opening: bool, side: int, width: int, height: int) -> list[TextLine]:
    """The lines of a title, broken and small enough for an area of the picture."""
    bold, regular = title_fonts()
    large, small = (_LARGE, _SMALL) if opening else (_CAPTION, _CAPTION)
    factor = 1.0
    while True:
        lines = []
        for number, line in enumerate(lines_of(text)):
            size = max(round((large if number == 0 else small) * side * factor), _LEAST)
            lines += _wrapped(line, _WIDEST * width, size, _fonts(bold if opening and number == 0 else regular))
        if sum(line.size for line in lines) * _LEADING <= _HIGHEST * height or lines[0].size == _LEAST:
            return lines
        factor *= _SHRINK


@lru_cache(16)
def title_sheet(text: str, opening: bool, width: int, height: int, panorama: bool = False) -> tuple[np.ndarray, int, int]:
    """(h, w, 4) uint8, not premultiplied, of a title with its shadow, and where its left top corner lies in a picture of a
    size.  Of a panorama, the middle quarter of the width, which is 90 degrees, is the picture."""
    from PIL import Image, ImageDraw

    area = (width // 4, height // 2) if panorama else (width, height)
    side = min(area)
    lines = _set(text, opening, side, *area)
    gaps = [0.0, *(after.size * _LEADING if after.size == line.size else line.descent + after.ascent + _LEADING / 4 * after.size
                   for line, after in pairwise(lines))]
    block = sum(gaps) + lines[0].ascent
    pad = round(_GROUND * 3 * lines[0].size) + 2
    sheet_width = min(round(max(line.width for line in lines)) + 2 * pad, width)
    sheet_height = min(round(block + lines[-1].descent) + 2 * pad, height)
    cover = Image.new("L", (sheet_width, sheet_height))
    draw, baseline = ImageDraw.Draw(cover), float(min(pad, (sheet_height - block) / 2) + lines[0].ascent)
    for number, line in enumerate(lines):
        baseline += gaps[number]
        left = (sheet_width - line.width) / 2 if opening else min(pad, (sheet_width - line.width) / 2)
        line.draw(draw, round(left), round(baseline), 255)
    letters = np.asarray(cover).astype(np.float32) / 255
    light = 1 - _EDGE_DARK * np.minimum(np.asarray(_blurred(cover, _EDGE * lines[-1].size)) * np.float32(1.2 / 255), 1)
    light *= 1 - _GROUND_DARK * np.minimum(np.asarray(_blurred(cover, _GROUND * lines[0].size)) * np.float32(1.6 / 255), 1)
    alpha = letters + (1 - light) * (1 - letters)
    colour = np.rint(np.divide(_WHITE * letters, alpha, out=np.zeros_like(alpha), where=alpha > 0)).astype(np.uint8)
    made = np.dstack([colour, colour, colour, np.rint(255 * alpha).astype(np.uint8)])
    if opening:
        return made, (width - sheet_width) // 2, (height - sheet_height) // 2
    edge = round(_MARGIN * side)
    left = max((width - area[0]) // 2 + edge - pad, 0)
    return made, left, min(max((height + area[1]) // 2 - edge - sheet_height + pad, 0), height - sheet_height)


def _blurred(cover: Any, deviation: float) -> Any:
    """An image of mode L, blurred; a wide blur is made of a smaller image, and takes a tenth of the time."""
    from PIL import Image, ImageFilter

    factor = max(int(deviation / 6), 1)
    if factor == 1:
        return cover.filter(ImageFilter.GaussianBlur(deviation))
    small = cover.resize((-(-cover.width // factor), -(-cover.height // factor)), Image.Resampling.BOX)
    return small.filter(ImageFilter.GaussianBlur(deviation / factor)).resize(cover.size, Image.Resampling.BICUBIC)
