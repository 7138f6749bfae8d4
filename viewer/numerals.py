"""Whole numbers as people and files write them: the digits 0 to 9 and nothing else."""


def whole_number(text: str) -> int | None:
    """``text`` as a number from 0 to 10**18 - 1, None where it is none.

    ``str.isdigit`` says yes to a superscript two, which ``int`` refuses, and ``int`` itself refuses thousands of digits.
    """
    return int(text) if text.isascii() and text.isdecimal() and len(text) <= 18 else None
