"""Measurements of the project as a page shows them: values in words, lines in the page's frame.

Frame: the upright world relative to the publication's origin, file units.
"""

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from ...common.text import with_whole_characters
from ...work.measuring.measure_shapes import shapes_of
from ...work.measuring.measure_text import components_text, fit_text, silhouette_text, value_text, volume_text
from ...work.measuring.measurement import KINDS, Measurement
from ...work.measuring.values import components

Local = Callable[[np.ndarray], np.ndarray]
_MOST_POINTS = 256
"""Of a line, which the page projects in every picture: a profile may have thousands, closer than a pixel."""


def measurements_data(measurements: Iterable[Measurement], unit: str, local: Local) -> list[dict[str, Any]]:
    """One value a measurement.  local: file coordinates (n, 3) -> the page's.  The names of scans are left out: they are those
    of files."""
    return [_data(measurement, number, unit, local) for number, measurement in enumerate(measurements, 1)]


def _data(measurement: Measurement, number: int, unit: str, local: Local) -> dict[str, Any]:
    kind, shapes = KINDS[measurement.kind], shapes_of(measurement)
    parts = components(measurement)
    more = ("" if parts is None else components_text(parts, unit), fit_text(measurement, unit),
            volume_text(measurement, unit), silhouette_text(measurement))  # fmt: skip
    lines = [(line.points, line.closed, line.helper) for line in shapes.lines]
    lines += [(ring.points, True, False) for ring in shapes.rings]
    points = shapes.points if shapes.place is None else np.concatenate([shapes.points, shapes.place[None]])
    return {
        "name": with_whole_characters(measurement.name) or f"{kind.name} {number}", "kind": kind.name,
        "text": value_text(measurement, unit), "more": "\n".join(text for text in more if text),
        "label": _rounded(local(shapes.label[None]))[0], "points": _rounded(local(points)),
        "lines": [{"points": _rounded(local(thinned(line))), "closed": closed, "helper": helper}
                  for line, closed, helper in lines],
    }  # fmt: skip


def thinned(points: np.ndarray) -> np.ndarray:
    """At most _MOST_POINTS of a line's points (n, 3), the first and the last among them."""
    if len(points) <= _MOST_POINTS:
        return points
    return points[np.rint(np.linspace(0, len(points) - 1, _MOST_POINTS)).astype(int)]


def _rounded(points: np.ndarray) -> list[list[float]]:
    """To a hundred-thousandth of a unit, which is below what is drawn."""
    return np.round(points, 5).tolist()
