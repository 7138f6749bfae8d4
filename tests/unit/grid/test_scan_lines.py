"""Scanner positions are inferred from the order of points by scan lines, and from no other order."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from swept_room import PLACES, pictures, sweep

from pointglass.viewer.preprocess.scan_line_kernels import through
from pointglass.viewer.preprocess.scan_lines import WINDOW, find_stations


def windows(xyz: np.ndarray, most: int = 4096) -> np.ndarray:
    """Stretches of consecutive points, evenly from the whole file."""
    count = len(xyz) // WINDOW
    return xyz[: count * WINDOW].reshape(count, WINDOW, 3)[:: -(-count // most)]


def stations(parts: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """The points of several stations, one after the other, and where each begins, as a share of all."""
    return np.concatenate(parts), np.cumsum([0] + [len(part) for part in parts])[:-1] / sum(map(len, parts))


def assert_found(xyz: np.ndarray, begins: np.ndarray, places: np.ndarray, within: float) -> None:
    stretches = windows(xyz)
    found = find_stations(stretches)
    assert len(found) == len(places)
    assert np.abs(np.array([station.position for station in found]) - places).max() < within
    for before, after, edge in zip(found, found[1:], begins[1:] * len(stretches), strict=False):
        assert 0 <= after.first - before.last <= 1 and abs(after.first - edge) <= 1.5


@pytest.mark.parametrize("seed, scale", [(0, 1e-3), (1, 1.0), (2, 1e5)])
def test_scan_lines_give_the_scanner_position_at_any_scale_and_tilt(seed, scale):
    xyz, begins = stations([sweep(place, seed) for place in PLACES])
    turn = Rotation.from_euler("xyz", np.random.default_rng(seed).uniform(0, 360, 3), degrees=True)
    away = np.array([40.0, -9.0, 300.0])
    assert_found(scale * (turn.apply(xyz) + away), begins, scale * (turn.apply(PLACES) + away), 0.02 * scale)


def test_a_thinned_file_gives_the_scanner_positions_too():
    for seed in range(3):
        parts = [sweep(place, seed, 400, 400) for place in PLACES]
        xyz, begins = stations([part[np.random.default_rng(seed).random(len(part)) < 0.3] for part in parts])
        assert_found(xyz, begins, PLACES, 0.2)


def test_rows_of_depth_images_give_positions_to_the_millimetre():
    xyz, begins = stations([pictures(place) for place in PLACES])
    assert_found(xyz, begins, PLACES, 0.001)


def test_other_orders_give_no_positions():
    random = np.random.default_rng(4)
    xyz, _ = stations([sweep(place, 4) for place in PLACES])
    assert not find_stations(windows(random.permutation(xyz))), "at random"
    cell = np.floor(xyz / 0.25).astype(int)
    assert not find_stations(windows(xyz[np.lexsort(cell.T)])), "by place: planes are walls, and meet in corners"
    assert not find_stations(windows(xyz[np.argsort(xyz[:, 2], kind="stable")])), "by height: level planes, that meet nowhere"
    assert not find_stations(windows(random.normal(size=(100_000, 3))))
    assert not find_stations(np.zeros((100, WINDOW, 3))) and not find_stations(windows(xyz[: 40 * WINDOW]))


def test_alternating_stations_give_no_positions():
    """In files of blocks each holds a piece of every station: who measured what is told for some of the points only."""
    one, other = (sweep(place, 5)[: 174 * WINDOW].reshape(29, -1, 3) for place in PLACES[:2])
    assert not find_stations(windows(np.stack([one, other], axis=1).reshape(-1, 3)))


@pytest.mark.parametrize("room", ["living-room-2", "kitchen", "staircase2"])
def test_all_stations_of_registered_rooms_are_found(room, registered_scan):
    _, scan = registered_scan(room)
    xyz, station = np.asarray(scan.xyz), np.asarray(scan.station)
    begins = np.append(0, np.flatnonzero(np.diff(station)) + 1) / len(xyz)
    some = np.random.default_rng(0).random(len(xyz)) < 0.3
    assert_found(xyz[some], begins, np.asarray(scan.places), 0.02)


def test_planes_pass_through_the_positions_that_numpy_finds(seed):
    rng = np.random.default_rng(seed)
    places, middle, normal = rng.normal(size=(30, 3)) * 100, rng.normal(size=(40, 3)) * 50, rng.normal(size=(40, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    way = places[:, None] - middle
    expected = np.abs((way * normal).sum(axis=2)) < 0.1 * np.linalg.norm(way, axis=2)
    assert 0 < expected.sum() < expected.size
    np.testing.assert_array_equal(through(places, middle, normal, 0.1), expected)
