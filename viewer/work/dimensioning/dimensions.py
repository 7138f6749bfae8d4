"""Measured lengths as dimensions of a drawing: distances, sides of polylines, heights, ways to planes and diameters in a cut.

A dimension has the length of its two ends on the paper.  Where the way between them leans out of the paper, its text has the
length in space, too.  A diameter is drawn across what is round at right angles to its axis, so that it is never foreshortened.
Dimension lines are moved off what they measure, to alternating sides, until no text lies on another text or line.
Frame: paper coordinates, file units.
"""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..fits.fit import Fit
from ..measuring.measure_shapes import shapes_of
from ..measuring.measure_text import decimals_of, text_of
from ..measuring.measurement import KINDS, Measurement
from ..measuring.values import evaluate
from .cut_texts import CutText, texts_of

LINEAR = ("distance", "height", "point to plane", "plane to plane")
"""Kinds that are the length of one line."""
VALUE = "<>"
"""Stands in a text for the length that the drawing has between the ends, as in DXF."""
_MOST = 40
"""Steps by which a dimension is moved at most; beyond, it lies over others."""
OFFSET, _STEP = 1.5, 1.8
"""How far a dimension line lies from what it measures, and how far it is moved at a time, in heights of its text."""

Paper = Callable[[np.ndarray], np.ndarray]
"""(n, 3) file coordinates -> (n, 3) paper coordinates right and up, and depth."""


@dataclass(frozen=True)
class Dimension:
    """start, end: of what is measured, paper coordinates.  text: with VALUE for the length.  digits: after its point.
    offset: of the dimension line to the left of the way from start to end."""

    start: tuple[float, float]
    end: tuple[float, float]
    text: str
    digits: int
    offset: float = 0.0

    @property
    def length(self) -> float:
        """Between the ends."""
        return float(np.hypot(self.end[0] - self.start[0], self.end[1] - self.start[1]))

    @property
    def told(self) -> str:
        """The text with its length."""
        return self.text.replace(VALUE, f"{self.length:.{self.digits}f}")

    @property
    def angle(self) -> float:
        """Of the text, degrees, readable from below or from the right: above -90, up to 90."""
        angle = float(np.degrees(np.arctan2(self.end[1] - self.start[1], self.end[0] - self.start[0])))
        return angle - 180 if angle > 90 + 1e-9 else angle + 180 if angle <= -90 + 1e-9 else angle

    @property
    def line(self) -> np.ndarray:
        """(2, 2) the ends of the dimension line."""
        ends = np.array([self.start, self.end])
        along = ends[1] - ends[0]
        return ends + self.offset * np.array([-along[1], along[0]]) / np.hypot(*along)


@dataclass(frozen=True, eq=False)
class CutDimensions:
    """What was measured in a cut.  lines: lengths.  texts: of areas, and of whole polylines.  short: how many lengths in the
    cut have no dimension, because they are too short on the paper, or seen from their end."""

    lines: tuple[Dimension, ...] = ()
    texts: tuple[CutText, ...] = ()
    short: int = 0


def dimension_text(measurement: Measurement, unit: str) -> str:
    """The value of a length as it stands at a dimension line, with VALUE for its number: ``Ø <> ± 0.0004 m``."""
    result = evaluate(measurement)
    return KINDS[measurement.kind].before + text_of(result, unit).replace(f"{result.value:.{decimals_of(result)}f}", VALUE, 1)


def dimensions_of(measurements: Iterable[Measurement], paper: Paper, holds: Callable[[np.ndarray], np.ndarray], unit: str,
                  least: float) -> CutDimensions:  # fmt: skip
    """The lengths and areas that lie in a cut; each side of a polyline is a length, and the whole a text.

    paper: coordinates on it.  holds: (n,) bool of (n, 3) paper coordinates, which lie in the cut.  unit: name of it.
    least: length on the paper, file units, below which none is drawn: it is seen from its end.
    """
    found, short, measurements = [], 0, list(measurements)
    for measurement in (side for each in measurements for side in _sides(each)):
        ends = _ends(measurement, paper)
        if ends is None or not holds(ends).all():
            continue
        length, result = float(np.hypot(*(ends[1] - ends[0])[:2])), evaluate(measurement)
        if length < least:
            short += 1
            continue
        digits, text = decimals_of(result), dimension_text(measurement, unit)
        if f"{length:.{digits}f}" != f"{result.value:.{digits}f}" and abs(length - result.value) > 1e-9 * result.value:
            text = f"{VALUE} ({text.replace(VALUE, f'{result.value:.{digits}f}')} in space)"
        (x, y), (u, v) = ends[0, :2].tolist(), ends[1, :2].tolist()
        found.append(Dimension((x, y), (u, v), text, digits))
    return CutDimensions(tuple(found), texts_of(measurements, paper, holds, unit), short)


def _sides(measurement: Measurement) -> list[Measurement]:
    """A polyline as the distances of which it is made; any other measurement as it is."""
    if measurement.kind != "polyline":
        return [measurement]
    return [replace(measurement, kind="distance", points=pair) for pair in pairwise(measurement.points)]


def measured_line(measurement: Measurement) -> np.ndarray | None:
    """(2, 3) the ends of the length that a measurement is, file coordinates; None of other kinds."""
    if measurement.kind not in LINEAR:
        return None
    (line,) = [line for line in shapes_of(measurement).lines if not line.helper and not line.closed]
    return line.points


def _ends(measurement: Measurement, paper: Paper) -> np.ndarray | None:
    """(2, 3) paper coordinates of what a measurement measures; None where it is no length."""
    fit = measurement.fit
    if fit is not None and fit.kind in ("pipe", "circle"):
        return _across(fit, paper)
    line = measured_line(measurement)
    return None if line is None else paper(line)


def _across(fit: Fit, paper: Paper) -> np.ndarray:
    """The diameter that lies in the paper; of a pipe where its axis is nearest to the cut's plane."""
    place, axis = np.array(fit.place), np.array(fit.direction)
    at, further = paper(np.array([place, place + axis]))
    way = further - at
    if fit.kind == "pipe" and abs(way[2]) > 1e-9:
        at = at + np.clip(-at[2] / way[2], fit.low, fit.high) * way
    elif fit.kind == "pipe":
        at = at + (fit.low + fit.high) / 2 * way
    flat = np.array([-way[1], way[0], 0.0])
    size = float(np.hypot(*flat[:2]))
    half = fit.radius * (flat / size if size > 1e-6 else np.array([1.0, 0.0, 0.0]))
    return np.stack([at - half, at + half])


def laid_apart(dimensions: Sequence[Dimension], height: float, width: Callable[[str], float],
               area: np.ndarray | None = None, texts: Sequence[CutText] = ()) -> list[Dimension]:
    """The dimensions with their offsets, the shortest nearest to what they measure.

    height: of the texts, file units.  width: of a text, file units.  area: (2, 2) least and largest coordinates between which
    texts and lines lie; None: everywhere.  texts: on which none lies.  A dimension that finds no free place in _MOST
    steps has the first one in the area."""
    placed: list[Dimension] = []
    rectangles: list[tuple[np.ndarray, np.ndarray]] = []  # of the text and of the line
    written = [each.rectangle(height, width, area) for each in texts]
    found: dict[int, Dimension] = {}
    for number in sorted(range(len(dimensions)), key=lambda each: dimensions[each].length):
        tries = [replace(dimensions[number], offset=side * (OFFSET + _STEP * step) * height)
                 for step in range(_MOST) for side in (1.0, -1.0)]  # fmt: skip
        inside = None
        for chosen in tries:
            text, line = _rectangles(chosen, height, width(chosen.told))
            if area is not None and not all(((each >= area[0]) & (each <= area[1])).all() for each in (text, line)):
                continue
            inside = inside or chosen
            if any(_touch(text, other) or _touch(line, other) for other in written):
                continue
            if not any(_touch(text, other) or _touch(text, rule) or _touch(line, other)
                       or (_parallel(chosen, before) and _touch(line, rule))
                       for before, (other, rule) in zip(placed, rectangles, strict=True)):  # fmt: skip
                break
        else:
            chosen = inside or tries[0]
            text, line = _rectangles(chosen, height, width(chosen.told))
        placed.append(chosen)
        rectangles.append((text, line))
        found[number] = chosen
    return [found[number] for number in range(len(dimensions))]


def _rectangles(dimension: Dimension, height: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    """(4, 2) corners of the text, above the middle of the dimension line, and of the line with room for its ticks."""
    line, turn = dimension.line, np.radians(dimension.angle)
    along, up = np.array([np.cos(turn), np.sin(turn)]), np.array([-np.sin(turn), np.cos(turn)])
    middle, half = line.mean(axis=0), dimension.length / 2
    return (_corners(middle + height * up, along * (width / 2 + 0.2 * height), up * 0.75 * height),
            _corners(middle, along * (half + 0.3 * height), up * 0.2 * height))


def _corners(middle: np.ndarray, along: np.ndarray, up: np.ndarray) -> np.ndarray:
    return np.array([middle + a * along + b * up for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])


def _touch(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether two rectangles overlap: no side of either separates them."""
    for corners in (one, other):
        for side in (corners[1] - corners[0], corners[3] - corners[0]):
            a, b = one @ side, other @ side
            if a.max() <= b.min() or b.max() <= a.min():
                return False
    return True


def _parallel(one: Dimension, other: Dimension) -> bool:
    return abs((one.angle - other.angle + 90) % 180 - 90) < 10
