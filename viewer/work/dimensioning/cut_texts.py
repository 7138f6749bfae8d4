"""What is written on a drawing of a cut besides dimensions: of a measured area its outline, and value and perimeter in its
middle; of a polyline its total length beyond its end.

Frame: paper coordinates, file units, as viewer.work.dimensioning.dimensions.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..measuring.measure_shapes import shapes_of
from ..measuring.measure_text import decimals_of, text_of, value_text
from ..measuring.measurement import Measurement
from ..measuring.values import evaluate, perimeter

_LINE = 1.5
"""From one line of a text to the next, in heights of its letters."""
_BEYOND = 1.0
"""Gap between the end of a polyline and its text, in heights of the letters."""


@dataclass(frozen=True, eq=False)
class CutText:
    """lines: of the text.  outline: (n, 2) corners of an area; None of a polyline, whose sides are dimensions.
    place: (2,) the middle of the text, or the end of the polyline.  away: (2,) from there to the text, a unit vector; 0 of an
    area."""

    lines: tuple[str, ...]
    place: np.ndarray
    away: np.ndarray
    outline: np.ndarray | None = None

    def middles(self, height: float, width: Callable[[str], float], area: np.ndarray | None = None) -> np.ndarray:
        """(lines, 2) the middle of each line of the text.  height: of its letters; width: of a line, file units.
        area: (2, 2) least and largest coordinates, in which the text is kept; None: everywhere."""
        middle, half = self._box(height, width, area)
        return middle + np.outer(half[1] - (np.arange(len(self.lines)) + 0.5) * _LINE * height, [0.0, 1.0])

    def rectangle(self, height: float, width: Callable[[str], float], area: np.ndarray | None = None) -> np.ndarray:
        """(4, 2) corners of the text."""
        middle, half = self._box(height, width, area)
        return middle + half * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])

    def _box(self, height: float, width: Callable[[str], float], area: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
        half = np.array([max(map(width, self.lines)) / 2 + 0.2 * height, len(self.lines) * _LINE / 2 * height])
        middle = self.place + self.away * (_BEYOND * height + np.abs(self.away) @ half)
        if area is not None:
            middle = np.clip(middle, area[0] + half, np.maximum(area[1] - half, area[0] + half))
        return middle, half


def texts_of(measurements: Iterable[Measurement], paper: Callable[[np.ndarray], np.ndarray],
             holds: Callable[[np.ndarray], np.ndarray], unit: str) -> tuple[CutText, ...]:
    """Of the areas, and of the polylines of several sides, whose corners all lie in a cut.  paper, holds, unit: as for
    dimensions_of.  Where they lean out of the paper, the text says that the values are those in space."""
    made = (_area(measurement, paper, holds, unit) if measurement.kind == "area"
            else _total(measurement, paper, holds, unit) if measurement.kind == "polyline" and len(measurement.points) > 2
            else None for measurement in measurements)  # fmt: skip
    return tuple(text for text in made if text is not None)


def _area(measurement: Measurement, paper: Callable[[np.ndarray], np.ndarray], holds: Callable[[np.ndarray], np.ndarray],
          unit: str) -> CutText | None:
    flat, round_it = shapes_of(measurement).area, perimeter(measurement)
    if flat is None or round_it is None:
        return None
    corners = paper(flat)
    if not holds(corners).all():
        return None
    outline, result = corners[:, :2], evaluate(measurement)
    seen = _signed(outline)
    leans = _leans(abs(seen), result.value, decimals_of(result))
    lines = value_text(measurement, unit) + leans, f"perimeter {text_of(round_it, unit)}{leans}"
    return CutText(lines, _middle(outline, seen), np.zeros(2), outline)


def _total(measurement: Measurement, paper: Callable[[np.ndarray], np.ndarray], holds: Callable[[np.ndarray], np.ndarray],
           unit: str) -> CutText | None:
    corners = paper(np.array([point.position for point in measurement.points], np.float64))
    if not holds(corners).all():
        return None
    way, result = corners[:, :2], evaluate(measurement)
    seen = sum(float(np.linalg.norm(end - begin)) for begin, end in pairwise(way))
    line = f"total {text_of(result, unit)}{_leans(seen, result.value, decimals_of(result))}"
    last = way[-1] - way[-2]
    return CutText((line,), way[-1], last / max(float(np.linalg.norm(last)), 1e-300))


def _leans(seen: float, value: float, digits: int) -> str:
    """What follows a value that is not the one on the paper."""
    return "" if f"{seen:.{digits}f}" == f"{value:.{digits}f}" or abs(seen - value) <= 1e-6 * value else " in space"


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
