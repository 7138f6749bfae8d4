"""Measurements between measured points: length, height difference, angle and area, and of surfaces fitted at a point: slope and
diameter; each with its uncertainty.

Uncertainty (GUM, JCGM 100:2008, 5.1.2): a value f of points p_i has the variance sum |df/dp_i|^2 s_i^2.  A point that was
snapped to stands for a place up to half the point spacing d away, evenly distributed, which has the variance d^2 / 12 along an
axis (4.3.7); the range noise n adds n^2.  So s_i^2 = d^2 / 12 + n^2, taken to be the same in all directions, which is on the
safe side along a surface.  d and n are measured around each point on the scan itself (viewer.work.places.pick).  What is
stated is the expanded uncertainty with k = 2 (95 %).  Errors of the registration or of the instrument's scale are not in it.
Frame: file coordinates, file units; angles in degrees.
"""

from dataclasses import dataclass, field

import numpy as np

from ..common.errors import InputError
from ..picture.clip import Vector
from ..picture.json_values import UNLESS_DEFAULT
from .fits.fit import KINDS as FITTED
from .fits.fit import Fit

COVERAGE = 2.0
"""Factor from standard to expanded uncertainty; 95 % where errors are normal."""
@dataclass(frozen=True)
class Kind:
    """What can be measured.  name: as a person reads it.  fewest, most: points, None for any number.  power: of the length unit
    in the value, 0: degrees.  what: is measured, in a few words.  click: what the first click is to hit.  before: is written
    before a value."""

    name: str
    fewest: int
    most: int | None
    power: int
    what: str
    click: str = "the first point"
    before: str = ""


KINDS = {
    "distance": Kind("Distance", 2, 2, 1, "straight line between two points"),
    "polyline": Kind("Polyline", 2, None, 1, "length along several points"),
    "height": Kind("Height", 2, 2, 1, "difference of two points along the up axis"),
    "angle": Kind("Angle", 3, 3, 0, "at the second of three points"),
    "area": Kind("Area", 3, None, 2, "of a polygon, projected on the plane that fits its corners best"),
    "plane": Kind("Plane", 1, 1, 0, "slope of the flat surface at a point, fitted to all of it that is measured",
                  "a flat surface", "slope "),
    "pipe": Kind("Pipe", 1, 1, 1, "diameter of the pipe, column or tank at a point, fitted to all of it that is measured",
                 "a pipe, a column or a tank", "Ø "),
    "circle": Kind("Circle", 1, 1, 1, "diameter of the cross-section at a point, of what tapers or is bent",
                   "what is round", "Ø "),
}  # fmt: skip
"""Each kind in one row; those of viewer.work.fits.fit.KINDS are fitted."""


@dataclass(frozen=True)
class MeasuredPoint:
    """A point of a measurement.  position: file coordinates of a measured point, as in the file; the grid's
    (viewer.work.places.pick) until that has been read, and where it cannot be.  spacing, noise: of the points around it, file
    units; noise is the standard deviation from the local plane.  scan: where it is from, for the list.
    fit: the surface at the point, of a measurement of a fitted kind."""

    position: Vector
    spacing: float = 0.0
    noise: float = 0.0
    scan: str = ""
    fit: Fit | None = field(default=None, metadata=UNLESS_DEFAULT)

    @property
    def variance(self) -> float:
        """Of one coordinate, file units squared."""
        return self.spacing**2 / 12 + self.noise**2


@dataclass(frozen=True)
class Measurement:
    """kind: a key of KINDS.  points: in the order in which they were set.  up: the up axis when it was made, for heights.

    Raises InputError where the kind or the number of points is wrong.
    """

    kind: str
    points: tuple[MeasuredPoint, ...]
    name: str = ""
    up: Vector = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"measurement {self.name!r}: kind {self.kind!r}: expected one of {', '.join(KINDS)}")
        fewest, most = KINDS[self.kind].fewest, KINDS[self.kind].most
        if len(self.points) < fewest or (most is not None and len(self.points) > most):
            raise InputError(f"measurement {self.name!r}: {len(self.points)} points; a measurement of {self.kind} has {fewest}"
                             f"{'' if most == fewest else ' or more'}")
        wanted = self.kind if self.kind in FITTED else None
        if any((None if point.fit is None else point.fit.kind) != wanted for point in self.points):
            raise InputError(f"measurement {self.name!r}: a measurement of {self.kind} has points with "
                             f"{'no fit' if wanted is None else f'a fit of a {wanted}'}")

    @property
    def fit(self) -> Fit | None:
        """The fitted surface of a fitted kind."""
        return self.points[0].fit


@dataclass(frozen=True)
class Begun:
    """A measurement that is not ended yet: its kind and the points set so far.  Raises InputError where the kind is unknown."""

    kind: str
    points: tuple[MeasuredPoint, ...]

    def __post_init__(self) -> None:
        kinds = [kind for kind in KINDS if kind not in FITTED]
        if self.kind not in kinds:
            raise InputError(f"a measurement not ended: kind {self.kind!r}: expected one of {', '.join(kinds)}")


@dataclass(frozen=True)
class Result:
    """value, uncertainty: file units to the power of ``power``, or degrees where it is 0; the uncertainty is expanded (k = 2).
    residual: of an area, the root mean square distance of its corners from the plane, of a fit the scatter of its points around
    the surface, file units; else 0."""

    value: float
    uncertainty: float
    power: int
    residual: float = 0.0


def evaluate(measurement: Measurement) -> Result:
    """The value of a measurement and its uncertainty."""
    if (fit := measurement.fit) is not None:
        if fit.kind == "plane":
            return Result(fit.tilt(measurement.up), fit.tilt_uncertainty, 0, fit.sigma)
        return Result(2 * fit.radius, 2 * fit.radius_uncertainty, 1, fit.sigma)
    points = np.array([point.position for point in measurement.points], np.float64)
    variances = np.array([point.variance for point in measurement.points])
    middle = points.mean(axis=0)
    residual = 0.0
    if measurement.kind == "angle":
        value, slopes = _angle(points - middle)
    elif measurement.kind == "area":
        value, slopes, residual = _area(points - middle)
    elif measurement.kind == "height":
        up = np.array(measurement.up)
        rise = float((points[1] - points[0]) @ up)
        value, slopes = abs(rise), np.array([-up, up])
    else:
        value, slopes = _length(points)
    spread = COVERAGE * float(np.sqrt((np.sum(slopes**2, axis=1) * variances).sum()))
    return Result(value, spread, KINDS[measurement.kind].power, residual)


@dataclass(frozen=True)
class Components:
    """Of the way from the first to the second point of a distance, file units.  along: dx, dy, dz, signed, along the axes of
    the file.  horizontal: the length across the up axis.  vertical: signed along it.  uncertainty: of each, expanded (k = 2).
    """

    along: Vector
    horizontal: float
    vertical: float
    uncertainty: float


def components(measurement: Measurement) -> Components | None:
    """The parts of a distance; None of other kinds.

    Each part changes by as much as a point moves along it (its derivative by each point has length 1), so that all have the
    uncertainty of the distance itself.
    """
    if measurement.kind != "distance":
        return None
    first, second = (np.array(point.position, np.float64) for point in measurement.points)
    way, up = second - first, np.array(measurement.up)
    vertical = float(way @ up)
    spread = COVERAGE * float(np.sqrt(sum(point.variance for point in measurement.points)))
    dx, dy, dz = way.tolist()
    return Components((dx, dy, dz), float(np.linalg.norm(way - vertical * up)), vertical, spread)


def components_text(parts: Components, unit: str) -> str:
    """Two lines, ``horizontal 3.998, vertical -0.012 m`` and ``dx 3.101, dy 2.523, dz -0.012 m``, with the digits of
    :func:`text_of`: the uncertainty of each is that of the distance."""
    digits = _decimals(Result(float(np.linalg.norm(parts.along)), parts.uncertainty, 1))
    horizontal, vertical, dx, dy, dz = (f"{value:.{digits}f}" for value in (parts.horizontal, parts.vertical, *parts.along))
    return f"horizontal {horizontal}, vertical {vertical} {unit}\ndx {dx}, dy {dy}, dz {dz} {unit}"


def _length(points: np.ndarray) -> tuple[float, np.ndarray]:
    """Length of a line through (n, 3) points, and its derivative by each."""
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    along = steps / np.maximum(lengths, 1e-300)[:, None]
    slopes = np.zeros_like(points)
    slopes[1:] += along
    slopes[:-1] -= along
    return float(lengths.sum()), slopes


def _angle(points: np.ndarray) -> tuple[float, np.ndarray]:
    """Degrees at the second of three points, and its derivative by each; 0 where two of them coincide."""
    (a, at, b), slopes = points, np.zeros((3, 3))
    one, other = a - at, b - at
    long, wide = np.linalg.norm(one), np.linalg.norm(other)
    if long == 0 or wide == 0:
        return 0.0, slopes
    u, v = one / long, other / wide
    cosine, sine = float(u @ v), float(np.linalg.norm(np.cross(u, v)))
    angle = np.degrees(np.arctan2(sine, cosine))
    # Moving an arm's end sideways by e turns it by e / length; towards or away from the other arm it makes no difference
    # which direction exactly where both arms lie in one line: any sideways move counts then.
    side_u = (cosine * u - v) / sine if sine > 1e-9 else _sideways(u)
    side_v = (cosine * v - u) / sine if sine > 1e-9 else _sideways(v)
    slopes[0], slopes[2] = np.degrees(side_u) / long, np.degrees(side_v) / wide
    slopes[1] = -slopes[0] - slopes[2]
    return float(angle), slopes


def _sideways(direction: np.ndarray) -> np.ndarray:
    """A unit vector at right angles to ``direction``."""
    across = np.cross(direction, np.eye(3)[np.abs(direction).argmin()])
    return across / np.linalg.norm(across)


def fitted_plane(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, float]:
    """The plane nearest to (n, 3) points by least squares: a point of it, its unit normal, and the RMS distance to it."""
    middle = points.mean(axis=0)
    _, size, axes = np.linalg.svd(points - middle, full_matrices=True)
    rest = float(size[2]) if len(size) == 3 else 0.0
    return middle, axes[2], rest / float(np.sqrt(len(points)))


def _area(points: np.ndarray) -> tuple[float, np.ndarray, float]:
    """Area of a polygon projected on its fitted plane, its derivative by each corner, and the RMS distance to the plane."""
    _, normal, residual = fitted_plane(points)
    after, before = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
    signed = 0.5 * float(np.cross(points, after).sum(axis=0) @ normal)
    slopes = 0.5 * np.cross(after - before, normal)
    return abs(signed), np.sign(signed) * slopes, residual


def unit_name(metres_per_unit: float | None) -> str:
    """The file's unit: m, ft, mm, ... or ``units`` where the file does not say."""
    if metres_per_unit is None:
        return "units"
    known = {1.0: "m", 0.3048: "ft", 1200 / 3937: "ftUS", 0.001: "mm", 0.01: "cm", 0.0254: "in", 1000.0: "km"}
    for size, name in known.items():
        if abs(metres_per_unit - size) <= 1e-9 * size:
            return name
    return f"x {metres_per_unit:g} m"


def unit_text(power: int, unit: str) -> str:
    """The unit of a value: degrees for power 0."""
    return {0: "°", 1: unit, 2: f"{unit}²"}[power]


def text_of(result: Result, unit: str) -> str:
    """``3.998 ± 0.006 m``: as many digits as the uncertainty supports, at least three significant ones of the value."""
    digits = _decimals(result)
    gap = "" if result.power == 0 else " "
    known = f" ± {result.uncertainty:.{digits}f}" if result.uncertainty > 0 else ""
    return f"{result.value:.{digits}f}{known}{gap}{unit_text(result.power, unit)}"


def value_text(measurement: Measurement, unit: str) -> str:
    """The value of a measurement as it is written beside it: ``Ø 0.1142 ± 0.0004 m``."""
    return KINDS[measurement.kind].before + text_of(evaluate(measurement), unit)


def fit_text(measurement: Measurement, unit: str) -> str:
    """Two lines about a fitted surface; "" of other kinds."""
    if (fit := measurement.fit) is None:
        return ""
    scatter = f"scatter {fit.sigma:.2g} {unit} (1 sigma), {fit.count:,} points used"
    if fit.kind == "plane":
        return scatter
    upright = f"{fit.tilt(measurement.up):.1f}° from upright, {fit.seen:.0f}° of its round seen"
    return f"{f'length {fit.high - fit.low:.3f} {unit}, ' if fit.kind == 'pipe' else ''}{upright}\n{scatter}"


def _decimals(result: Result) -> int:
    """Decimals such that the uncertainty has one digit or two."""
    scale = result.uncertainty if result.uncertainty > 0 else max(abs(result.value), 1e-9) * 1e-3
    return int(np.clip(np.ceil(-np.log10(scale)), 0, 9))
