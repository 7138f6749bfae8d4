"""Recognises the columns of a text file without a header by the values in a sample of its rows.

Words are labels; three numbers of unit length are normals; whole numbers from 0 to 255 (or else 65535), or shares of 1, three
columns beside each other, are a colour.  What the values do not decide is asked about: InputError that names --columns.
"""

from pathlib import Path

import numpy as np

from ...common.errors import InputError, Option
from .text_header import OTHER

_UNIT_LENGTH = 0.01  # largest error of a normal's length: components of two decimals make one of 0.005 * sqrt(3) at most
_LABEL_SHARE = 0.5  # of the rows that have no number in a column from which on it holds labels: the majority
_UNLIKE = 0.15
"""How much less a column must resemble the colours beside it than another one, to be the intensity; below that a
person is asked.  On six scans with the intensity before or behind the colour the difference is 0.32 to 1.9, but 0.006 on a
statue whose intensity, behind its colour, resembles it."""


def columns_by_values(path: Path, table: np.ndarray, words: np.ndarray) -> tuple[str, tuple[str, ...]]:
    """The columns, a letter each, and notes about them for a person.  table: (n, count) float64, NaN where no number is.
    words: (n, count) bool, True where a field is neither a number nor a spelling of NaN.

    Raises InputError where they cannot be recognised.
    """
    with np.errstate(all="ignore"):  # values that are not finite, and columns that do not vary
        return _recognised(path, table, words)


def _recognised(path: Path, table: np.ndarray, words: np.ndarray) -> tuple[str, tuple[str, ...]]:
    count = table.shape[1]
    numbers = [at for at in range(count) if words[:, at].mean() < _LABEL_SHARE] if len(table) else []
    if len(numbers) < 3:
        numbers = list(range(count))  # not a number in many rows: left out and counted when they are read
    columns, notes = [OTHER] * count, []
    first = _leading(table, numbers)
    if first:
        notes.append(f"column {' and '.join(str(at + 1) for at in numbers[:first])} counts points or rows; it is not used")
    numbers = numbers[first:]
    for at, column in zip(numbers, "xyz", strict=False):
        columns[at] = column
    place = [at + 1 for at in numbers[:3]]
    if place != [1, 2, 3]:
        order = ",".join("yxz"[place.index(at + 1)] if at + 1 in place else OTHER for at in range(count))
        notes.append(f"columns {place[0]}, {place[1]} and {place[2]} are read as x, y, z; where they are northing, easting and "
                     f"elevation, give --columns {order}")  # fmt: skip
    left = [at for at in numbers[3:] if np.isfinite(table[:, at]).any()]
    normals = next((at for at in _triples(left) if _are_normals(table[:, at : at + 3])), None)
    if normals is not None:
        left = [at for at in left if not normals <= at < normals + 3]
    colour = _colour(path, table, left, count)
    if colour is not None:
        columns[colour : colour + 3] = "rgb"
        left = [at for at in left if not colour <= at < colour + 3]
    if colour is not None:
        left = [at for at in left if not _is_constant(table[:, at])]  # an opacity of 255, an empty column
    if len(left) > 1:
        raise unknown_columns(path, f"{count} columns and no header that names them")
    if left:
        columns[left[0]] = "i"
    return "".join(columns), tuple(notes)


def unknown_columns(path: Path, why: str) -> InputError:
    """The error about columns that a person must name."""
    return InputError(why, file=path,
                      remedy=("say what its columns are, such as ", Option("--columns"), " x,y,z,i,r,g,b,- (i: intensity, "
                              "c: class, -: anything else)"))  # fmt: skip


def _leading(table: np.ndarray, numbers: list[int]) -> int:
    """How many columns of numbers stand before x: a number of the point that counts the rows, or row and column of the
    scanner's image before coordinates with fractions."""
    if len(numbers) < 4 or len(table) < 3:
        return 0
    first = table[: len(table) // 3 if len(table) >= 9 else None, numbers[0]]  # the sample has up to three parts
    if (np.diff(first) == 1).all() and first[0] >= 0:
        return 1
    if len(numbers) >= 5:
        whole = [bool((table[:, at] % 1 == 0).all()) for at in numbers[:5]]
        if whole == [True, True, False, False, False] and table[:, numbers[:2]].min() >= 0:
            return 2
    return 0


def _triples(columns: list[int]) -> list[int]:
    """The first of every three columns that stand beside each other."""
    return [at for at in columns if at + 1 in columns and at + 2 in columns]


def _colour(path: Path, table: np.ndarray, left: list[int], count: int) -> int | None:
    """The column of red, or None where there is no colour."""
    found = [at for at in _triples(left) if _are_colours(table[:, at : at + 3])]
    narrow = [at for at in found if np.nanmax(table[:, at : at + 3]) <= 255]
    found = narrow if narrow else found
    varied = [at for at in found if not any(_is_constant(table[:, at + i]) for i in range(3))]
    found = varied if len(varied) >= 1 else found
    if len(found) == 2 and found[1] == found[0] + 1:
        before, after = (_unlike(table, at, (found[0] + 1, found[0] + 2)) for at in (found[0], found[0] + 3))
        if abs(before - after) > _UNLIKE:
            found = [found[0] + 1 if before > after else found[0]]
    if len(found) > 1:
        raise unknown_columns(path, f"{count} columns in which the colour may be columns {found[0] + 1} to {found[0] + 3} or "
                                    f"{found[-1] + 1} to {found[-1] + 3}")  # fmt: skip
    return found[0] if found else None


def _unlike(table: np.ndarray, column: int, colours: tuple[int, int]) -> float:
    """How little a column resembles two that are colours: distance of the distributions (Kolmogorov and Smirnov) and missing
    correlation, means of both; 0 to 2."""
    values, total = table[:, column], 0.0
    for other in (table[:, at] for at in colours):
        places = np.concatenate([values, other])
        ranks = [np.searchsorted(np.sort(a), places, side="right") / len(a) for a in (values, other)]
        moving = min(np.ptp(values), np.ptp(other)) > 0
        alike = float(np.corrcoef(values, other)[0, 1]) if moving else 0.0
        total += float(np.abs(ranks[0] - ranks[1]).max()) + 1 - max(0.0, alike)
    return total / len(colours)


def _is_constant(values: np.ndarray) -> bool:
    return len(values) > 1 and bool(np.nanmin(values) == np.nanmax(values)) if np.isfinite(values).any() else True


def _are_normals(values: np.ndarray) -> bool:
    lengths = np.sqrt((values**2).sum(axis=1))
    near = np.abs(lengths - 1) < _UNIT_LENGTH
    return bool(near.mean() > 0.9 and (values % 1 != 0).any())  # some writers omit the normals of some points


def _are_colours(values: np.ndarray) -> bool:
    if not np.isfinite(values).all() or values.min() < 0:
        return False
    return bool((values % 1 == 0).all() and values.max() <= 65535) or bool(values.max() <= 1)
