"""Text for a person: what a terminal would obey is escaped; counts with their noun, numbers of bytes; whole numbers from
text."""

from ...model.common.printable import escaped_output, printable

__all__ = ["bytes_text", "count_text", "counted", "escaped_output", "left_text", "printable", "whole_number",
           "with_whole_characters"]

import math
from collections.abc import Iterable


def counted(number: float, noun: str) -> str:
    """"1 frame", "2,000 frames", "0.5 points"."""
    shown = f"{number:g}" if isinstance(number, float) else f"{number:,}"
    return f"{shown} {noun}{'' if number == 1 else 's'}"


def left_text(seconds: float) -> str:
    """A time to wait, rounded as an estimate is: "8 s", "3 min", "1 h 20 min"."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60} min"


def bytes_text(count: float) -> str:
    """"1 byte", "1.5 KiB", "12 MiB", in the units that options accept."""
    for unit, size in (("GiB", 1 << 30), ("MiB", 1 << 20), ("KiB", 1 << 10)):
        if count >= size:
            return f"{count / size:.4g} {unit}"
    return counted(count, "byte")


def whole_number(text: str) -> int | None:
    """``text`` as a number from 0 to 10**18 - 1, or None if it is anything but ASCII digits.

    Stricter than ``str.isdigit``, which accepts a superscript two that ``int`` refuses; ``int`` itself fails on thousands of
    digits.
    """
    return int(text) if text.isascii() and text.isdecimal() and len(text) <= 18 else None


def coordinate(value: float) -> str:
    """A coordinate with the 15 digits that float64 is sure to hold, at least three decimals, and no zeros behind the third."""
    digits = 15 - len(str(int(abs(value)))) if math.isfinite(value) else 3
    whole, _, decimals = f"{value:.{min(max(digits, 3), 12)}f}".partition(".")
    return f"{whole}.{decimals[:3]}{decimals[3:].rstrip('0')}"


def number_text(value: float) -> str:
    """A number with the digits that it is sure to have: 12, and from a million on the 15 of float64, so that coordinates of
    1e9 keep their millimetres."""
    return f"{value:.{15 if abs(value) >= 1e6 else 12}g}"


def place_text(values: Iterable[float]) -> str:
    """Coordinates: "(1000000000.002, 12.5, 3)"."""
    return f"({', '.join(map(number_text, values))})"


def plain(value: object) -> str:
    """A value from a file as a person reads it."""
    if isinstance(value, (list, tuple)):
        return ", ".join(plain(part) for part in value)
    if isinstance(value, float):
        return f"{value:.12g}"
    return str(value)


_ROUNDINGS = 8
"""Of the largest number of a computation, in which its result may be off: a file's whole number times its scale, and its offset
added, are four, and the offset may be larger than what comes of it."""

_WHOLE = 2.0**53
"""From here on float64 has no decimals."""


def table_places(values: Iterable[float], size: float = 0.0, loss: float = 0.0) -> list[str]:
    """Coordinates in a table: of each the shortest text that differs by no more than float64 rounds, so that 483 steps of 0.001
    are 0.483; those of a file with float32 as that is written.  size: a number that they were computed from, where it is larger
    than they are.  loss: what a coordinate may lose besides, in its unit."""
    import numpy as np

    values = [float(value) for value in values]
    with np.errstate(over="ignore", invalid="ignore"):
        short = np.array(values).astype(np.float32)
    if not size and (short == values).all():
        return [np.format_float_positional(value, trim="-") for value in short]
    finite = [abs(value) for value in (*values, size) if math.isfinite(value)]
    within = max(loss, _ROUNDINGS * math.ulp(max(finite, default=0.0)))
    return [_shortest(value, within) for value in values]


def _shortest(value: float, within: float) -> str:
    """The decimal number with the fewest decimals that is so near to a number."""
    for decimals in range(20 if abs(value) < _WHOLE else 0):
        text = f"{value:.{decimals}f}"
        if abs(float(text) - value) <= within:
            return text if float(text) else "0"
    return repr(value)


def table_bytes(text: str) -> bytes:
    """A CSV table in UTF-8, with a byte order mark where it has other letters than ASCII: without one, spreadsheets take them
    for Latin letters.  Halves of characters are escaped."""
    return text.encode("utf-8" if text.isascii() else "utf-8-sig", errors="backslashreplace")


def with_whole_characters(text: str) -> str:
    """A text, with halves of characters (unpaired surrogates, which JSON can hold) escaped: no text can be drawn or written
    that has one."""
    return printable(text) if any("\ud800" <= letter <= "\udfff" for letter in text) else text


def count_text(number: int) -> str:
    """A count that is read at a glance: 950, 12.3 k, 1.04 M, 2.10 G."""
    for unit, size in (("G", 1e9), ("M", 1e6), ("k", 1e3)):
        if number >= size:
            return f"{number / size:.0f} {unit}" if number / size >= 99.95 else f"{number / size:#.3g} {unit}"
    return str(number)
