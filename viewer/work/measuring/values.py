"""The value of a measurement and its uncertainty.

Uncertainty (GUM, JCGM 100:2008, 5.1.2): a value f of points p_i has the variance sum |df/dp_i|^2 s_i^2.  A point that was
snapped to stands for a place up to half the point spacing d away, evenly distributed, which has the variance d^2 / 12 along an
axis (4.3.7); the range noise n adds n^2.  So s_i^2 = d^2 / 12 + n^2, taken to be the same in all directions, which is on the
safe side along a surface.  d and n are measured around each point on the scan itself (viewer.work.places.pick).  What is
stated is the expanded uncertainty with k = 2 (95 %).  A point on a silhouette lies short of the contour by up to b_i, always to
the same side (viewer.work.fits.silhouette): |df/dp_i b_i| is added to the expanded uncertainty, as of a systematic effect that
is not corrected (F.2.4.5).  Errors of the registration or of the instrument's scale are not in it.
Frame: file coordinates, file units; angles in degrees.
"""

from dataclasses import dataclass, replace

import numpy as np

from ...picture.clip import Vector
from .measurement import KINDS, Measurement
from .planes import OF_PLANES

COVERAGE = 2.0
"""Factor from standard to expanded uncertainty; 95 % where errors are normal."""


@dataclass(frozen=True)
class Result:
    """value, uncertainty: file units to the power of ``power``, or degrees where it is 0; the uncertainty is expanded (k = 2).
    residual: of an area, the root mean square distance of its corners from the plane, of a fit the scatter of its points around
    the surface, the larger of several, file units; else 0.
    place: file coordinates, where the value is a place; power is None then, value 0, and the uncertainty that of the direction
    in which it is largest, file units.
    of_points: the uncertainty without what lies beyond silhouettes, which tells the digits of the value; None: the same."""

    value: float
    uncertainty: float
    power: int | None
    residual: float = 0.0
    place: Vector | None = None
    of_points: float | None = None


def evaluate(measurement: Measurement) -> Result:
    """The value of a measurement and its uncertainty."""
    result = _evaluated(measurement)
    plain = tuple(replace(point, beyond=None) for point in measurement.points)
    if plain == measurement.points:
        return result
    return replace(result, of_points=_evaluated(replace(measurement, points=plain)).uncertainty)


def _evaluated(measurement: Measurement) -> Result:
    power = KINDS[measurement.kind].power
    residual = max((fit.sigma for fit in measurement.fits), default=0.0)
    if (of_planes := OF_PLANES.get(measurement.kind)) is not None:
        value, spread, place = of_planes(measurement.points)
        return Result(value, spread, power, residual, place)
    if (volume := measurement.volume) is not None:
        return Result(volume.net, volume.uncertainty, power)
    if (fit := measurement.fit) is not None:
        if fit.kind == "plane":
            return Result(fit.tilt(measurement.up), fit.tilt_uncertainty, power, residual)
        return Result(2 * fit.radius, 2 * fit.radius_uncertainty, power, residual)
    points = np.array([point.position for point in measurement.points], np.float64)
    middle = points.mean(axis=0)
    if measurement.kind == "angle":
        value, slopes = _angle(points - middle)
    elif measurement.kind == "area":
        value, slopes, residual = _area(points - middle)
    elif measurement.kind == "height":
        up = np.array(measurement.up)
        rise = float((points[1] - points[0]) @ up)
        value, slopes = abs(rise), np.array([-up, up])
    elif measurement.kind == "profile":
        up = np.array(measurement.up)
        value, slopes = _length(points - np.outer((points - middle) @ up, up))
    else:
        value, slopes = _length(points)
    return Result(value, _spread(slopes, measurement), power, residual)


def perimeter(measurement: Measurement) -> Result | None:
    """The length of the way round an area through its corners, in space; None of other kinds."""
    if measurement.kind != "area":
        return None
    points = np.array([point.position for point in measurement.points], np.float64)
    value, slopes = _length(np.concatenate([points, points[:1]]))
    slopes[0] += slopes[-1]  # the way ends where it began
    return Result(value, _spread(slopes[:-1], measurement), 1)


def _spread(slopes: np.ndarray, measurement: Measurement) -> float:
    """Expanded uncertainty of a value with the derivatives (n, 3) by the points of a measurement."""
    variances = np.array([point.variance for point in measurement.points])
    spread = COVERAGE * float(np.sqrt((np.sum(slopes**2, axis=1) * variances).sum()))
    return spread + sum(abs(float(slope @ point.beyond)) for slope, point in zip(slopes, measurement.points, strict=True)
                        if point.beyond is not None)  # fmt: skip


@dataclass(frozen=True)
class Components:
    """Of the way from the first to the second point of a distance, file units.  along: dx, dy, dz, signed, along the axes of
    the file.  horizontal: the length across the up axis.  vertical: signed along it.  uncertainty: of each, expanded (k = 2);
    of_points: without what lies beyond silhouettes."""

    along: Vector
    horizontal: float
    vertical: float
    uncertainty: float
    of_points: float


def components(measurement: Measurement) -> Components | None:
    """The parts of a distance; None of other kinds.

    Each part changes by as much as a point moves along it (its derivative by each point has length 1), so that all have the
    uncertainty of the distance itself; of points on silhouettes, the most that any part may have.
    """
    if measurement.kind != "distance":
        return None
    first, second = (np.array(point.position, np.float64) for point in measurement.points)
    way, up = second - first, np.array(measurement.up)
    vertical = float(way @ up)
    of_points = COVERAGE * float(np.sqrt(sum(point.variance for point in measurement.points)))
    beyond = sum(float(np.linalg.norm(point.beyond)) for point in measurement.points if point.beyond is not None)
    dx, dy, dz = way.tolist()
    return Components((dx, dy, dz), float(np.linalg.norm(way - vertical * up)), vertical, of_points + beyond, of_points)


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
