"""Fonts that have the letters of a text: those that come with the product's libraries, then those found on this machine.

A letter that the first font lacks (Chinese, Japanese, Korean, Hebrew, Thai, ...) is taken from the first font of the machine
that has it.  ``POINTGLASS_FONTS`` names a folder whose fonts are used instead of the machine's.  Bitmap fonts, as those of
coloured emoji, are not used: they have one size.
"""

import os
import unicodedata
from collections.abc import Iterable, Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

ENVIRONMENT = "POINTGLASS_FONTS"
_ENDINGS = (".ttf", ".otf", ".ttc", ".otc")
_PREFERRED = ("notosanscjk", "sourcehansans", "notosans", "wqy", "droidsansfallback", "ipaexg", "ipag", "takaogothic",
              "nanumgothic", "unifont")
"""Beginnings of the names of fonts without serifs that have many letters, the best first."""
_UNLIKE_TEXT = ("bold", "black", "italic", "oblique", "mono", "serif", "light", "thin", "condensed", "narrow", "lastresort")
"""Parts of the names of fonts that a plain text is not set in, where another has the letter."""
_MARK = "\u200e"
"""LEFT-TO-RIGHT MARK."""
_NO_SHAPE = ("Cc", "Cf", "Zs", "Zl", "Zp", "Mn", "Me")
"""Categories of characters that draw nothing of their own, or belong to the letter before."""


@cache
def plain_font() -> Path:
    """DejaVu Sans of Matplotlib, which has Ø, ², Greek and Cyrillic letters; Pillow's own font has not."""
    import matplotlib

    return Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSans.ttf"


@cache
def title_fonts() -> tuple[Path, Path]:
    """The fonts of titles, bold and regular: those of the window (Roboto of imgui-bundle), else the plain one twice."""
    found = find_spec("imgui_bundle")
    if found is not None and found.origin is not None:
        folder = Path(found.origin).parent / "assets" / "fonts" / "Roboto"
        bold, regular = folder / "Roboto-Bold.ttf", folder / "Roboto-Regular.ttf"
        if bold.is_file() and regular.is_file():
            return bold, regular
    return plain_font(), plain_font()


@cache
def machine_fonts() -> tuple[Path, ...]:
    """Font files of this machine, or of the folder that POINTGLASS_FONTS names; those of plain text first."""
    folder = os.environ.get(ENVIRONMENT)
    if folder is not None:
        found = [path for path in Path(folder).rglob("*") if path.suffix.lower() in _ENDINGS]
    else:
        from matplotlib.font_manager import findSystemFonts

        found = [path for path in map(Path, findSystemFonts()) if path.suffix.lower() in _ENDINGS]
    return tuple(sorted(set(found), key=_rank))


def _rank(path: Path) -> tuple[int, int, str]:
    name = path.stem.lower().replace("-", "").replace("_", "")
    known = next((number for number, begin in enumerate(_PREFERRED) if name.startswith(begin)), len(_PREFERRED))
    return known, sum(part in name for part in _UNLIKE_TEXT), str(path)


@cache
def _opened(path: Path) -> Any:
    """A font as Matplotlib's FreeType has it; None where it cannot be read, or has one size only."""
    from matplotlib.ft2font import FT2Font

    try:
        font = FT2Font(str(path))
    except (OSError, RuntimeError, ValueError):
        return None
    return font if font.scalable else None


def _has(path: Path, letter: str) -> bool:
    font = _opened(path)
    return font is not None and bool(font.get_char_index(ord(letter)))


@cache
def font_with(letter: str) -> Path | None:
    """The first font of the machine that has a letter; None where none has."""
    return next((path for path in machine_fonts() if _has(path, letter)), None)


def needs_shape(letter: str) -> bool:
    """Whether a character is drawn by a glyph of its own."""
    return unicodedata.category(letter) not in _NO_SHAPE


def in_order(text: str) -> str:
    """A line with marks (U+200E, which are not drawn) that keep its parts in their order from left to right, where some of its
    words are written from right to left: a number before such a name stays before it, a value behind it.  A line of such words
    alone has none."""
    ways = [unicodedata.bidirectional(letter) for letter in text]
    if not _can_order("R") or not {"R", "AL"} & set(ways) or not {"L", "EN", "AN"} & set(ways):
        return text
    found, last = [_MARK], 0  # last: where the last word from right to left ends in ``found``, 0: none before the next letter
    for letter, way in zip(text, ways, strict=True):
        if last and way in ("EN", "AN"):
            found.insert(last, _MARK)
        found.append(letter)
        last = len(found) if way in ("R", "AL") else 0 if way in ("L", "EN", "AN") else last
    return "".join(found)


@cache
def _can_order(direction: str) -> bool:
    """Whether letters of this direction of writing can be joined and set: from right to left needs Raqm and FriBiDi."""
    from PIL import features

    return direction not in ("R", "AL") or bool(features.check("raqm") and features.check("fribidi"))


def undrawable(texts: "str | Iterable[str]", first: Sequence[Path] = ()) -> str:
    """The letters of texts that no font here has, each once.  first: fonts tried before the machine's; none: the plain one."""
    base = first or (plain_font(),)
    letters = dict.fromkeys(letter for text in ([texts] if isinstance(texts, str) else texts) for letter in text)
    return "".join(
        letter for letter in letters
        if needs_shape(letter) and not (_can_order(unicodedata.bidirectional(letter))
                                        and (any(_has(path, letter) for path in base) or font_with(letter) is not None))
    )  # fmt: skip


def undrawable_line(letters: str) -> str:
    """What a person reads about letters that cannot be drawn."""
    shown = " ".join(letters[:12]) + (" …" if len(letters) > 12 else "")
    return f"no font on this machine has {shown}"


REMEDY = f"install a font that has them (as fonts-noto-cjk), or name a folder of fonts in {ENVIRONMENT}"


def boxes_line(texts: Iterable[str]) -> str:
    """What a person reads about texts that were drawn with boxes for letters that no font here has; "" where none was."""
    letters = undrawable(texts)
    return f"letters are drawn as boxes: {undrawable_line(letters)}; {REMEDY}" if letters else ""


def runs(text: str, first: Sequence[Path] = ()) -> list[tuple[str, Path]]:
    """A line cut into parts that one font has.  A font that has all of it is preferred, so that words in two scripts match and
    text from right to left keeps its order.  A letter that no font has stays with the font before it.

    first: fonts tried before the machine's; none: the plain one."""
    base = tuple(first) or (plain_font(),)
    shaped = [letter for letter in text if needs_shape(letter)]
    others = dict.fromkeys(path for path in map(font_with, shaped) if path is not None)
    for path in base if not any(unicodedata.bidirectional(letter) in ("R", "AL") for letter in shaped) else (*base, *others):
        if all(_has(path, letter) for letter in shaped):
            return [(text, path)] if text else []
    found: list[tuple[str, Path]] = []
    for letter in text:
        path = found[-1][1] if found else base[0]
        if needs_shape(letter):
            path = next((each for each in base if _has(each, letter)), None) or font_with(letter) or path
        if found and found[-1][1] == path:
            found[-1] = (found[-1][0] + letter, path)
        else:
            found.append((letter, path))
    return found


def families(text: str) -> list[str]:
    """Names of fonts for Matplotlib, which takes each letter from the first that has it: the plain one, then those of the
    machine that have what it lacks.  Their files are made known to Matplotlib."""
    return ["DejaVu Sans", *dict.fromkeys(_family(path) for _, path in runs(text) if path != plain_font())]


@cache
def _family(path: Path) -> str:
    import logging

    from matplotlib.font_manager import FontProperties, fontManager

    logging.getLogger("matplotlib.font_manager").setLevel(logging.ERROR)  # many have no bold letters, which a person may miss
    fontManager.addfont(str(path))
    return FontProperties(fname=str(path)).get_name()
