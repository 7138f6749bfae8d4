"""Pictures of scans and the true ones beside them, as they are made for training."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from rooms import make_room

from pointglass.model.common.linear_light import to_linear, to_srgb
from pointglass.model.data import pairs as pairs_module
from pointglass.model.data.dataset import MemoryPicture
from pointglass.model.data.pairs import _truth, build, flow_to
from pointglass.model.data.stations import load_scene
from pointglass.model.data.surfaces.projected import project_scan, scan_spacing


def test_flow_is_the_motion_of_a_plane_and_nan_where_occluded(tmp_path):
    pose = np.diag([1.0, 1.0, 1.0, 1.0])
    depth = np.full((60, 80), 4.0, np.float32)
    depth[:, 40:] = 2.0  # a nearer half to the right
    shot = MemoryPicture(np.zeros((60, 80, 3), np.uint8), 50.0, pose, depth)
    moved = pose.copy()
    moved[0, 3] = -0.2  # to the left: the near half moves right by 5 pixels, the far one by 2.5
    flow = flow_to(shot, moved, SimpleNamespace(width=80, height=60, fx=50.0, fy=50.0, cx=40.0, cy=30.0), 1).astype(float)
    assert np.allclose(flow[0, 5:-5, 5:30], 2.5, atol=0.01) and np.allclose(flow[0, 5:-5, 45:70], 5.0, atol=0.01)
    moved[0, 3] = 0.2  # to the right: the near half moves left and occludes the far one
    flow = flow_to(shot, moved, SimpleNamespace(width=80, height=60, fx=50.0, fy=50.0, cx=40.0, cy=30.0), 1).astype(float)
    assert np.isnan(flow[0, 5:-5, 39]).all() and np.allclose(flow[0, 5:-5, 10:30], -2.5, atol=0.01)


def test_pairs_store_coverage_and_unknown_pixels(tmp_path):
    scene = load_scene(make_room(tmp_path / "box"))
    shot = scene.views[0]
    covered = np.ones((shot.height, shot.width), np.float32)
    covered[:5] = 0.5
    known = np.ones((shot.height, shot.width), bool)
    known[:, :3] = False
    shot = MemoryPicture(shot.rgb(), shot.fl, shot.camera_to_world, shot.depth(), covered, known)

    class Place:
        name = "made"
        views = (shot,)
        scan = staticmethod(scene.scan)

    build([Place()], tmp_path / "out", scans=1, variants=1)
    truth = np.load(tmp_path / "out" / "truth.npy")
    assert (truth[0, 3, :5] == 128).all() and (truth[0, 3, 5:] == 255).all()
    assert (truth[0, 4, :, :3] == 0).all() and (truth[0, 4, :, 3:] == 255).all()


def test_pairs_that_fail_leave_no_files(tmp_path):
    scene = load_scene(make_room(tmp_path / "box"))
    before = sorted(tmp_path.rglob("*"))

    class Stopped:
        name, views = "stopped", scene.views

        def scan(self, seed):
            if seed > 1000:  # the first is done
                raise KeyboardInterrupt
            return scene.scan(seed)

    with pytest.raises(KeyboardInterrupt):
        build([Stopped()], tmp_path / "out", scans=2, variants=1)
    assert sorted(tmp_path.rglob("*")) == before


def test_downsampled_true_pictures_average_linear_light_by_coverage():
    colour = np.zeros((6, 8, 3), np.uint8)
    colour[:4] = np.random.default_rng(0).integers(0, 256, (4, 8, 3))
    colour[4:] = [[[255, 200, 0]], [[0, 100, 0]]]
    covered = np.random.default_rng(1).choice([0, 0.25, 1.0], (6, 8)).astype(np.float32)
    covered[4:] = 1.0
    covered[:2, :2] = 0.0  # background
    known = np.random.default_rng(2).random((6, 8)) < 0.5
    made = _truth(MemoryPicture(colour, 9.0, np.eye(4), covered=covered, usable=known), 2)
    assert (made[:3, 2] == np.array([188, 160, 0])[:, None]).all(), "half the light of 255 is 188 in sRGB"
    for row in range(3):
        for column in range(4):
            block = np.s_[2 * row : 2 * row + 2, 2 * column : 2 * column + 2]
            weight = covered[block].ravel() if covered[block].any() else np.ones(4)
            light = to_linear(colour[block].reshape(4, 3) / 255)
            mean = to_srgb((light * weight[:, None]).sum(0) / weight.sum()) * 255
            assert np.abs(made[:3, row, column] - mean).max() < 1.5
            assert np.abs(made[3:, row, column] - 255 * np.array([covered[block].mean(), known[block].mean()])).max() <= 0.5
    whole = MemoryPicture(colour, 9.0, np.eye(4), covered=covered)
    assert np.array_equal(_truth(whole, 1)[:3].transpose(1, 2, 0), colour), "at full size nothing is changed"


def test_decimation_keeps_the_same_points_in_every_picture(tmp_path):
    scene = load_scene(make_room(tmp_path / "box"))
    scan, shot = scene.scan(1), scene.views[0]
    number = np.arange(len(scan.xyz))
    scan = replace(scan, rgb=np.stack([number & 255, number >> 8 & 255, number >> 16], 1).astype(np.uint8))
    aside = shot.camera_to_world.copy()
    aside[:3, 3] += 0.3
    seen = [project_scan(scan, shot, 9, camera_to_world=pose) for pose in (shot.camera_to_world, aside)]
    numbers = [(view.rgb.long() * torch.tensor([1, 256, 65536])).sum(1).numpy() for view in seen]
    both, first, second = np.intersect1d(numbers[0], numbers[1], return_indices=True)
    assert min(map(len, numbers)) > len(both) > 500
    assert torch.equal(seen[0].rank[first], seen[1].rank[second]) and seen[0].rank.unique().numel() > 0.99 * len(numbers[0])


def test_a_neighbour_lacks_the_same_station_and_flow_is_nan_in_patches(tmp_path, monkeypatch):
    """A difference between the two pictures would count as instability of the network."""
    def lacking(width, height, stations, density, _rng):
        patches = np.ones((height, width), np.float32)
        patches[10:20, 5:25] = 0.4
        return pairs_module.Degradation(density, patches, np.array([1, 0], np.float32))

    monkeypatch.setattr(pairs_module, "degrade", lacking)
    monkeypatch.setattr(pairs_module, "_density", lambda _rng: 1.0)
    scene = load_scene(make_room(tmp_path / "box"))
    seen, raster_of = [], pairs_module.raster_of
    monkeypatch.setattr(pairs_module, "raster_of", lambda view, keep, apart: (
        seen.append((set(view.station[keep].tolist()), float(keep.float().mean()))), raster_of(view, keep, apart))[1])
    made = list(pairs_module.place_pairs(scene, seed=1, scans=1, variants=1, preset="off", neighbours=True))
    assert len(made) == 4 and [stations for stations, _ in seen] == [{0}] * 8
    for pair, (_, kept), (_, beside) in zip(made, seen[::2], seen[1::2], strict=True):
        assert pair.flow is not None and np.isnan(pair.flow[:, 10:20, 5:25]).all()
        assert np.isfinite(pair.flow[:, 21:35, 2:40]).mean() > 0.8 and kept < beside


@pytest.mark.parametrize("neighbours", [True, False])
def test_a_decimated_picture_uses_the_spacing_of_its_points(tmp_path, monkeypatch, neighbours):
    scene, given = load_scene(make_room(tmp_path / "box")), []
    raster_of, measured_input = pairs_module.raster_of, pairs_module.measured_input
    monkeypatch.setattr(pairs_module, "raster_of", lambda seen, keep, apart: (
        given.append(apart), raster_of(seen, keep, apart))[1])
    monkeypatch.setattr(pairs_module, "measured_input", lambda raster, mask, focal, apart: (
        given.append(apart), measured_input(raster, mask, focal, apart))[1])
    made = list(pairs_module.place_pairs(scene, seed=2, scans=1, variants=2, preset="off", neighbours=neighbours))
    spacing, times = scan_spacing(scene.scan(2000)), 4 if neighbours else 2
    expected = [spacing / pair.where["density"] ** 0.5 for pair in made for _ in range(times)]
    assert given == pytest.approx(expected) and len({pair.where["density"] for pair in made}) > 3


def test_some_scans_have_no_scanner_positions(tmp_path, monkeypatch):
    """As LAS and PLY files: their points have equal weights."""
    scene, given = load_scene(make_room(tmp_path / "box")), []
    monkeypatch.setattr(pairs_module, "project_scan", lambda scan, *rest: (
        given.append(scan.places is not None), project_scan(scan, *rest))[1])
    made = list(pairs_module.place_pairs(scene, seed=1, scans=6, variants=1, preset="off"))
    assert given == [pair.where["placed"] for pair in made] and {True, False} == set(given)


def test_some_scans_have_widely_different_exposures(tmp_path):
    scene = load_scene(make_room(tmp_path / "box"))

    def ratio(seed):
        scan = scene.scan(seed)
        a, b = (scan.rgb[scan.station == s].astype(float).mean() for s in (0, 1))
        return abs(np.log(a / b))

    ratios = np.array([ratio(seed) for seed in range(24)])
    assert (ratios > 0.3).any() and np.median(ratios) < 0.2
