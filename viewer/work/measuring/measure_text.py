"""Measurements as a person reads them: with the digits that their uncertainty supports, and the unit of the file."""

import math
from collections.abc import Sequence

import numpy as np

from ...common.text import printable
from .measurement import KINDS, Measurement
from .planes import edge_angle
from .values import Components, Result, evaluate


def unit_name(metres_per_unit: float | None) -> str:
    """The file's unit: m, ft, mm, ... or ``units`` where the file does not say."""
    if metres_per_unit is None:
        return "units"
    known = {1.0: "m", 0.3048: "ft", 1200 / 3937: "ftUS", 0.001: "mm", 0.01: "cm", 0.0254: "in", 1000.0: "km"}
    for size, name in known.items():
        if abs(metres_per_unit - size) <= 1e-9 * size:
            return name
    return f"x {metres_per_unit:g} m"


def length_text(length: float, metres_per_unit: float | None) -> str:
    """A length with three significant digits and the file's unit; in metres where that has no name."""
    unit = unit_name(metres_per_unit)
    if unit.startswith("x "):
        length, unit = length * (metres_per_unit or 1.0), "m"
    text = np.format_float_positional(length, 3, unique=False, fractional=False, trim="-")
    return f"{text} {'unit' if (text, unit) == ('1', 'units') else unit}"


def unit_text(power: int | None, unit: str) -> str:
    """The unit of a value: degrees for power 0; of a place that of a length."""
    return {0: "°", 1: unit, 2: f"{unit}²", 3: f"{unit}³", None: unit}[power]


def text_of(result: Result, unit: str, *, stated: bool = True) -> str:
    """``3.998 ± 0.006 m``: as many digits as the uncertainty supports, at least three significant ones of the value.  Of a
    place ``x 3.998, y 1.203, z 0.004 ± 0.006 m``.  stated: whether the uncertainty is written."""
    digits = decimals_of(result)
    gap = "" if result.power == 0 else " "
    known = f" ± {result.uncertainty:.{digits}f}" if stated and result.uncertainty > 0 else ""
    value = f"{result.value:z.{digits}f}"
    if result.place is not None:
        value = ", ".join(f"{axis} {along:z.{digits}f}" for axis, along in zip("xyz", result.place, strict=True))
    return f"{value}{known}{gap}{unit_text(result.power, unit)}"


def value_text(measurement: Measurement, unit: str) -> str:
    """The value of a measurement as it is written beside it: ``Ø 0.1142 ± 0.0004 m``."""
    return KINDS[measurement.kind].before + text_of(evaluate(measurement), unit)


def labels_of(measurements: Sequence[Measurement], unit: str) -> list[str]:
    """What is written beside each measurement in a picture: its value, behind its name where there are several."""
    texts = [value_text(measurement, unit) for measurement in measurements]
    if len(texts) < 2:
        return texts
    return [f"{measurement.name}  {text}" for measurement, text in zip(measurements, texts, strict=True)]


def components_text(parts: Components, unit: str) -> str:
    """Two lines, ``horizontal 3.998, vertical -0.012 m`` and ``dx 3.101, dy 2.523, dz -0.012 m``, with the digits of
    :func:`text_of`: the uncertainty of each is that of the distance."""
    digits = decimals_of(Result(float(np.linalg.norm(parts.along)), parts.uncertainty, 1, of_points=parts.of_points))
    horizontal, vertical, dx, dy, dz = (f"{value:z.{digits}f}" for value in (parts.horizontal, parts.vertical, *parts.along))
    return f"horizontal {horizontal}, vertical {vertical} {unit}\ndx {dx}, dy {dy}, dz {dz} {unit}"


def silhouette_text(measurement: Measurement) -> str:
    """What is said of a measurement with points on a silhouette; "" of others."""
    on_it = sum(point.beyond is not None for point in measurement.points)
    if not on_it or measurement.kind == "volume":  # its polygon is what was clicked
        return ""
    which = "" if on_it == len(measurement.points) else "one point " if on_it == 1 else f"{on_it} points "
    return f"{which}on a silhouette: less exact{'; Pipe fits the diameter' if measurement.kind == 'distance' else ''}"


def volume_text(measurement: Measurement, unit: str) -> str:
    """Lines about a volume: what lies above and below the base, the base, and what of the area was not measured; "" of other
    kinds."""
    if (volume := measurement.volume) is None:
        return ""
    above = text_of(Result(volume.cut, volume.cut_uncertainty, 3), unit)
    below = text_of(Result(volume.fill, volume.fill_uncertainty, 3), unit)
    tilt = math.degrees(math.atan(math.hypot(*volume.slope)))
    lines = [f"cut (above) {above}", f"fill (below) {below}",
             f"base at height {base_height(measurement):.3f} {unit}, {f'{tilt:.1f}° inclined' if tilt > 0.05 else 'level'}"]
    if volume.in_box:
        lines = [f"in the box {above}", lines[2]]
    if volume.dates:
        before, after = map(printable, volume.dates)
        lines = [f"cut (taken away) {above}", f"fill (added) {below}", f"from {before} to {after}"]
    area = text_of(Result(volume.area, 0.0, 2), unit)
    lines.append(f"{area} in cells of {volume.cell:.2g} {unit}, {volume.count:,} points")
    if volume.empty >= 0.005:
        lines.append(f"{100 * volume.empty:.0f} % of the area has no points: interpolated, less exact")
    if volume.layered >= 0.02:
        lines.append(f"{100 * volume.layered:.0f} % of the area has walls or two surfaces: clip away what is not meant")
    return "\n".join(lines)


def base_height(measurement: Measurement) -> float:
    """Of a volume's base in the middle of its polygon, along the up axis; 0 of other kinds."""
    return 0.0 if measurement.volume is None else float(np.dot(measurement.volume.place, measurement.up))


def fit_text(measurement: Measurement, unit: str) -> str:
    """One line or two about fitted surfaces; "" of other kinds."""
    if not measurement.fits:
        return ""
    sigmas = ", ".join(f"{fit.sigma:.2g}" for fit in measurement.fits)
    scatter = f"scatter {sigmas} {unit} (1 sigma), {sum(fit.count for fit in measurement.fits):,} points used"
    if measurement.kind == "plane to plane":
        first, second = measurement.points
        apart = edge_angle(first, second)
        unsure = math.hypot(*(fit.tilt_uncertainty for fit in measurement.fits))
        return f"{text_of(Result(min(apart, 180.0 - apart), unsure, 0), unit)} from parallel\n{scatter}"
    fit = measurement.fit
    if fit is None or fit.kind == "plane":
        return scatter
    upright = f"{fit.tilt(measurement.up):.1f}° from upright, {fit.seen:.0f}° of its round seen"
    return f"{f'length {fit.high - fit.low:.3f} {unit}, ' if fit.kind == 'pipe' else ''}{upright}\n{scatter}"


def decimals_of(result: Result) -> int:
    """Decimals such that the uncertainty of the points has one digit or two: how far a contour may lie beyond them is an
    estimate, which must not take the digits of what was measured."""
    scale = result.uncertainty if result.of_points is None else result.of_points
    scale = scale if scale > 0 else max(abs(result.value), 1e-9) * 1e-3
    return int(np.clip(np.ceil(-np.log10(scale)), 0, 9))
