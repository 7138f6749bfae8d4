"""Measured areas on a drawing of a cut: the outline that lies in it, and the value as a text in its middle.

Frame: paper coordinates, file units, as viewer.work.dimensioning.dimensions.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from ..measuring.measure_shapes import shapes_of
from ..measuring.measure_text import decimals_of, value_text
from ..measuring.measurement import Measurement
from ..measuring.values import evaluate


@dataclass(frozen=True, eq=False)
class CutArea:
    """outline: (n, 2) its corners.  place: (2,) the middle of its text."""

    outline: np.ndarray
    place: np.ndarray
    text: str

    def rectangle(self, height: float, width: float) -> np.ndarray:
        """(4, 2) corners of the text, with letters of a height and so wide."""
        half = np.array([width / 2 + 0.2 * height, 0.75 * height])
        return self.place + half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])


def areas_of(measurements: Iterable[Measurement], paper: Callable[[np.ndarray], np.ndarray],
             holds: Callable[[np.ndarray], np.ndarray], unit: str) -> tuple[CutArea, ...]:
    """The areas whose corners all lie in a cut.  paper, holds, unit: as for dimensions_of.  Where the area leans out of the
    paper, its text says that the value is the one in space."""
    found = []
    for measurement in measurements:
        if measurement.kind != "area" or (flat := shapes_of(measurement).area) is None:
            continue
        corners = paper(flat)
        if not holds(corners).all():
            continue
        outline, result = corners[:, :2], evaluate(measurement)
        seen = _signed(outline)
        text, digits = value_text(measurement, unit), decimals_of(result)
        if f"{abs(seen):.{digits}f}" != f"{result.value:.{digits}f}" and abs(abs(seen) - result.value) > 1e-6 * result.value:
            text += " in space"
        found.append(CutArea(outline, _middle(outline, seen), text))
    return tuple(found)


def _signed(outline: np.ndarray) -> float:
    x, y = (outline - outline[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def _middle(outline: np.ndarray, seen: float) -> np.ndarray:
    """(2,) centre of an area; the mean of the corners of one that is seen from its edge."""
    if abs(seen) <= 1e-9 * float(np.ptp(outline, axis=0).max() or 1.0) ** 2:
        return outline.mean(axis=0)
    local = outline - outline[0]
    following = np.roll(local, -1, axis=0)
    cross = local[:, 0] * following[:, 1] - local[:, 1] * following[:, 0]
    return outline[0] + ((local + following) * cross[:, None]).sum(axis=0) / (6 * seen)
