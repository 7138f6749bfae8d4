"""Pairs of points as a CSV file: six numbers a line, x y z in the moving scan and x y z in the fixed one.

Separated by commas, semicolons, tabs or spaces; lines that begin with # and a first line of words are left out.
Frame: of each scan, its file coordinates and units.
"""

import math
import re
from pathlib import Path

import numpy as np

from ...common.errors import InputError

LARGEST = 1 << 20
"""Bytes: nobody clicks ten thousand pairs."""
_BETWEEN = re.compile(r"[,;\s]+")


def read_pairs(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """(n, 3) points in the moving scan, and their partners (n, 3).  Raises InputError naming the line that is wrong."""
    try:
        if path.stat().st_size > LARGEST:
            raise InputError("is too large for a file of pairs; is it a scan?", file=path)
        lines = path.read_text("utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "it is not UTF-8 text"
        raise InputError(f"cannot be read ({reason})", file=path) from None
    rows: list[list[float]] = []
    words_seen = False
    for number, line in enumerate(lines, 1):
        fields = [field for field in _BETWEEN.split(line.strip()) if field]
        if not fields or fields[0].startswith("#"):
            continue
        values = [_number(field) for field in fields]
        if not rows and not words_seen and all(value is None for value in values):
            words_seen = True  # the names of the columns
            continue
        found = [value for value in values if value is not None]
        if len(found) != 6 or len(values) != 6:
            raise InputError(f"line {number}: {line.strip()[:60]!r}: expected six numbers, x y z in the moving scan and x y z "
                             "in the fixed one", file=path)
        rows.append(found)
    if not rows:
        raise InputError("holds no pairs", file=path, remedy="write six numbers a line: x y z moving, x y z fixed")
    table = np.array(rows)
    return table[:, :3], table[:, 3:]


def _number(text: str) -> float | None:
    try:
        value = float(text)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
