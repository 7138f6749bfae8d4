"""Measurements of a synthetic room of known dimensions, and their uncertainty against repeated measuring (Monte Carlo)."""

import csv
import io
from dataclasses import replace

import numpy as np
import pytest
from documents import random_fit, random_fits, random_profile, random_volume

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.clip import vector
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.work.measuring.measure_files import write_measurements
from pointglass.viewer.work.measuring.measure_table import COLUMNS, FOUND, OF_FIT, csv_text
from pointglass.viewer.work.measuring.measure_text import components_text, fit_text, text_of, unit_name, value_text
from pointglass.viewer.work.measuring.measurement import KINDS, Begun, MeasuredPoint, Measurement
from pointglass.viewer.work.measuring.values import components, evaluate

SMALL = 1e-8
"""Units, that a place of a table may be off: coordinates of 1e6 are rounded to 1e-10."""


def measurement(kind: str, points, variance: float = 0.0, up=(0.0, 0.0, 1.0)) -> Measurement:
    return Measurement(kind, tuple(MeasuredPoint(vector(p), 0.0, float(np.sqrt(variance))) for p in points), kind, up)


def random_polygon(random, count: int) -> np.ndarray:
    """A star-shaped polygon in the plane z = 0."""
    angles = np.sort(random.random(count)) * 2 * np.pi + np.arange(count) * 1e-3
    radius = random.uniform(1.0, 3.0, count)
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), np.zeros(count)], 1)


def shoelace(points: np.ndarray) -> float:
    x, y = points[:, 0], points[:, 1]
    return abs(float(sum(x[i] * y[(i + 1) % len(x)] - x[(i + 1) % len(x)] * y[i] for i in range(len(x))))) / 2


def test_values_agree_with_plain_geometry(seed):
    random = np.random.default_rng(seed)
    for _ in range(50):
        axes, shift = np.linalg.qr(random.normal(size=(3, 3)))[0], random.uniform(-1e6, 1e6, 3)
        a, b, c = random.normal(size=(3, 3)) * 3
        assert evaluate(measurement("distance", [a + shift, b + shift])).value == pytest.approx(np.linalg.norm(a - b), abs=1e-8)
        length = np.linalg.norm(a - b) + np.linalg.norm(b - c)
        assert evaluate(measurement("polyline", [a, b, c])).value == pytest.approx(length)
        up = vector(axes[0])
        assert evaluate(measurement("height", [a, b], up=up)).value == pytest.approx(abs((b - a) @ axes[0]))
        angle = np.degrees(np.arccos((a - b) @ (c - b) / np.linalg.norm(a - b) / np.linalg.norm(c - b)))
        assert evaluate(measurement("angle", [a, b, c])).value == pytest.approx(angle)
        flat = random_polygon(random, 7)
        result = evaluate(measurement("area", flat @ axes.T + shift))
        assert result.value == pytest.approx(shoelace(flat), rel=1e-6)
        assert result.residual < 1e-6


def test_a_distance_has_parts_along_the_axes_and_the_up_axis_each_as_uncertain_as_repeated_measuring_shows(seed):
    random = np.random.default_rng(seed)
    up, shift, sigma = np.linalg.qr(random.normal(size=(3, 3)))[0][0], random.uniform(-1e6, 1e6, 3), 0.01
    a, b = random.normal(size=(2, 3)) * 3 + shift
    parts = components(measurement("distance", [a, b], sigma**2, vector(up)))
    assert parts is not None and parts.along == pytest.approx(b - a)
    assert parts.vertical == pytest.approx((b - a) @ up)
    assert parts.horizontal == pytest.approx(np.linalg.norm(np.cross(b - a, up)))
    assert np.hypot(parts.horizontal, parts.vertical) == pytest.approx(np.linalg.norm(b - a))
    noise = random.normal(size=(3000, 2, 3)) * sigma
    again = [components(measurement("distance", [a + s, b + t], sigma**2, vector(up))) for s, t in noise]
    values = np.array([[one.horizontal, one.vertical, *one.along] for one in again if one is not None])
    assert values.std(axis=0) == pytest.approx(np.full(5, parts.uncertainty / 2), rel=0.1)
    assert components(measurement("height", [a, b])) is None


def test_the_parts_are_written_with_the_digits_of_the_distance():
    item = measurement("distance", [(0, 0, 0), (3, 4, -0.0123)], 0.002**2)
    parts = components(item)
    assert parts is not None and text_of(evaluate(item), "m") == "5.000 ± 0.006 m"
    assert components_text(parts, "m") == "horizontal 5.000, vertical -0.012 m\ndx 3.000, dy 4.000, dz -0.012 m"


def test_uncertainty_is_what_repeated_measuring_shows(seed):
    random = np.random.default_rng(seed)
    shapes = {"distance": random.normal(size=(2, 3)) * 3, "polyline": np.array([[0.0, 0, 0], [3, 0, 0], [3, 2, 0], [1, 2, 1]]),
              "height": np.array([[0.0, 0, 0], [1, 2, 3]]), "angle": np.array([[2.0, 0, 0], [0, 0, 0], [1, 2, 0.5]]),
              "area": random_polygon(random, 6)}  # fmt: skip
    assert {*shapes} == {name for name, kind in KINDS.items() if not kind.surfaces and name not in ("volume", "profile")}, \
        "the others: test_planes.py, test_fits.py, test_volume.py"
    for kind, points in shapes.items():
        sigma = 0.01
        stated = evaluate(measurement(kind, points, sigma**2)).uncertainty / 2
        values = [evaluate(measurement(kind, points + random.normal(size=points.shape) * sigma)).value for _ in range(3000)]
        assert stated == pytest.approx(np.std(values), rel=0.1), kind


def test_a_straight_or_empty_angle_has_a_value():
    assert evaluate(measurement("angle", [[1, 0, 0], [0, 0, 0], [-1, 0, 0]], 1e-4)).value == pytest.approx(180.0)
    same = evaluate(measurement("angle", [[0, 0, 0], [0, 0, 0], [1, 0, 0]], 1e-4))
    assert np.isfinite(same.value) and np.isfinite(same.uncertainty)


def test_spacing_counts_as_an_even_spread():
    points = tuple(MeasuredPoint((float(x), 0.0, 0.0), spacing=0.012) for x in (0, 4))
    assert evaluate(Measurement("distance", points)).uncertainty == pytest.approx(2 * np.sqrt(2 * 0.012**2 / 12))


def test_wrong_numbers_of_points_and_kinds_are_refused():
    with pytest.raises(InputError, match="1 points"):
        measurement("distance", [[0, 0, 0]])
    with pytest.raises(InputError, match="'volume'"):
        measurement("volume", [[0, 0, 0], [1, 1, 1]])


def test_text_shows_as_many_digits_as_are_known():
    result = evaluate(measurement("distance", [[0, 0, 0], [3.99812, 0, 0]], 0.002**2))
    assert text_of(result, "m") == "3.998 ± 0.006 m"
    assert text_of(evaluate(measurement("distance", [[0, 0, 0], [3.99812, 0, 0]])), "m") == "3.998 m"


def test_a_fitted_surface_is_written_with_its_sign_and_what_is_known_of_it(seed):
    pipe = replace(random_fit(np.random.default_rng(seed), "pipe"), direction=(0.0, 0.0, 1.0), radius=0.0571, low=-0.5,
                   high=0.75, seen=120.0, sigma=0.0013, count=8120, radius_uncertainty=0.0002)
    item = Measurement("pipe", (MeasuredPoint((0.0, 0.0, 0.0), fit=pipe),))
    assert value_text(item, "m") == "Ø 0.1142 ± 0.0004 m"
    assert fit_text(item, "m").split("\n") == ["length 1.250 m, 0.0° from upright, 120° of its round seen",
                                               "scatter 0.0013 m (1 sigma), 8,120 points used"]
    level = Measurement("plane", (MeasuredPoint((0.0, 0.0, 0.0), fit=replace(pipe, kind="plane", tilt_uncertainty=0.03)),))
    assert value_text(level, "m") == "slope 0.00 ± 0.03°"
    assert fit_text(measurement("distance", [[0, 0, 0], [1, 0, 0]]), "m") == ""


def test_a_fit_belongs_to_measurements_of_its_kind_only(seed):
    pipe = random_fit(np.random.default_rng(seed), "pipe")
    for kind, fit in (("plane", pipe), ("pipe", None)):
        with pytest.raises(InputError, match=f"expected that of a {kind}"):
            Measurement(kind, (MeasuredPoint((0.0, 0.0, 0.0), fit=fit),))
    with pytest.raises(InputError, match="a fit of a pipe; expected none"):
        Measurement("distance", (MeasuredPoint((0.0, 0.0, 0.0), fit=pipe), MeasuredPoint((1.0, 0.0, 0.0))))
    with pytest.raises(InputError, match="not ended"):
        Begun("pipe", (MeasuredPoint((0.0, 0.0, 0.0)),))
    with pytest.raises(InputError, match="point 1 of a measurement of corner has no fit; expected that of a plane"):
        Begun("corner", (MeasuredPoint((0.0, 0.0, 0.0)),))


def test_units():
    names = {1.0: "m", 0.3048: "ft", 1200 / 3937: "ftUS", 0.001: "mm", None: "units"}
    assert {size: unit_name(size) for size in names} == names


def test_csv_holds_every_number(tmp_path, seed):
    """Places to 1e-6 of the point spacing, all others to 12 digits."""
    random = np.random.default_rng(seed)
    made = []
    for kind in KINDS:
        places = [vector(random.uniform(-1e6, 1e6, 3)) for _ in range(KINDS[kind].fewest)]
        points = [MeasuredPoint(at, 0.0, 1e-2, fit=fit) for at, fit in zip(places, random_fits(random, kind), strict=True)]
        made.append(Measurement(kind, tuple(points), kind, volume=random_volume(random, kind),
                                profile=random_profile(random, kind)))
    made.append(Measurement("distance", made[0].points, 'a "quoted", name'))
    write_measurements(tmp_path / "m.csv", made, ScanDescription(units="foot", metres_per_unit=0.3048))
    text = (tmp_path / "m.csv").read_bytes().decode()
    assert text == csv_text(made, 0.3048) and "np." not in text
    rows = list(csv.DictReader(io.StringIO(text, newline="")))
    assert tuple(rows[0]) == COLUMNS
    at = 0
    for item in made:
        result = evaluate(item)
        unit = {0: "deg", 2: "ft^2", 3: "ft^3"}.get(1 if result.power is None else result.power, "ft")
        assert rows[at]["value"] == (f"{result.value:.12g}" if item.kind != "corner" else "") and rows[at]["unit"] == unit
        told = [rows[at][name] for name in FOUND]
        assert told == [""] * 3 if result.place is None else [*map(float, told)] == pytest.approx(result.place, abs=SMALL)
        assert float(rows[at]["uncertainty_k2"]) == pytest.approx(result.uncertainty, rel=1e-11)
        for number, point in enumerate(item.points, 1):
            row = rows[at]
            assert (row["name"], int(row["point"])) == (item.name, number)
            assert [float(row[axis]) for axis in "xyz"] == pytest.approx(point.position, rel=0, abs=SMALL)
            parts = components(item) if number == 1 else None
            told = [row[name] for name in ("dx", "dy", "dz", "horizontal", "vertical")]
            assert told == [""] * 5 if parts is None else [*map(float, told)] == pytest.approx(
                [*parts.along, parts.horizontal, parts.vertical], rel=0, abs=SMALL)
            fit = point.fit
            told = [row[name] for name in OF_FIT]
            assert told == [""] * 9 if fit is None else [*map(float, told[:3])] == pytest.approx(fit.place, rel=0, abs=SMALL)
            if fit is not None:
                round_it = () if fit.kind == "plane" else (fit.high - fit.low, fit.seen)
                assert told[3:] == [*(f"{value:.12g}" for value in (*fit.direction, *round_it)), *[""] * (2 - len(round_it)),
                                    str(fit.count)]
            at += 1
    assert at == len(rows)
