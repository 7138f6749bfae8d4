"""Distances, angles and corners of fitted planes (viewer.work.measuring.planes): by plain geometry, and their uncertainty by
repeated drawing of the planes (Monte Carlo)."""

from dataclasses import replace

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.clip import vector
from pointglass.viewer.work.fits.fit import Fit
from pointglass.viewer.work.measuring.measure_text import fit_text, value_text
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.measuring.values import evaluate

DRAWN = 1500


def unit(way) -> np.ndarray:
    return np.asarray(way, float) / np.linalg.norm(way)


def plane(place, normal, offset: float = 0.0, tilt: float = 0.0) -> Fit:
    """offset, tilt: standard uncertainties, units and degrees."""
    return Fit("plane", vector(place), vector(unit(normal)), 0.0, -1.0, 1.0, 0.0, 0.002, 500, 0.0, 2 * tilt, 2 * offset)


def on(fit: Fit, random, reach: float = 1.0) -> MeasuredPoint:
    """A point with noise at a place of a plane."""
    across = np.cross(fit.direction, random.normal(size=3))
    return MeasuredPoint(vector(np.array(fit.place) + reach * unit(across) + 0.002 * random.normal() * np.array(fit.direction)),
                         fit=fit)


def drawn(random, point: MeasuredPoint) -> MeasuredPoint:
    """The same point where its plane, or itself where it has none, is off by its standard uncertainty."""
    if (fit := point.fit) is None:
        return replace(point, position=vector(np.array(point.position) + random.normal(size=3) * np.sqrt(point.variance)))
    normal = np.array(fit.direction)
    turned = normal + np.cross(normal, random.normal(size=3)) * np.radians(fit.tilt_uncertainty / 2)
    place = np.array(fit.place) + normal * random.normal() * fit.offset_uncertainty / 2
    return replace(point, fit=replace(fit, place=vector(place), direction=vector(unit(turned))))


def clearance(point: MeasuredPoint, fit: Fit) -> float:
    return abs(float((np.array(point.position) - fit.place) @ np.array(fit.direction)))


def room(random, offset: float = 0.002, tilt: float = 0.05) -> list[Fit]:
    """Three planes that meet, not at right angles, at map coordinates."""
    normals = np.linalg.qr(random.normal(size=(3, 3)))[0] + random.uniform(-0.3, 0.3, (3, 3))
    shift = random.uniform(-1e6, 1e6, 3)
    return [plane(shift + random.uniform(-3, 3, 3), normal, offset, tilt) for normal in normals]


def test_values_agree_with_plain_geometry(seed):
    random = np.random.default_rng(seed)
    for _ in range(30):
        planes = room(random)
        points = [on(fit, random) for fit in planes]
        corner = evaluate(Measurement("corner", tuple(points)))
        assert corner.place is not None and corner.power is None
        for fit in planes:
            assert np.dot(np.array(corner.place) - fit.place, fit.direction) == pytest.approx(0.0, abs=1e-8)
        first, second, _ = planes
        away = MeasuredPoint(vector(np.array(first.place) + 1.25 * np.array(first.direction)))
        assert evaluate(Measurement("point to plane", (points[0], away))).value == pytest.approx(1.25, abs=1e-8)
        opposite = plane(np.array(first.place) - 2.5 * np.array(first.direction), -np.array(first.direction))
        assert evaluate(Measurement("plane to plane", (points[0], on(opposite, random)))).value == pytest.approx(2.5, abs=1e-8)
        between = np.degrees(np.arccos(abs(np.dot(first.direction, second.direction))))
        assert evaluate(Measurement("edge", tuple(points[:2]))).value == pytest.approx(
            min([between, 180 - between], key=lambda v: abs(v - evaluate(Measurement("edge", tuple(points[:2]))).value)))


@pytest.mark.parametrize("angle", [0.5, 30.0, 89.0, 91.0, 150.0, 179.0])
def test_the_angle_is_that_of_the_wedge_on_whose_faces_the_points_lie(angle, seed):
    """Whichever way the normals point, and whether the wedge is a room's corner or a beam's edge."""
    random = np.random.default_rng(seed)
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    turn = np.radians(angle)
    faces = [np.array([1.0, 0.0, 0.0]), np.array([np.cos(turn), np.sin(turn), 0.0])]
    normals = [np.array([0.0, 1.0, 0.0]), np.array([-np.sin(turn), np.cos(turn), 0.0])]
    for signs in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        points = []
        for face, normal, sign in zip(faces, normals, signs, strict=True):
            place = axes @ (face * random.uniform(1, 3) + [0.0, 0.0, random.uniform(-1, 1)])
            points.append(MeasuredPoint(vector(place), fit=plane(place, sign * axes @ normal, 1e-4, 1e-3)))
        assert evaluate(Measurement("edge", tuple(points))).value == pytest.approx(angle, abs=1e-6)


def test_two_pieces_of_one_plane_have_180_degrees_between_them(seed):
    random = np.random.default_rng(seed)
    normal = unit(random.normal(size=3))
    across = unit(np.cross(normal, random.normal(size=3)))
    for sign in (1, -1):
        for step in (-5e-4, 5e-4):
            points = (MeasuredPoint((0.0, 0.0, 0.0), fit=plane((0, 0, 0), normal, 0.001, 0.01)),
                      MeasuredPoint(vector(2 * across), fit=plane(2 * across + step * normal, sign * normal, 0.001, 0.01)))
            assert evaluate(Measurement("edge", points)).value == pytest.approx(180.0, abs=1e-5)


@pytest.mark.parametrize("kind", ["point to plane", "plane to plane", "edge", "corner"])
def test_uncertainty_is_what_repeated_drawing_of_the_planes_shows(kind, seed):
    random = np.random.default_rng(seed)
    for _ in range(2):
        while True:
            planes = room(random, float(random.uniform(0.001, 0.004)), float(random.uniform(0.02, 0.2)))
            points = [on(fit, random, float(random.uniform(0, 3))) for fit in planes]
            if min(clearance(points[0], planes[1]), clearance(points[1], planes[0])) > 0.1:
                break  # which wedge is meant does not depend on the noise
        if kind == "point to plane":
            points = [points[0], MeasuredPoint(vector(np.array(planes[0].place) + random.uniform(1, 3, 3)), noise=0.003)]
        elif kind == "plane to plane":
            opposite = np.array(planes[0].direction) + random.normal(size=3) * 0.02
            points = [points[0], on(plane(np.array(planes[0].place) + opposite, opposite, 0.002, 0.1), random, 1.0)]
        measurement = Measurement(kind, tuple(points[: 3 if kind == "corner" else 2]))
        again = [evaluate(replace(measurement, points=tuple(drawn(random, point) for point in measurement.points)))
                 for _ in range(DRAWN)]  # fmt: skip
        if kind == "corner":
            places = np.array([result.place for result in again])
            spread = np.sqrt(np.linalg.eigvalsh(np.cov((places - places.mean(axis=0)).T))[-1])
        else:
            spread = np.std([result.value for result in again])
        assert evaluate(measurement).uncertainty / 2 == pytest.approx(spread, rel=0.12)


def test_planes_without_a_corner_are_refused(seed):
    random = np.random.default_rng(seed)
    first, second, _ = room(random)
    third = replace(first, place=vector(np.array(first.place) + 1.0))
    along = plane(first.place, np.array(first.direction) + np.array(second.direction))
    for planes in ((first, second, third), (first, second, along)):
        with pytest.raises(InputError, match="they have no corner"):
            Measurement("corner", tuple(on(fit, random) for fit in planes), "C")


def test_text_names_the_place_of_a_corner_and_how_far_planes_are_from_parallel():
    floor, wall, other = (plane((1.0, 2.0, 3.0), normal, 0.0015, 0.0) for normal in np.eye(3))
    corner = Measurement("corner", tuple(MeasuredPoint((1.0, 2.0, 3.0), fit=fit) for fit in (floor, wall, other)))
    assert value_text(corner, "m") == "x 1.000, y 2.000, z 3.000 ± 0.003 m"
    opposite = plane((3.5, 2.0, 3.0), (-1.0, 0.01, 0.0), 0.0015, 0.05)
    points = MeasuredPoint((1.0, 2.0, 3.0), fit=floor), MeasuredPoint((3.5, 2.0, 3.0), fit=opposite)
    gap = Measurement("plane to plane", points)
    assert value_text(gap, "m") == "2.500 ± 0.004 m"
    assert fit_text(gap, "m") == "0.6 ± 0.1° from parallel\nscatter 0.002, 0.002 m (1 sigma), 1,000 points used"
