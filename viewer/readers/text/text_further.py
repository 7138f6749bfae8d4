"""The columns of a text file besides coordinates, colour, intensity and class: which have a name, and which hold numbers.

They are parsed only where whole records are read; drawing skips them.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..column_source import ALL
from .text_columns import Layout, sample_fields
from .text_header import OTHER
from .text_numbers import number

_NUMBER_SHARE = 0.5
"""Of the fields of a column in a sample that are not empty, how many must be numbers to read the column: the majority."""
_MOST_NAMED = 8
"""Columns that a sentence names."""


@dataclass(frozen=True)
class Further:
    """names: by index of the field, the columns that are read.  losses: sentences about those that are not."""

    names: dict[int, str]
    losses: tuple[str, ...] = ()


def further_columns(path: Path, layout: Layout) -> Further:
    """Reads a sample of the file's rows.  Columns without a name, and with words instead of numbers, are not read."""
    others = [at for at, column in enumerate(layout.columns) if column == OTHER]
    if not others:
        return Further({})
    unnamed = [at for at in others if at >= len(layout.words) or not layout.words[at].strip()]
    rows = sample_fields(path, layout.delimiter, len(layout.columns), layout.headers) if len(unnamed) < len(others) else []
    names, labels = dict[int, str](), list[str]()
    taken = {*ALL, "intensity", "classification", "point_source_id"}
    for at in others:
        if at in unnamed:
            continue
        word = layout.words[at].strip().strip('"')
        ends_the_line = layout.rest and at == len(layout.columns) - 1
        if ends_the_line or not _holds_numbers([row[at] for row in rows], layout.decimal):
            labels.append(word)
            continue
        name = f"column_{word}" if word in set(ALL) else word
        unique, count = name, 1
        while unique in taken:
            count += 1
            unique = f"{name}_{count}"
        taken.add(unique)
        names[at] = unique
    losses = []
    if labels:
        losses.append(f"{path.name}: {_listed(labels)} not numbers and left out")
    if unnamed:
        losses.append(f"{path.name}: {_listed([str(at + 1) for at in unnamed])} without a name in a header and left out")
    return Further(names, tuple(losses))


def _holds_numbers(fields: list[str], decimal: str) -> bool:
    """Whether most of the fields that are not empty are numbers."""
    values = [number(field, decimal) for field in fields if field.strip().strip('"')]
    return bool(values) and float(np.mean([value is not None for value in values])) > _NUMBER_SHARE


def _listed(names: list[str]) -> str:
    shown = ", ".join(names[:_MOST_NAMED]) + (f" and {len(names) - _MOST_NAMED} more" if len(names) > _MOST_NAMED else "")
    return f"columns {shown} are" if len(names) > 1 else f"column {shown} is"
