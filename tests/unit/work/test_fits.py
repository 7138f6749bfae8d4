"""Planes, pipes and circles of known size, fitted to synthetic measured points around a click (viewer.work.fits).

A limit: pipes whose radius is below 15 times the noise are not tried here.  Their diameter depends on the direction of the
noise, which is not known.
"""

import re
from dataclasses import replace

import numpy as np
import pytest
from cloud_files import write_las
from synthetic_pipes import frame, made_pipe, plate, random_pipe

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.clip import vector
from pointglass.viewer.work.fits.fit import Fit, fit_at, fit_of
from pointglass.viewer.work.fits.grow import NoFit
from pointglass.viewer.work.fits.measured import MOST, in_cloud, in_scene
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.measuring.values import evaluate
from pointglass.viewer.work.places.pick import surface_around

ROUNDING = 1e-5
LOOKED = 2000  # points of a box, for time: fewer than measured.MOST
OUTSIDE = 4  # of 16, at most.  Where each is inside with 95 %, more than 4 are outside in 1 of 1,000 runs (binomial).
EVERYTHING = np.zeros(3), np.eye(3), np.full(3, 1e3)


def fit_near(xyz: np.ndarray, click: np.ndarray, kind: str, spacing: float, most: int = LOOKED) -> Fit:
    return fit_of(in_cloud(xyz, click, most), click, kind, spacing, ROUNDING)


def turned(random, xyz: np.ndarray, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Points with noise in all directions, in a random frame at map coordinates; and its axes, as columns."""
    axes, shift = frame(random)
    return (xyz + random.normal(size=xyz.shape) * noise) @ axes.T + shift, axes


def angle(first, second) -> float:
    """Degrees between two lines."""
    return float(np.degrees(np.arcsin(min(np.linalg.norm(np.cross(first, second)), 1.0))))


def test_pipes_have_the_diameter_and_length_that_they_were_made_with(seed):
    random = np.random.default_rng(seed)
    outside, missed = [], []
    for number in range(16):
        pipe = random_pipe(random, number)
        fit = fit_near(pipe.xyz, pipe.click, "pipe", pipe.spacing)
        told = f"radius {pipe.radius:.4f}, noise {pipe.noise:.4f}, seen {pipe.seen:.0f}: {fit}"
        assert fit.radius == pytest.approx(pipe.radius, rel=0.15), told
        assert fit.radius_uncertainty < 0.15 * pipe.radius, told
        assert fit.high - fit.low == pytest.approx(pipe.length, rel=0.1), told
        missed.append(abs(fit.seen - pipe.seen))
        assert angle(fit.direction, pipe.axis) < 2.0, told
        from_axis = np.cross(np.array(fit.place) - pipe.middle, pipe.axis)
        assert np.linalg.norm(from_axis) < 0.05 * pipe.radius, told
        assert abs(np.dot(np.array(fit.place) - pipe.click, fit.direction)) < 1e-6, told
        if abs(2 * fit.radius - 2 * pipe.radius) > 2 * fit.radius_uncertainty:
            outside.append(told)
    assert len(outside) <= OUTSIDE, outside
    assert sorted(missed)[-2] < 12 and max(missed) < 50, missed  # of 656 pipes one was off by 40 degrees, the others by 10


def test_points_that_stand_in_the_file_several_times_count_once(seed):
    random = np.random.default_rng(seed)
    pipe = made_pipe(random, 0.08, 0.3, 0.006, 0.002, 200.0, along_beam=False, others=False)
    once = fit_near(pipe.xyz, pipe.click, "pipe", pipe.spacing, 10**6)
    times = int(random.integers(2, 9))
    assert fit_near(np.repeat(pipe.xyz, times, axis=0), pipe.click, "pipe", pipe.spacing, 10**6) == once


def test_the_same_click_gives_exactly_the_same_fit(seed):
    pipe = made_pipe(np.random.default_rng(seed), 0.05, 0.15, 0.005, 0.002, 150.0, along_beam=True)
    for kind in ("plane", "pipe", "circle"):
        first, second = (fit_near(pipe.xyz.copy(), pipe.click, kind, pipe.spacing, 1000) for _ in range(2))
        assert first == second


@pytest.mark.parametrize("kind", ["pipe", "circle"])
def test_a_flat_wall_and_a_corner_of_two_walls_are_no_pipe(kind, seed):
    random = np.random.default_rng(seed)
    wall = plate(random, 0.006, (0, 0, 0), (1, 0, 0), (0, 1, 0))
    corner = np.concatenate([wall, plate(random, 0.006, (0, 0, 0), (0, 0, 1), (0, 1, 0))])
    for points in (wall, corner):
        xyz, _ = turned(random, points, float(random.uniform(0.001, 0.004)))
        place = np.array([random.uniform(0.05, 0.6), random.uniform(0.3, 0.7), 0.0])
        click = xyz[np.linalg.norm(points - place, axis=1).argmin()]
        with pytest.raises(NoFit) as raised:
            fit_near(xyz, click, kind, 0.006)
        assert re.fullmatch("(nothing round|no circle) here: .*", str(raised.value))


@pytest.mark.parametrize("kind", ["plane", "pipe", "circle"])
def test_a_handful_of_points_is_refused(kind, seed):
    random = np.random.default_rng(seed)
    xyz = random.uniform(-0.02, 0.02, (20, 3)) + random.uniform(1e5, 1e6, 3)
    with pytest.raises(NoFit, match=r"^nothing can be fitted here: .* measured points around the click, 30 are needed$"):
        fit_near(xyz, xyz[0], kind, 0.01)


def test_the_tilt_of_a_plate_is_as_uncertain_as_stated(seed):
    random = np.random.default_rng(seed)
    outside = []
    for _ in range(16):
        width, height = random.uniform(0.2, 1.0, 2)
        flat = plate(random, 0.01, (-width / 2, -height / 2, 0), (width, 0, 0), (0, height, 0))
        xyz, axes = turned(random, flat, float(random.uniform(0.001, 0.005)))
        fit = fit_near(xyz, xyz[np.linalg.norm(flat, axis=1).argmin()], "plane", 0.01)
        assert (fit.radius, fit.seen, fit.radius_uncertainty) == (0.0, 0.0, 0.0)
        assert 0 < fit.tilt_uncertainty < 1.0
        normal = axes[:, 2]
        across = np.cross(normal, random.normal(size=3))
        up = normal + across / np.linalg.norm(across)  # half way: the tilt changes as the plane does
        error = fit.tilt(vector(up)) - 45.0
        if abs(error) > fit.tilt_uncertainty:
            outside.append((error, fit))
    assert len(outside) <= OUTSIDE, outside


def test_a_plane_beside_another_wall_is_not_bent_by_it(seed):
    random = np.random.default_rng(seed)
    for _ in range(3):
        noise, spacing = float(random.uniform(0.001, 0.004)), 0.008
        step = float(random.uniform(0.05, 0.2))
        floor = plate(random, spacing, (0, 0, 0), (1, 0, 0), (0, 1, 0))
        wall = plate(random, spacing, (0, 0, 0), (0, 1, 0), (0, 0, 1))
        above = plate(random, spacing, (1, 0, step), (1, 0, 0), (0, 1, 0))
        points = np.concatenate([floor, wall, above])
        xyz, axes = turned(random, points, noise)
        click = np.linalg.norm(points - (random.uniform(0.1, 0.9), 0.5, 0.0), axis=1).argmin()
        fit, alone = (fit_near(some, xyz[click], "plane", spacing) for some in (xyz, xyz[: len(floor)]))
        assert angle(fit.direction, alone.direction) < fit.tilt_uncertainty + alone.tilt_uncertainty
        assert angle(fit.direction, axes[:, 2]) < 0.2
        assert abs(np.dot(np.array(fit.place) - alone.place, axes[:, 2])) < noise / 5
        assert fit.count == pytest.approx(alone.count, rel=0.1)
        assert fit.sigma == pytest.approx(noise, rel=0.15)


def test_the_circle_of_a_cone_has_the_radius_at_the_click(seed):
    random = np.random.default_rng(seed)
    for _ in range(2):
        radius, slope = float(random.uniform(0.06, 0.12)), float(random.uniform(0.03, 0.08)) * random.choice([-1, 1])
        seen = float(random.uniform(150, 300))
        cone = made_pipe(random, radius, 6 * radius, 0.006, 0.002, seen, along_beam=False, slope=slope, others=False)
        fit = fit_near(cone.xyz, cone.click, "circle", cone.spacing)
        assert fit.kind == "circle" and fit.tilt_uncertainty == 0.0
        # The radius changes by `slope` a length: the place of the click along the axis is as unsure as its noise.
        assert abs(fit.radius - radius) < fit.radius_uncertainty + 0.01 * radius
        assert fit.high - fit.low < 0.3 * radius + 4 * cone.spacing


@pytest.fixture(scope="module")
def pipe_scene(tmp_path_factory):
    """A pipe with other things near, and the scan of it."""
    pipe = made_pipe(np.random.default_rng(5), 0.06, 0.35, 0.006, 0.002, 170.0, along_beam=True)
    return pipe, open_scene([write_las(tmp_path_factory.mktemp("pipe") / "pipe.las", pipe.xyz, scale=1e-5)], cache=False)


@pytest.mark.parametrize("kind", ["plane", "pipe", "circle"])
def test_a_scene_and_an_array_of_its_points_give_the_same_fit(pipe_scene, kind, seed):
    pipe, scene = pipe_scene
    xyz = unpack(scene)[0]
    on_pipe = np.abs(np.linalg.norm(np.cross(xyz - pipe.middle, pipe.axis), axis=1) - pipe.radius) < 0.003
    middle = np.abs((xyz - pipe.middle) @ pipe.axis) < 0.1
    near = np.flatnonzero(on_pipe & middle & (np.linalg.norm(xyz - pipe.click, axis=1) < 0.05))
    click = xyz[np.random.default_rng(seed).choice(near)]
    found = fit_at(scene, vector(click), kind)
    # Numbers of points depend on their order, in starts and where only some are looked at: that of a scene is by its cells.
    everything = in_scene(scene, click, most=len(xyz))(*EVERYTHING)
    assert everything.index is not None and len(everything) == len(xyz)
    again = fit_near(xyz[everything.index], click, kind, surface_around(scene, click).spacing, MOST)
    # The file's steps of 1e-5 put a few points on the other side of a limit: a tenth of what is stated, no more.
    assert found.kind == again.kind and found.seen == pytest.approx(again.seen, abs=5.0)
    assert found.count == pytest.approx(again.count, rel=0.01)
    assert abs(found.radius - again.radius) <= 0.1 * again.radius_uncertainty
    assert angle(found.direction, again.direction) <= max(0.1 * again.tilt_uncertainty, 0.01)
    assert found.sigma == pytest.approx(again.sigma, rel=0.05)
    if kind != "plane":
        assert found.radius == pytest.approx(pipe.radius, rel=0.05)


def test_points_that_are_not_drawn_are_not_fitted(pipe_scene):
    pipe, scene = pipe_scene
    click = unpack(scene)[0]
    click = click[np.linalg.norm(click - pipe.click, axis=1).argmin()]
    cut = float((click - pipe.middle) @ pipe.axis) + 0.04

    def below(xyz, scans, index):
        assert len(xyz) == len(scans) == len(index)
        return (xyz - pipe.middle) @ pipe.axis < cut

    whole, part = fit_at(scene, vector(click), "pipe"), fit_at(scene, vector(click), "pipe", below)
    ends = sorted(float((np.array(part.place) + end * np.array(part.direction) - pipe.middle) @ pipe.axis)
                  for end in (part.low, part.high))  # fmt: skip
    assert ends == pytest.approx([-pipe.length / 2, cut], abs=0.02)
    assert part.count < whole.count and part.radius == pytest.approx(pipe.radius, rel=0.05)
    with pytest.raises(NoFit, match="nothing can be fitted here: 0 measured points"):
        fit_at(scene, vector(click), "pipe", lambda xyz, *_: np.zeros(len(xyz), bool))


def a_fit(**changes) -> Fit:
    return replace(Fit("pipe", (1.0, 2.0, 3.0), (0.0, 0.6, 0.8), 0.1, -1.0, 1.0, 180.0, 0.001, 100, 0.001, 0.1), **changes)


def test_what_is_no_surface_is_refused():
    assert a_fit().tilt((0.0, 0.0, 2.0)) == pytest.approx(np.degrees(np.arccos(0.8)))
    with pytest.raises(InputError, match="'cone'"):
        a_fit(kind="cone")
    for name in ("radius", "low", "high", "seen", "sigma", "radius_uncertainty", "tilt_uncertainty"):
        for value in (np.nan, np.inf):
            with pytest.raises(InputError, match="no finite number"):
                a_fit(**{name: value})
    for name in ("radius", "sigma", "radius_uncertainty", "tilt_uncertainty"):
        with pytest.raises(InputError, match="below 0"):
            a_fit(**{name: -1e-9})
    for name in ("place", "direction"):
        with pytest.raises(InputError, match="no finite number"):
            a_fit(**{name: (0.0, np.nan, 1.0)})
    for direction in ((0.0, 0.0, 0.0), (0.0, 0.0, 1.001), (0.6, 0.6, 0.6)):
        with pytest.raises(InputError, match="length 1"):
            a_fit(direction=direction)


def test_distances_angles_and_corners_of_fitted_planes_are_as_uncertain_as_stated(seed):
    """Of rooms of known size with walls at any angle: their height, the angle of two walls, a corner, and a point's height."""
    random = np.random.default_rng(seed)
    outside: dict[str, int] = dict.fromkeys(("plane to plane", "edge", "corner", "point to plane"), 0)
    for _ in range(16):
        noise, spacing, height = float(random.uniform(0.001, 0.005)), 0.02, float(random.uniform(0.4, 0.8))
        turn = np.radians(random.uniform(60, 120))
        along = random.uniform(0.5, 1) * np.array([1.0, 0.0, 0.0])
        other = random.uniform(0.5, 1) * np.array([np.cos(turn), np.sin(turn), 0.0])
        up = np.array([0.0, 0.0, height])
        plates = [plate(random, spacing, corner, *sides) for corner, *sides in (
            (np.zeros(3), along, other), (up, along, other), (np.zeros(3), along, up), (np.zeros(3), other, up))]
        points = np.concatenate(plates)
        axes, shift = frame(random)
        xyz = (points + random.normal(size=points.shape) * noise) @ axes.T + shift
        found, first = [], 0
        for flat in plates:
            middle = first + int(np.linalg.norm(flat - flat.mean(axis=0), axis=1).argmin())
            fit = fit_near(xyz, xyz[middle], "plane", spacing)
            found.append(MeasuredPoint(vector(xyz[middle]), spacing, noise, fit=fit))
            first += len(flat)
        floor, ceiling, wall, second = found
        for kind, planes, truth in (
                ("plane to plane", (floor, ceiling), height), ("edge", (wall, second), float(np.degrees(turn))),
                ("corner", (floor, wall, second), shift)):
            result = evaluate(Measurement(kind, planes))
            error = result.value - truth if result.place is None else np.linalg.norm(np.array(result.place) - truth)
            outside[kind] += abs(error) > result.uncertainty
        some = int(random.integers(len(plates[0]), len(xyz)))
        result = evaluate(Measurement("point to plane", (floor, MeasuredPoint(vector(xyz[some]), 0.0, noise))))
        outside["point to plane"] += abs(result.value - points[some, 2]) > result.uncertainty
    assert max(outside.values()) <= OUTSIDE, outside
