"""Weights by where the scanners stood, and how far a pixel is trusted beside its neighbours: the plain definitions."""

import numpy as np
import pytest
import torch

from model.data.projected import project_scan
from model.data.truth import MemoryPicture, Scan
from model.places import told_apart
from model.project import SoftZ, network_input, rasterise
from model.station_weights import HEAVIEST, TRUST_BLOCK, UNPLACED, station_weights, trust
from viewer.cloud import scene_from_arrays


def by_definition(xyz: np.ndarray, station: np.ndarray, places: np.ndarray) -> np.ndarray:
    """In float64, from the angle itself."""
    out = []
    for point, number in zip(xyz, station, strict=True):
        if number >= len(places) or np.isnan(places[number]).any():
            out.append(float(UNPLACED))
            continue
        to_eye, to_scanner = -point, places[number] - point
        d, r = np.linalg.norm(to_eye), np.linalg.norm(to_scanner)
        c = np.cos(np.arccos(np.clip(to_eye @ to_scanner / (d * r), -1, 1)))
        out.append(float(np.clip(2 * HEAVIEST * ((1 + c * abs(c)) / 2) ** 4 * r * r / (r * r + d * d), 1, HEAVIEST)))
    return np.array(out)


def random_points(seed: int, count: int = 4000, scale: float = 1.0):
    rng = np.random.default_rng(seed)
    xyz = rng.normal(size=(count, 3)) * scale
    xyz[:, 2] = np.abs(xyz[:, 2]) + 1e-3 * scale
    places = rng.normal(size=(6, 3)) * scale
    places[4] = np.nan
    return xyz, rng.integers(0, 8, count), places


def weights(xyz, station, places, kind=torch.float32):
    x, y, z = torch.from_numpy(xyz).to(kind).unbind(1)
    return station_weights(x, y, z, torch.from_numpy(station), torch.from_numpy(places)).numpy()


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4, 1e7])
@pytest.mark.parametrize("kind", [torch.float32, torch.float64])
def test_weights_are_those_of_the_angle(seed, scale, kind):
    xyz, station, places = random_points(seed, scale=scale)
    got, want = weights(xyz, station, places, kind), by_definition(xyz, station, places)
    assert got.min() >= 1 and got.max() <= HEAVIEST and len(np.unique(got)) > 10
    assert np.abs(got - want).max() <= 0.5 + 1e-3


@pytest.mark.parametrize("power", [-20, -1, 3, 20])
def test_a_power_of_two_changes_no_weight(seed, power):
    xyz, station, places = random_points(seed)
    xyz, places = xyz.astype(np.float32), places.astype(np.float32)
    scaled = weights(xyz * np.float32(2.0**power), station, places * np.float32(2.0**power))
    assert np.array_equal(scaled, weights(xyz, station, places))


def test_the_eye_in_the_scanner_sees_its_points_heaviest_and_the_scanner_itself_least():
    xyz = np.array([[0.0, 0.0, 3.0], [1.0, -1.0, 2.0], [0.5, 0.5, 0.5]])
    places = np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.5]])
    assert weights(xyz, np.array([0, 0, 1]), places).tolist() == [HEAVIEST, HEAVIEST, 1]


def test_unknown_places_weigh_the_same_wherever_the_eye_is(seed):
    xyz, _, places = random_points(seed)
    for number in (4, 6, 255):
        assert set(weights(xyz, np.full(len(xyz), number), places)) == {UNPLACED}


def trust_by_definition(weight: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Pixel by pixel, with the tent over the four nearest blocks written out."""
    own = np.minimum(weight, HEAVIEST) * mask
    height, width = own.shape
    rows, columns = -(-height // TRUST_BLOCK), -(-width // TRUST_BLOCK)
    out = np.zeros(own.shape)
    for j in range(height):
        for i in range(width):
            v, u = (j + 0.5) / TRUST_BLOCK - 0.5, (i + 0.5) / TRUST_BLOCK - 0.5
            first = second = 0.0
            for y, b in ((int(np.floor(v)), 1 - v % 1), (int(np.floor(v)) + 1, v % 1)):
                for x, a in ((int(np.floor(u)), 1 - u % 1), (int(np.floor(u)) + 1, u % 1)):
                    top, left = np.clip(y, 0, rows - 1) * TRUST_BLOCK, np.clip(x, 0, columns - 1) * TRUST_BLOCK
                    block = own[top : top + TRUST_BLOCK, left : left + TRUST_BLOCK]
                    first, second = first + a * b * block.sum(), second + a * b * (block**2).sum()
            if own[j, i]:
                out[j, i] = min(own[j, i] * first / second, 1.0)
    return out


@pytest.mark.parametrize("size", [(1, 1), (7, 9), (16, 24), (23, 31)])
@pytest.mark.parametrize("share", [0.05, 0.5, 1.0])
def test_trust_is_the_weight_by_the_mean_around(seed, size, share):
    rng = np.random.default_rng(seed)
    weight, mask = rng.integers(1, 3 * HEAVIEST, size), rng.random(size) < share
    got = trust(torch.from_numpy(weight), torch.from_numpy(mask)).numpy()
    assert got.dtype == np.float32 and np.all(got[~mask] == 0) and np.all(got[mask] > 0)
    assert np.abs(got - trust_by_definition(weight, mask)).max() <= 0.5 / 255 + 1e-6


def test_where_one_station_saw_a_place_alone_all_is_trusted(seed):
    rng = np.random.default_rng(seed)
    mask = torch.from_numpy(rng.random((40, 50)) < 0.3)
    for weight in (1, 4, HEAVIEST, 1000):
        assert torch.equal(trust(torch.full((40, 50), weight), mask), mask.float())


def test_a_hidden_pixel_changes_the_trust_of_none(seed):
    rng = np.random.default_rng(seed)
    weight, mask = torch.from_numpy(rng.integers(1, 16, (33, 41))), torch.from_numpy(rng.random((33, 41)) < 0.5)
    other = torch.where(mask, weight, torch.from_numpy(rng.integers(1, 16, (33, 41))))
    assert torch.equal(trust(weight, mask), trust(other, mask))


def test_trust_is_made_where_the_weights_are():
    made = trust(torch.ones(20, 30, dtype=torch.int64, device="meta"), torch.ones(20, 30, dtype=torch.bool, device="meta"))
    assert made.device.type == "meta" and made.shape == (20, 30)


def test_equal_weights_give_the_plain_mean_and_unequal_ones_the_weighted(seed):
    rng = np.random.default_rng(seed)
    index = torch.from_numpy(rng.integers(0, 60, 500))
    z, rgb = torch.ones(500), torch.from_numpy(rng.integers(0, 256, (500, 3)))
    soft = SoftZ.preset("auto", 0.01, 1.0)
    plain, same = rasterise(index, z, rgb, 10, 6, soft), rasterise(index, z, rgb, 10, 6, soft, torch.full((500,), 7))
    assert torch.equal(plain.colour, same.colour) and torch.equal(7 * plain.count, same.count)
    heavy = torch.from_numpy(rng.integers(1, 16, 500))
    repeated = torch.repeat_interleave(torch.arange(500), heavy)  # a point of weight w is w points
    weighed = rasterise(index, z, rgb, 10, 6, soft, heavy)
    crowd = rasterise(index[repeated], z[repeated], rgb[repeated], 10, 6, soft)
    assert torch.equal(weighed.colour, crowd.colour) and torch.equal(weighed.count, crowd.count)


def test_two_stations_are_told_apart_only_where_both_are_known_and_differ():
    nan = np.nan
    assert told_apart(np.array([(0, 0, 0), (0, 0, 1e-3)], float))
    assert told_apart(np.array([(0, 0, 0), (nan, nan, nan), (1, 2, 3)], float))
    for places in (None, np.zeros((0, 3)), np.zeros((1, 3)), np.zeros((5, 3)), np.array([(nan, nan, nan), (1, 2, 3)], float)):
        assert not told_apart(places)


def test_a_projected_scan_has_weights_where_its_stations_are_known_and_apart(seed):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-1, 1, (3000, 3)) + (0, 0, -3)
    scan = Scan(xyz, rng.integers(0, 256, (3000, 3)).astype(np.uint8), rng.integers(0, 2, 3000).astype(np.uint8))
    shot = MemoryPicture(np.zeros((48, 64, 3), np.uint8), 60.0, np.eye(4))
    assert project_scan(scan, shot).weight is None
    places = np.array([(0.0, 0.0, 0.0), (4.0, 0.0, -3.0)])
    placed = Scan(scan.xyz, scan.rgb, scan.station, places)
    seen = project_scan(placed, shot)
    assert seen.weight is not None
    assert seen.weight[seen.station == 0].float().mean() > 2 * seen.weight[seen.station == 1].float().mean()
    few = seen.chosen(seen.rank < 0.5)
    assert few.weight is not None and len(few.weight) == len(few.z) < len(seen.z)
    raster = seen.raster(SoftZ.preset("auto", 0.05, 1.0))
    mask = raster.count > 0
    assert torch.equal(network_input(raster, mask, 60.0, 0.05)[3], trust(raster.count, mask))


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1, 1])
def test_a_scanner_farther_off_than_any_can_stand_is_not_known(axis, side):
    """As a pose of zeros beside map coordinates: 20 times the scan's largest extent from the points, 4 here."""
    xyz = np.random.default_rng(0).uniform(-1, 1, (200, 3)) * (2, 1, 0.5) + (500, 600, 70)
    scene = scene_from_arrays(xyz, np.full((200, 3), 9, np.uint8))
    edge, reach = (scene.bounds[max(side, 0), axis], 20 * np.ptp(scene.bounds[:, 0]))
    near, far = xyz[0].copy(), xyz[0].copy()
    near[axis], far[axis] = edge + 0.99 * side * reach, edge + 1.01 * side * reach
    scene.meta["scans"] = [{"position": near.tolist()}, {"position": far.tolist()}, {"position": None}]
    places = scene.station_places
    assert np.array_equal(places[0], near) and np.isnan(places[1:]).all()
