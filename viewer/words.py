"""Words for people: a number and its noun."""


def counted(number: float, noun: str) -> str:
    """"1 frame", "2 frames", "0.5 points"."""
    shown = f"{number:g}" if isinstance(number, float) else str(number)
    return f"{shown} {noun}{'' if number == 1 else 's'}"
