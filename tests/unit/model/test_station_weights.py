"""View-dependent blending against its definition: station weights, confidence and tone matching."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from pointglass.model.common.scanner_positions import stations_differ
from pointglass.model.data.dataset import MemoryPicture, MergedScan
from pointglass.model.data.surfaces.projected import project_scan
from pointglass.model.reference.projection import SoftZ, network_input, rasterise
from pointglass.model.reference.pull_push import pull_push
from pointglass.model.reference.station_weights import (
    CONFIDENCE_BLOCK,
    CONFIDENCE_HALF_SUM,
    HEAVIEST,
    UNPLACED,
    confidence_of,
    match_tone,
    station_weights,
)
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary


def by_definition(xyz: np.ndarray, station: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Weights in float64, computed from the angle."""
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


def test_a_camera_at_the_scanner_gives_its_points_the_largest_weight():
    xyz = np.array([[0.0, 0.0, 3.0], [1.0, -1.0, 2.0], [0.5, 0.5, 0.5]])
    places = np.array([[0.0, 0.0, 0.0], [0.5, 0.5, 0.5]])
    assert weights(xyz, np.array([0, 0, 1]), places).tolist() == [HEAVIEST, HEAVIEST, 1]


def test_unknown_scanner_positions_have_a_constant_weight(seed):
    xyz, _, places = random_points(seed)
    for number in (4, 6, 255):
        assert set(weights(xyz, np.full(len(xyz), number), places)) == {UNPLACED}


def confidence_by_definition(weight: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """Pixel by pixel, with explicit bilinear weights of the four nearest blocks."""
    own = np.minimum(weight, HEAVIEST) * mask
    height, width = own.shape
    rows, columns = -(-height // CONFIDENCE_BLOCK), -(-width // CONFIDENCE_BLOCK)
    out = np.zeros(own.shape)
    for j in range(height):
        for i in range(width):
            v, u = (j + 0.5) / CONFIDENCE_BLOCK - 0.5, (i + 0.5) / CONFIDENCE_BLOCK - 0.5
            first = second = 0.0
            for y, b in ((int(np.floor(v)), 1 - v % 1), (int(np.floor(v)) + 1, v % 1)):
                for x, a in ((int(np.floor(u)), 1 - u % 1), (int(np.floor(u)) + 1, u % 1)):
                    top, left = np.clip(y, 0, rows - 1) * CONFIDENCE_BLOCK, np.clip(x, 0, columns - 1) * CONFIDENCE_BLOCK
                    block = own[top : top + CONFIDENCE_BLOCK, left : left + CONFIDENCE_BLOCK]
                    first, second = first + a * b * block.sum(), second + a * b * (block**2).sum()
            if own[j, i]:
                out[j, i] = min(own[j, i] * first / second, 1.0)
    return out


@pytest.mark.parametrize("size, share", [
    ((1, 1), 0.5), ((7, 9), 0.5), ((16, 24), 0.05), ((16, 24), 0.5), ((16, 24), 1.0), ((23, 31), 0.5),
])  # fmt: skip
def test_confidence_is_the_weight_over_the_local_mean(seed, size, share):
    rng = np.random.default_rng(seed)
    weight, mask = rng.integers(1, 3 * HEAVIEST, size), rng.random(size) < share
    got = confidence_of(torch.from_numpy(weight), torch.from_numpy(mask)).numpy()
    assert got.dtype == np.float32 and np.all(got[~mask] == 0) and np.all(got[mask] > 0)
    assert np.abs(got - confidence_by_definition(weight, mask)).max() <= 0.5 / 255 + 1e-6


def test_pixels_of_a_single_station_have_full_confidence(seed):
    rng = np.random.default_rng(seed)
    mask = torch.from_numpy(rng.random((40, 50)) < 0.3)
    for weight in (1, 4, HEAVIEST, 1000):
        assert torch.equal(confidence_of(torch.full((40, 50), weight), mask), mask.float())


def matched_by_definition(colour: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pixel by pixel; colour (H, W, 3), share (H, W) in 255ths.

    Sums of weights below 1 count as 1, as in the shader; confidence_of leads to none: a lone pixel has full confidence.
    """
    height, width = share.shape
    tone, settled = colour.copy(), share.copy()
    for j, i in zip(*np.nonzero(share), strict=True):
        sums = np.zeros((2, 4))
        for y in range(height):
            for x in range(width):
                reach = [0.0, 0.0]
                for axis, (at, other, length) in enumerate(((j, y, height), (i, x, width))):
                    v = (at + 0.5) / CONFIDENCE_BLOCK - 0.5
                    last = -(-length // CONFIDENCE_BLOCK) - 1
                    for block, part in ((int(np.floor(v)), 1 - v % 1), (int(np.floor(v)) + 1, v % 1)):
                        reach[axis] += part * (np.clip(block, 0, last) == other // CONFIDENCE_BLOCK)
                near = reach[0] * reach[1]
                if near and share[y, x]:
                    parts = np.array([np.floor(share[y, x] ** 2 / 256 + 0.5), 255 - share[y, x]])
                    sums += near * parts[:, None] * np.append(colour[y, x], 1.0)
        rest = 255 - share[j, i]
        if rest:
            apart = sums[0, :3] / max(sums[0, 3], 1.0) - sums[1, :3] / max(sums[1, 3], 1.0)
            tone[j, i] = np.clip(colour[j, i] + rest / 255 * apart, 0, 255)
            settled[j, i] = share[j, i] + rest * CONFIDENCE_HALF_SUM / (CONFIDENCE_HALF_SUM + sums[0, 3])
    return tone, settled


@pytest.mark.parametrize("size, kept", [
    ((1, 1), 0.5), ((7, 9), 0.05), ((7, 9), 0.5), ((7, 9), 1.0), ((8, 16), 0.5), ((11, 18), 0.5),
])  # fmt: skip
def test_matched_tones_equal_the_definition(seed, size, kept):
    rng = np.random.default_rng(seed)
    colour, share = rng.integers(0, 256, (*size, 3)).astype(float), rng.integers(17, 256, size) * (rng.random(size) < kept)
    tone, settled = match_tone(torch.from_numpy(colour).permute(2, 0, 1).float(), torch.from_numpy(share / 255).float())
    wanted = matched_by_definition(colour, share.astype(float))
    assert np.abs(tone.permute(1, 2, 0).numpy() - wanted[0]).max() <= 0.501
    assert np.abs(255 * settled.numpy() - wanted[1]).max() <= 0.501
    assert torch.equal(tone, tone.round()) and not settled[torch.from_numpy(share == 0)].any()


def test_confident_pixels_keep_their_colour(seed):
    rng = np.random.default_rng(seed)
    colour, share = torch.from_numpy(rng.integers(0, 256, (3, 30, 41))).float(), torch.from_numpy(rng.random((30, 41))).float()
    share[torch.from_numpy(rng.random((30, 41)) < 0.5)] = 1.0
    tone, settled = match_tone(colour, share)
    assert torch.equal(tone[:, share == 1], colour[:, share == 1]) and (settled[share == 1] == 1).all()
    ones = torch.ones(30, 41)
    assert all(torch.equal(a, b) for a, b in zip(match_tone(colour, ones), (colour, ones), strict=True))


def test_matching_removes_different_light_and_keeps_texture(seed):
    """A floor measured completely by a far station in different light, and by the near one in every twelfth pixel."""
    rng = np.random.default_rng(seed)
    boards = 100.0 + 20.0 * np.sign(np.sin(np.arange(96) * 0.8))[None, :] + np.zeros((64, 1))
    glare = 40.0 + np.linspace(0, 40, 96)[None, :]
    near = rng.random((64, 96)) < 1 / 12
    seen = np.where(near, boards, boards + glare).round()
    colour, share = torch.from_numpy(np.stack([seen] * 3)).float(), torch.from_numpy(np.where(near, 1.0, 0.1)).float()
    (tone, settled), few = match_tone(colour, share), share * torch.from_numpy(near)
    wrong = {name: np.abs(pull_push(c, w)[0].numpy() - boards)[8:-8, 8:-8].mean()
             for name, c, w in (("toned", tone, settled), ("weighted", colour, share), ("the near one", colour, few))}
    assert wrong["toned"] < 0.45 * wrong["weighted"] and wrong["toned"] < wrong["the near one"]


def test_a_hidden_pixel_changes_no_confidence(seed):
    rng = np.random.default_rng(seed)
    weight, mask = torch.from_numpy(rng.integers(1, 16, (33, 41))), torch.from_numpy(rng.random((33, 41)) < 0.5)
    other = torch.where(mask, weight, torch.from_numpy(rng.integers(1, 16, (33, 41))))
    assert torch.equal(confidence_of(weight, mask), confidence_of(other, mask))


def test_confidence_is_on_the_device_of_the_weights():
    weight, mask = (torch.ones(20, 30, dtype=kind, device="meta") for kind in (torch.int64, torch.bool))
    made = confidence_of(weight, mask)
    assert made.device.type == "meta" and made.shape == (20, 30)


def test_equal_weights_give_the_plain_mean_and_unequal_ones_the_weighted(seed):
    rng = np.random.default_rng(seed)
    index = torch.from_numpy(rng.integers(0, 60, 500))
    z, rgb = torch.ones(500), torch.from_numpy(rng.integers(0, 256, (500, 3)))
    soft = SoftZ.preset("auto", 0.01, 1.0)
    plain, same = rasterise(index, z, rgb, 10, 6, soft), rasterise(index, z, rgb, 10, 6, soft, torch.full((500,), 7))
    assert torch.equal(plain.colour, same.colour) and torch.equal(7 * plain.count, same.count)
    heavy = torch.from_numpy(rng.integers(1, 16, 500))
    repeated = torch.repeat_interleave(torch.arange(500), heavy)  # a point of weight w equals w points
    weighted = rasterise(index, z, rgb, 10, 6, soft, heavy)
    crowd = rasterise(index[repeated], z[repeated], rgb[repeated], 10, 6, soft)
    assert torch.equal(weighted.colour, crowd.colour) and torch.equal(weighted.count, crowd.count)


def test_stations_differ_only_if_two_known_positions_differ():
    nan = np.nan
    assert stations_differ(np.array([(0, 0, 0), (0, 0, 1e-3)], float))
    assert stations_differ(np.array([(0, 0, 0), (nan, nan, nan), (1, 2, 3)], float))
    for places in (None, np.zeros((0, 3)), np.zeros((1, 3)), np.zeros((5, 3)), np.array([(nan, nan, nan), (1, 2, 3)], float)):
        assert not stations_differ(places)


def test_a_projected_scan_has_weights_only_with_different_known_stations(seed):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-1, 1, (3000, 3)) + (0, 0, -3)
    scan = MergedScan(xyz, rng.integers(0, 256, (3000, 3)).astype(np.uint8), rng.integers(0, 2, 3000).astype(np.uint8))
    shot = MemoryPicture(np.zeros((48, 64, 3), np.uint8), 60.0, np.eye(4))
    assert project_scan(scan, shot).weight is None
    places = np.array([(0.0, 0.0, 0.0), (4.0, 0.0, -3.0)])
    placed = MergedScan(scan.xyz, scan.rgb, scan.station, places)
    seen = project_scan(placed, shot)
    assert seen.weight is not None
    assert seen.weight[seen.station == 0].float().mean() > 2 * seen.weight[seen.station == 1].float().mean()
    few = seen.chosen(seen.rank < 0.5)
    assert few.weight is not None and len(few.weight) == len(few.z) < len(seen.z)
    raster = seen.raster(SoftZ.preset("auto", 0.05, 1.0))
    mask = raster.count > 0
    _, confidence = match_tone(raster.colour, confidence_of(raster.count, mask))
    assert torch.equal(network_input(raster, mask, 60.0, 0.05)[3], confidence)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1, 1])
def test_an_implausibly_distant_scanner_position_is_unknown(axis, side):
    """For example a pose of zeros with map coordinates: 20 times the scan's largest extent from the points, here 4."""
    xyz = np.random.default_rng(0).uniform(-1, 1, (200, 3)) * (2, 1, 0.5) + (500, 600, 70)
    scene = scene_from_arrays(xyz, np.full((200, 3), 9, np.uint8))
    edge, reach = (scene.bounds[max(side, 0), axis], 20 * np.ptp(scene.bounds[:, 0]))
    near, far = xyz[0].copy(), xyz[0].copy()
    near[axis], far[axis] = edge + 0.99 * side * reach, edge + 1.01 * side * reach
    scans = tuple(ScanSummary("", 0, place) for place in (tuple(near.tolist()), tuple(far.tolist()), None))
    scene = replace(scene, meta=ScanDescription(scans=scans))
    places = scene.station_places
    assert np.array_equal(places[0], near) and np.isnan(places[1:]).all()
