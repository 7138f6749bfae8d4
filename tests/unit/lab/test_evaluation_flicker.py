"""Flicker: a frame is warped to where the next one sees it, and a film's figures say what it shows."""


import numpy as np
import pytest
import torch
import torch.nn.functional as F
from evaluation_files import rgb_of

import pointglass.model.evaluation.room_scores as scene_module
from pointglass.model.data.dataset import MemoryPicture, MergedScan
from pointglass.model.data.surfaces.projected import project_scan
from pointglass.model.evaluation.metrics.flicker import measure_flicker, middle_stretch, reprojection
from pointglass.model.evaluation.room_scores import evaluate

pytestmark = pytest.mark.usefixtures("one_thread")


def _plane(shift: float, tilt: float = 0.0, size=(60, 80), fl: float = 70.0) -> MemoryPicture:
    """A textured plane z = 3 + tilt x world x, seen along the world's -z by a camera moved along x."""
    pose = np.eye(4)
    pose[0, 3] = shift
    i = np.arange(size[1]) + 0.5
    j = np.arange(size[0]) + 0.5
    ray = (i - size[1] / 2) / fl
    z = np.broadcast_to((3 + tilt * shift) / (1 - tilt * ray), size)
    x, y = shift + ray * z, ((j - size[0] / 2) / fl)[:, None] * z
    colour = np.stack([128 + 60 * np.sin(4 * x), 128 + 60 * np.cos(3 * y), 128 + 60 * np.sin(2 * x + 2 * y)], -1)
    return MemoryPicture(np.rint(colour).astype(np.uint8), fl, pose, z.astype(np.float32))


@pytest.mark.parametrize("tilt", [0.0, 0.4])
def test_warping_draws_the_next_frame_where_this_one_sees_it(tilt):
    """Bilinear sampling is exact on a picture affine in its pixels, so where each pixel goes can be read off."""
    before, after = _plane(0.0, tilt), _plane(0.15, tilt)
    back = reprojection(before, after)
    j, i = np.mgrid[0:60, 0:80] + 0.5
    assert before.z is not None
    there = (i - 40) / 70 - 0.15 / before.z  # x / z in the moved camera: the plane's z is the same in both
    column = 40 + 70 * there
    expected = np.stack([0.2 + 0.005 * column, 0.8 - 0.01 * j, 0.1 + 0.004 * (column + j)]).astype(np.float32)
    affine = torch.from_numpy(np.stack([0.2 + 0.005 * i, 0.8 - 0.01 * j, 0.1 + 0.004 * (i + j)]).astype(np.float32))
    made = back.warp(affine)
    assert (made - torch.from_numpy(expected))[:, back.valid].abs().max() < 1e-5
    assert torch.equal(back.valid, torch.from_numpy((column >= 0.5) & (column <= 79.5)))
    first, second = (torch.from_numpy(p.rgb()).permute(2, 0, 1) / 255 for p in (before, after))
    assert back.change(first, second) < 0.004 < 0.02 < float((first - second).abs().mean())  # rounding to 8 bits, and texture


def test_what_the_next_frame_does_not_see_is_left_out():
    """A near square before a wall: what it uncovers and covers when the camera moves is compared with nothing."""
    def shot(shift):
        pose = np.eye(4)
        pose[0, 3] = shift
        z = np.full((60, 80), 4.0, np.float32)
        left = round(40 + 70 * (-0.3 - shift) / 2)
        z[20:40, left : left + 20] = 2.0
        return MemoryPicture(np.zeros((60, 80, 3), np.uint8), 70.0, pose, z)

    valid = reprojection(shot(0.0), shot(0.2)).valid
    left = 40 - 10  # of the square now; it moves by 7 pixels, the wall by 3.5
    assert valid[20:40, left + 1 : left + 19].all()
    assert not valid[21:39, left - 3 : left].any()  # the square covers this next
    assert valid[:18, 10:].all() and valid[42:, 10:].all()


def _film():
    return [_plane(0.03 * n) for n in range(4)]


def test_flicker_of_truth_is_one_noise_is_more_and_blur_pays_in_gradient():
    generator = torch.Generator().manual_seed(3)

    def draw(shot):
        truth = rgb_of(shot)
        return {
            ("same", 1.0): truth, ("noisy", 1.0): truth + 0.05 * torch.randn(truth.shape, generator=generator),
            ("blurred", 1.0): F.avg_pool2d(F.pad(truth[None], (7,) * 4, mode="replicate"), 15, 1)[0],
        }

    rows = {row["method"]: row for row in measure_flicker(_film(), draw)}
    assert set(rows) == {"same", "noisy", "blurred"}
    assert rows["same"]["flicker"] == pytest.approx(1.0) and rows["same"]["gradient"] == pytest.approx(1.0)
    assert rows["noisy"]["flicker"] > 3 and rows["noisy"]["gradient"] > 1.2
    assert rows["blurred"]["gradient"] < 0.95
    assert 0.8 < rows["same"]["valid"] <= 1
    assert middle_stretch(list(range(10)), 4) == [3, 4, 5, 6] and middle_stretch([1, 2], None) == [1, 2]


def test_the_same_points_survive_in_every_frame(room, monkeypatch):
    seeds = []

    def spy(scan, shot, seed=0, *rest, **more):
        seeds.append(seed)
        return project_scan(scan, shot, seed, *rest, **more)

    monkeypatch.setattr(scene_module, "project_scan", spy)
    evaluate(room, densities=(0.3,), views=1, open3d=False)
    assert len(seeds) == 5 and len(set(seeds[1:])) == 1  # one view, four frames
    xyz = np.random.default_rng(1).uniform(-1, 1, (500, 3)) - (0, 0, 4)
    scan = MergedScan(xyz, np.zeros((500, 3), np.uint8), np.zeros(500, np.uint8))
    here, there = (project_scan(scan, _plane(shift), seed=7) for shift in (0.0, 0.1))
    both = {float(z) for z in here.z} & {float(z) for z in there.z}  # moving sideways keeps a point's depth
    ranks = [{float(z): float(r) for z, r in zip(seen.z, seen.rank, strict=True) if float(z) in both} for seen in (here, there)]
    assert len(both) > 100 and ranks[0] == ranks[1]
