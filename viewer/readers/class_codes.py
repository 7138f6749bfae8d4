"""Classes of points as the codes 0 to 255 that the picture colours by, and a warning where a file has others."""

from pathlib import Path

import numpy as np

from ..common.text import counted, plain

_MOST = 255


def class_codes(values: np.ndarray) -> np.ndarray:
    """(n,) uint8 codes of classes (n,) of any type: the nearest code, 0 for NaN."""
    if values.dtype == np.uint8:
        return values
    return np.clip(np.nan_to_num(values), 0, _MOST).astype(np.uint8)


class OddClasses:
    """Counts, over the points of a file, classes that are not whole numbers from 0 to 255."""

    def __init__(self) -> None:
        self._points, self._example = 0, 0.0

    def add(self, values: np.ndarray | None) -> None:
        """values: (n,) classes of some points; None where the file has none."""
        if values is None or values.dtype == np.uint8:
            return
        with np.errstate(invalid="ignore"):
            odd = ~((values >= 0) & (values <= _MOST) & (values % 1 == 0))
        if odd.any():
            self._points += int(odd.sum())
            self._example = float(values[odd][0])

    def warning(self, path: Path) -> str | None:
        """One line with the number of points; None where all classes are codes."""
        if not self._points:
            return None
        return (f"{path.name}: {counted(self._points, 'point')} {'has' if self._points == 1 else 'have'} a class that is not a "
                f"whole number from 0 to {_MOST}, such as {plain(self._example)}; the picture shows the nearest code, picking "
                "and export the file's own")  # fmt: skip
