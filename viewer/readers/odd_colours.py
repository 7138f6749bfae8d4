"""Colours that a file holds and a picture does not: channels beyond 16 bits are clipped, and their points counted."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from ..common.text import counted, plain

FULL = 65535


def colours_counted(
    rows: Iterator[tuple[int, dict[str, np.ndarray]]], names: Sequence[str], path: Path, told: list[str], most: int = FULL
) -> Iterator[tuple[int, dict[str, np.ndarray]]]:
    """Yields ``rows``, (scan, columns) as a file has them, and at their end adds a line to ``told``, once, with the number of
    points whose colour has a channel below 0 or above ``most``.

    names: of the columns of red, green and blue; those that a file does not have are left out.
    """
    points, example = 0, 0.0
    for scan, columns in rows:
        odd: np.ndarray | None = None
        for values in (columns[name] for name in names if name in columns):
            if values.dtype.kind == "u" and np.iinfo(values.dtype).max <= most:
                continue
            with np.errstate(invalid="ignore"):  # NaN is no colour and becomes 0
                beyond = (values < 0) | (values > most)
            if beyond.any():
                example = example or float(values[beyond][0])
                odd = beyond if odd is None else odd | beyond
        points += 0 if odd is None else int(odd.sum())
        yield scan, columns
    text = (f"{path.name}: {counted(points, 'point')} {'has' if points == 1 else 'have'} a colour channel below 0 or above "
            f"{most:,}, such as {plain(example)}; it is clipped")  # fmt: skip
    if points and text not in told:
        told.append(text)


def clipped(values: np.ndarray, kind: type) -> np.ndarray:
    """Values as unsigned integers, clipped; values of text are floats of any size."""
    return values if values.dtype == kind else np.clip(np.nan_to_num(values), 0, np.iinfo(kind).max).astype(kind)
