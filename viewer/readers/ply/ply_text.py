"""The text of an ascii PLY file as lines, and rows of numbers in any spelling."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

import numpy as np

from ...common.errors import InputError
from ..text.text_numbers import number
from ..text.text_rows import BLOCK
from .ply_header import Property


def parsed(rows: list[str], columns: int) -> np.ndarray | None:
    """(n, columns) float64 of rows of text; None where one is not numbers in any spelling
    (viewer.readers.text.text_numbers)."""
    try:
        return np.loadtxt(rows, np.float64, comments=None, usecols=range(columns), ndmin=2)
    except ValueError:
        table = [[number(word) for word in row.split()[:columns]] for row in rows]
    if any(len(values) < columns or None in values for values in table):
        return None
    return np.array(table, np.float64)


def lines_of(path: Path, file: BinaryIO) -> Iterator[list[str]]:
    """Yields the rest of the file as lists of lines that are not blank."""
    rest = b""
    while block := file.read(BLOCK):
        head, newline, tail = block.rpartition(b"\n")
        if not newline and len(rest) > BLOCK:
            raise InputError("says it is ascii but holds no lines of text", file=path, remedy="export it again")
        if newline:
            yield [line for line in (rest + head).decode("latin-1").split("\n") if line.strip()]
            rest = tail
        else:
            rest += tail
    if rest.strip():
        yield [rest.decode("latin-1")]


def without_lists(row: str, properties: Sequence[Property]) -> str:
    """A row of text without the lists in it; "incomplete" where it ends early."""
    words, kept = iter(row.split()), []
    try:
        for p in properties:
            word = next(words)
            if p.length_type:
                for _ in range(int(word)):
                    next(words)
            else:
                kept.append(word)
    except (StopIteration, ValueError):
        return "incomplete"
    return " ".join(kept)
