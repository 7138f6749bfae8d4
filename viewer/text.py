"""Text for a person: what a terminal would obey is escaped; counts with their noun, numbers of bytes; whole numbers from
text."""

from ..model.common.printable import escaped_output, printable

__all__ = ["bytes_text", "counted", "escaped_output", "printable", "whole_number"]


def counted(number: float, noun: str) -> str:
    """"1 frame", "2,000 frames", "0.5 points"."""
    shown = f"{number:g}" if isinstance(number, float) else f"{number:,}"
    return f"{shown} {noun}{'' if number == 1 else 's'}"


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
