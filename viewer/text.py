"""Words for people: a number and its noun, a number of bytes."""


def counted(number: float, noun: str) -> str:
    """"1 frame", "2,000 frames", "0.5 points"."""
    shown = f"{number:g}" if isinstance(number, float) else f"{number:,}"
    return f"{shown} {noun}{'' if number == 1 else 's'}"


def bytes_text(count: float) -> str:
    """"1 byte", "1.5 KiB", "12 MiB": in the units that options take."""
    for unit, size in (("GiB", 1 << 30), ("MiB", 1 << 20), ("KiB", 1 << 10)):
        if count >= size:
            return f"{count / size:.4g} {unit}"
    return counted(count, "byte")
