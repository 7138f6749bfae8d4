"""``pointglass.from_points``: arrays come back as points, and what does not fit is refused in words that name the argument."""

import tracemalloc

import numpy as np
import pytest
from scipy.spatial import KDTree

import pointglass
from pointglass.viewer.common.errors import Option
from pointglass.viewer.interface.arguments import python_names

COUNT = 3_000


def arrays(seed: int) -> dict:
    rng = np.random.default_rng(seed)
    return {
        "xyz": rng.uniform(-2, 2, (COUNT, 3)) + (4.5e5, 5.2e6, 300), "rgb": rng.integers(0, 256, (COUNT, 3)).astype(np.uint8),
        "intensity": rng.integers(0, 65536, COUNT), "station": rng.integers(0, 2, COUNT),
        "stations": [[4.5e5, 5.2e6, 301.0], [np.nan] * 3],
    }  # fmt: skip


def test_arrays_come_back_as_points(seed):
    given = arrays(seed)
    with pointglass.from_points(**given, name="mine", metres_per_unit=0.3048) as scan:
        assert scan.count == COUNT and repr(scan) == "<pointglass.Scan mine: 3,000 points>"
        distance, row = KDTree(given["xyz"]).query(scan.points.xyz)
        assert distance.max() == 0.0 and np.array_equal(np.sort(row), np.arange(COUNT))
        for name in ("rgb", "intensity", "station"):
            assert np.array_equal(getattr(scan.points, name), given[name][row]), name
        assert np.array_equal(scan.stations, given["stations"], equal_nan=True)
        assert scan.info["metres_per_unit"] == 0.3048 and "mine" in scan._repr_html_()


@pytest.mark.parametrize("colours, expected", [
    (np.full((4, 3), 0.5, np.float32), 128), (np.full((4, 3), 0x8000, np.uint16), 128), (np.full((4, 3), 7, np.int64), 7),
    ([[200] * 3] * 4, 200),
])  # fmt: skip
def test_colours_of_other_types_are_taken_as_such_arrays_usually_are(colours, expected):
    with pointglass.from_points(np.eye(4, 3), colours) as scan:
        assert set(scan.points.rgb.ravel().tolist()) == {expected}


def test_every_value_is_read_back_exactly():
    rng = np.random.default_rng(1)
    xyz, classes, station = rng.random((COUNT, 3)), np.repeat([2, 6], COUNT // 2), np.arange(COUNT) % 255
    places = rng.random((255, 3))
    with pointglass.from_points(xyz, rng.random((COUNT, 3)), intensity=np.arange(COUNT), classification=classes,
                                station=station, stations=places) as scan:
        assert scan.info["attributes"]["class"] == {"2": COUNT // 2, "6": COUNT // 2}
        points = scan.points
        row = points.intensity  # the row, since it is its number
        assert np.array_equal(points.xyz, xyz[row]) and np.array_equal(points.classification, classes[row])
        assert np.array_equal(scan.stations[points.station], places[station[row]])


@pytest.mark.parametrize("given, said", [
    ({"xyz": np.zeros((COUNT, 2))}, r"^xyz: expected \(N, 3\) numbers, got shape \(3000, 2\)"),
    ({"xyz": np.zeros((0, 3)), "rgb": np.zeros((0, 3))}, "^xyz: holds no points"),
    ({"xyz": "house.laz"}, "^xyz: expected"), ({"xyz": [[1, 2, 3], [4, 5]]}, "^xyz: expected"),
    ({"xyz": np.full((COUNT, 3), np.nan)}, "no points|finite|usable"),
    ({"rgb": np.zeros((5, 3), np.uint8)}, r"^rgb: expected \(3,000, 3\) numbers, one colour for each row of xyz"),
    ({"rgb": np.full((COUNT, 3), 200.0)}, "^rgb: floats from 200 to 200; expected floats from 0 to 1"),
    ({"rgb": np.full((COUNT, 3), -1)}, "^rgb: int64 from -1 to -1"), ({"rgb": np.full((COUNT, 3), np.nan)}, "^rgb: floats"),
    ({"intensity": np.full(COUNT, 0.25)}, "^intensity: float64 from 0.25 to 0.25; expected whole numbers from 0 to 65535"),
    ({"intensity": np.full(COUNT, 70_000)}, "^intensity: int64 from 70000"),
    ({"classification": np.full(COUNT, 256)}, "^classification: int64 from 256"),
    ({"classification": np.zeros(3, int)}, r"^classification: expected \(3,000,\)"),
    ({"station": np.full(COUNT, 2)}, "^station: row 2 of stations, which has 2 rows"),
    ({"station": None}, "^station: missing; stations has 2 rows"), ({"stations": np.zeros((2, 2))}, "^stations: expected"),
    ({"stations": np.zeros((300, 3))}, "^stations: 300 rows"), ({"station": np.full(COUNT, 255)}, "^station: row 255"),
    ({"stations": [[np.inf, 0, 0], [0, 0, 0]]}, "^stations: a pos"),
    ({"metres_per_unit": 0}, "^metres_per_unit 0"), ({"metres_per_unit": "m"}, "^metres_per_unit 'm'"),
    ({"gpu_memory": "4G"}, "^gpu_memory '4G'"),
])  # fmt: skip
def test_what_does_not_fit_is_refused_in_one_line(given, said):
    with pytest.raises(pointglass.InputError, match=said) as caught:
        pointglass.from_points(**{**arrays(1), **given})
    assert "\n" not in str(caught.value) and "--" not in str(caught.value)


@pytest.mark.parametrize("option, argument", [
    (Option("--filter", "off"), 'filter="off"'), (Option("--quality"), "quality"),
    (Option("--device", "cuda"), 'device="cuda"'),
    (Option("--gpu-memory"), "gpu_memory"), (Option("--no-cache"), "cache=False"), (Option("--out"), "path"),
    (Option("--exposures", "as-scanned"), 'exposures="as-scanned"'), (Option("filter strength"), "filter_strength"),
    (Option("eye-dome lighting"), "eye-dome lighting"),
])  # fmt: skip
def test_messages_name_python_arguments(option, argument):
    error = pointglass.InputError((option, " here"), file="--filter off", option=option, value=1, remedy=("see ", option))
    with pytest.raises(pointglass.InputError) as caught, python_names():
        raise error
    assert str(caught.value) == f"--filter off: {argument} 1: {argument} here; see {argument}"
    assert str(error) == error.args[0]


def test_colours_of_all_points_need_at_most_twice_the_memory_of_the_result():
    rng = np.random.default_rng(1)
    with pointglass.from_points(rng.random((600_000, 3)), rng.random((600_000, 3)).astype(np.float32)) as scan:
        tracemalloc.start()
        try:
            colours = scan.points.rgb
            assert tracemalloc.get_traced_memory()[1] < 2 * colours.nbytes
        finally:
            tracemalloc.stop()
        assert np.array_equal(scan.points[::-7].rgb, colours[::-7])
