"""The pace of a film (viewer.work.cameras.pace): against the integral of a speed, and what a person sees of it."""

import json
from itertools import pairwise

import numpy as np
import pytest

from pointglass.viewer.commands.film.command import read_path
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.work.cameras.camera_files import write_camera_path
from pointglass.viewer.work.cameras.pace import RAMP, Pace
from pointglass.viewer.work.cameras.path import interpolate


def random_pace(random, stays: bool = True) -> tuple[Pace, np.ndarray]:
    """A pace, and the shares of four to seven keyframes."""
    count = int(random.integers(4, 8))
    passing = np.concatenate([[0.0], np.sort(random.random(count - 2)), [1.0]])
    kept = random.choice([0.0, 0.5, 3.0], count) * random.random(count) if stays else np.zeros(count)
    return Pace(float(random.uniform(2, 60)), tuple(map(float, kept)), bool(random.random() < 0.5)), passing


@pytest.mark.parametrize("scale", [0.05, 1.0, 40.0])
def test_it_goes_from_the_beginning_to_the_end_without_a_jump_or_a_step_back(scale, seed):
    random = np.random.default_rng(seed)
    for _ in range(40):
        pace, passing = random_pace(random)
        pace = Pace(pace.seconds * scale, pace.stays, pace.ease)
        times = np.linspace(0, pace.seconds, 20_001)
        shares = pace.shares(times, passing)
        assert shares[0] == 0.0 and shares[-1] == pytest.approx(1.0, abs=1e-9)
        steps = np.diff(shares)
        assert steps.min() >= -1e-12
        peak = steps.max() / (times[1] * max((passing[1:] - passing[:-1]).max(), 1e-9))
        assert np.isfinite(peak) and np.abs(np.diff(steps)).max() <= steps.max() + 1e-12


def test_it_stays_where_it_is_told_and_arrives_when_it_says(seed):
    random = np.random.default_rng(seed)
    for _ in range(40):
        pace, passing = random_pace(random)
        arrivals = pace.arrivals(passing)
        assert np.allclose(pace.shares(arrivals, passing), passing, atol=1e-9)
        if sum(pace.stays) < 0.9 * pace.seconds:
            for at, share, stay in zip(arrivals, passing, pace.stays):
                during = pace.shares(at + np.linspace(0, stay, 9), passing)
                assert np.allclose(during, share, atol=1e-9)


def test_a_stop_is_reached_and_left_at_no_more_than_full_speed_in_a_second(seed):
    random = np.random.default_rng(seed)
    pace = Pace(20.0, (0.0, 2.0, 0.0), bool(random.integers(2)))
    passing = np.array([0.0, float(random.uniform(0.3, 0.7)), 1.0])
    times = np.linspace(0, 20, 200_001)
    speed = np.gradient(pace.shares(times, passing), times)
    arrival = pace.arrivals(passing)[1]
    before = (times > arrival - RAMP) & (times < arrival)
    assert np.all(np.diff(speed[before]) <= 1e-9) and speed[before][-1] < 0.01 * speed.max()
    assert np.allclose(speed[(times > arrival + 0.01) & (times < arrival + 1.99)], 0.0, atol=1e-9)
    assert (speed[5] < 0.01 * speed.max()) == pace.ease and (speed[-5] < 0.01 * speed.max()) == pace.ease
    ramp = (times > arrival + 2.0) & (times < arrival + 2.0 + RAMP)
    full = speed[np.searchsorted(times, arrival + 4.0)]
    expected = np.interp(times[ramp], [arrival + 2.0, arrival + 2.0 + RAMP], [0.0, full])
    assert np.allclose(speed[ramp], expected, atol=0.01 * speed.max()), "speed grows evenly"


def test_stays_longer_than_the_film_are_shortened_alike():
    pace, passing = Pace(10.0, (20.0, 0.0, 40.0)), np.array([0.0, 0.5, 1.0])
    assert pace.arrivals(passing)[0] == 0.0
    times = np.linspace(0, 10, 1001)
    shares = pace.shares(times, passing)
    assert (shares == 0).mean() == pytest.approx(0.3, abs=0.02) and (shares > 1 - 1e-12).mean() == pytest.approx(0.6, abs=0.02)


def cameras(count: int):
    return [from_fov(64, 48, 60.0, look_at((float(x * x), 0.0, 1.0), (x * x + 3.0, 5.0, 1.0)), f"c{x}") for x in range(count)]


def test_a_constant_pace_makes_the_bytes_of_before():
    keys = cameras(5)
    for one, other in zip(interpolate(keys, 40), interpolate(keys, 40, Pace(8.0, (0.0,) * 5)), strict=True):
        assert np.array_equal(one.camera_to_world, other.camera_to_world)


def test_a_saved_path_makes_the_same_film(tmp_path):
    keys, file = cameras(4), tmp_path / "camera_path.json"
    pace = Pace(9.0, (0.0, 1.5, 0.0, 0.5), ease=True)
    write_camera_path(file, keys, fps=10.0, seconds=9.0, stays=pace.stays, ease=True)
    read = read_path(file)
    film, rate = read.cameras, read.rate
    assert rate == 10.0 and len(film) == 90
    for one, other in zip(film, interpolate(keys, 90, pace), strict=True):
        assert np.allclose(one.camera_to_world, other.camera_to_world, atol=1e-9)
    write_camera_path(file, keys, fps=10.0, seconds=9.0)
    plain = json.loads(file.read_text())
    assert "ease" not in plain and not any("stay" in frame for frame in plain["camera_path"]), "as nerfstudio writes it"
    slow = read_path(file, stay=1.0, ease=True).cameras
    still = [np.array_equal(a.camera_to_world, b.camera_to_world) for a, b in pairwise(slow)]
    assert 30 <= sum(still) <= 40, "four stays of a second at ten frames a second"


@pytest.mark.parametrize("bad", [-1, "x", True, 1e9, None])
def test_a_stay_that_is_none_is_refused_by_name(tmp_path, bad):
    file = tmp_path / "camera_path.json"
    write_camera_path(file, cameras(3), fps=10.0, seconds=5.0, stays=(1.0,))
    data = json.loads(file.read_text())
    data["camera_path"][0]["stay"] = bad
    file.write_text(json.dumps(data))
    with pytest.raises(InputError, match=r"stay .* of camera 0"):
        read_path(file)


def test_frames_have_no_pace(tmp_path):
    file = tmp_path / "camera_path.json"
    write_camera_path(file, cameras(3), fps=10.0)
    with pytest.raises(InputError, match="frames, each shown once"):
        read_path(file, ease=True)
    assert len(read_path(file, ease=True, seconds=4.0).cameras) == 40
