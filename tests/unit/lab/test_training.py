"""Training: pairs, crops, the loss; exact resume after a kill; equality of one and two processes."""

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import torch
from rooms import make_room

from pointglass.model.common.errors import DataError
from pointglass.model.common.linear_light import to_linear, to_srgb
from pointglass.model.data import pairs as pairs_module
from pointglass.model.data.crops import Crops, Prefetcher
from pointglass.model.data.dataset import MemoryPicture
from pointglass.model.data.pairs import _truth, build, flow_to
from pointglass.model.data.stations import load_scene
from pointglass.model.data.surfaces.projected import project_scan, scan_spacing
from pointglass.model.network.unet import PaperUNet
from pointglass.model.network.weights import load_weights
from pointglass.model.train.objective import Objective, excess_error, inside_flow, local_light, warp
from pointglass.model.train.trainer import Process, TrainConfig, Trainer, train
from pointglass.model.train.training_log import PICTURES_EVERY, TrainingLog

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def pairs(tmp_path_factory):
    root = tmp_path_factory.mktemp("pairs")
    assert build([load_scene(make_room(root / "box"))], root / "out", scans=1, variants=2, neighbours=True) == 8
    return root / "out"


def _config(pairs, out, **changes):
    return TrainConfig(**{"pairs": (str(pairs),), "out": str(out), "quality": "fast", "steps": 8, "batch": 2, "crop": 32,
                          "neighbours": 1, "save_every": 0.0, "device": "cpu", **changes})


def _state(path):
    return load_weights(path)[0].state_dict()


class _Killed(Exception):
    pass


def test_training_resumes_exactly_after_a_kill(pairs, tmp_path):
    whole = _state(train(_config(pairs, tmp_path / "whole")))

    def kill(step):
        if step == 5:
            raise _Killed

    with pytest.raises(_Killed):
        train(_config(pairs, tmp_path / "parts", save_every=0.0), on_step=kill)
    parts = _state(train(_config(pairs, tmp_path / "parts")))
    assert all(torch.equal(whole[k], parts[k]) for k in whole)
    assert json.loads((tmp_path / "whole" / "fast-filtered" / "config.json").read_text())["crop"] == 32
    assert not list(tmp_path.rglob("*.partial"))


def test_another_seed_gives_other_weights(pairs, tmp_path):
    a, b = (_state(train(_config(pairs, tmp_path / str(seed), seed=seed))) for seed in (1, 2))
    assert any(not torch.equal(a[k], b[k]) for k in a)


def test_an_invalid_checkpoint_is_refused_by_name(pairs, tmp_path):
    (tmp_path / "fast-filtered").mkdir()
    (tmp_path / "fast-filtered" / "checkpoint.pt").write_bytes(b"not a checkpoint")
    with pytest.raises(DataError, match=r"checkpoint\.pt: not a checkpoint") as caught:
        train(_config(pairs, tmp_path))
    assert "\n" not in str(caught.value)


def test_two_processes_average_their_gradients(pairs, tmp_path):
    script = tmp_path / "both.py"
    script.write_text(
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "from pointglass.model.train.trainer import TrainConfig, train\n"
        "import torch.distributed as dist\n"
        "seen = []\n"
        "train(TrainConfig(pairs=(sys.argv[2],), out=sys.argv[3], quality='fast', steps=2, batch=1, crop=32,\n"
        "                  neighbours=0, device='cpu', warmup=1),\n"
        "      on_step=lambda step: seen.append((step, dist.get_world_size())))\n"
        "assert seen == [(1, 2), (2, 2)], seen\n"
    )
    run = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", "2", str(script)]
    done = subprocess.run([*run, str(ROOT), str(pairs), str(tmp_path / "two")], capture_output=True, text=True,
                          timeout=240, env={**os.environ, "OMP_NUM_THREADS": "1"})
    assert done.returncode == 0, done.stderr[:3000]
    assert json.loads((tmp_path / "two" / "fast-filtered" / "config.json").read_text())["processes"] == 2
    two = torch.load(tmp_path / "two" / "fast-filtered" / "checkpoint.pt", weights_only=True)["network"]

    config = _config(pairs, tmp_path / "one", steps=2, batch=1, neighbours=0, warmup=1)
    trainer = Trainer(config, Process(0, 1, torch.device("cpu")))
    objective, crops = Objective(None, 0.1, 0.1, 0.1, config.structure_weight), Crops([pairs], 32, config.seed)

    class Mean:
        """Both processes' crops, one after the other: the mean of their losses has the mean of their gradients."""

        def __call__(self, made, beside, batch):
            losses = [objective(made[k : k + 1], beside, crops.batch(trainer.step, 1, 0, process=k))[0] for k in (0, 1)]
            return (losses[0] + losses[1]) / 2, {}

    for step in range(2):
        both = [crops.batch(step, 1, 0, process=k) for k in (0, 1)]
        batch = replace(both[0], x=torch.cat([b.x for b in both]))
        trainer.advance(batch, Mean(), config.learning_rate(step, step / 2))  # type: ignore[arg-type]
    one = trainer.network.state_dict()
    start = Trainer(config, trainer.process).network.state_dict()

    def apart(a, b):
        return sum(float((a[k] - b[k]).square().sum()) for k in a) ** 0.5

    train(_config(pairs, tmp_path / "alone", steps=2, batch=1, neighbours=0, warmup=1))
    alone = torch.load(tmp_path / "alone" / "fast-filtered" / "checkpoint.pt", weights_only=True)["network"]
    # Adam's first steps are nearly the signs of gradients, so rounding changes a few weights much: compare norms
    assert apart(one, two) < 0.2 * apart(one, start) < 0.2 * 2 * apart(one, alone)


def test_a_batch_depends_only_on_seed_step_and_process(pairs):
    crops, again = Crops([pairs], 32, 5), Crops([pairs], 32, 5)
    for _ in range(3):
        again.batch(99, 2)
    a, b = crops.batch(7, 3, 1), again.batch(7, 3, 1)
    assert torch.equal(a.x, b.x) and torch.equal(a.colour, b.colour) and torch.equal(a.neighbour, b.neighbour)
    assert not torch.equal(a.x, crops.batch(8, 3, 1).x) and not torch.equal(a.x, crops.batch(7, 3, 1, process=1).x)


def test_crops_are_anywhere_in_a_picture_and_may_have_its_height(tmp_path):
    np.save(tmp_path / "measured.npy", np.zeros((1, 6, 32, 36), np.float16))
    truth = np.broadcast_to(np.arange(36), (1, 5, 32, 36)).astype(np.uint8)
    np.save(tmp_path / "truth.npy", truth)
    batch = Crops([tmp_path], 32, 1).batch(0, 100)
    first = torch.round(255 * batch.known.amin((1, 2, 3))).int()
    assert set(first.tolist()) == {0, 1, 2, 3, 4}


def test_flow_leads_to_the_same_surface_in_rotated_and_mirrored_crops(tmp_path):
    """A pattern and the same pattern moved unevenly: warped by the flow it must equal the first."""
    j, i = np.mgrid[0:60, 0:80].astype(float)
    flow = np.stack([3 + 2 * np.sin(j / 9), -2 + 1.5 * np.cos(i / 11)])

    def pattern(x, y):
        planes = [0.3 + 0.1 * np.sin(x / 5 + c) + 0.1 * np.cos(y / 7 - c) for c in range(6)]
        planes[3] = np.ones_like(x)  # everything is measured
        return np.stack(planes)

    np.save(tmp_path / "neighbours.npy", pattern(i, j).astype(np.float16)[None])
    np.save(tmp_path / "measured.npy", pattern(i + flow[0], j + flow[1]).astype(np.float16)[None])
    np.save(tmp_path / "truth.npy", np.zeros((1, 5, 60, 80), np.uint8))
    np.save(tmp_path / "flow.npy", flow.astype(np.float16)[None])
    crops = Crops([tmp_path], 32, 3)
    for step in range(24):
        batch = crops.batch(step, 1, 1)
        gap = (warp(batch.neighbour, batch.flow) - batch.x).abs() * inside_flow(batch.flow)
        assert gap.max() < 0.01 < (batch.neighbour - batch.x).abs().max()


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


def test_the_loss_ignores_unknown_pixels_and_rewards_temporal_stability(pairs):
    batch = Crops([pairs], 32, 1).batch(0, 2, 1)
    objective = Objective(None, 0.1, 0.5, 1.0)
    perfect = torch.cat([batch.colour, torch.ones(2, 1, 32, 32)], 1)
    _, terms = objective(perfect, perfect[:0], batch)
    assert terms["l1"] == 0 and terms["coverage"] == 0 and "change" not in terms
    batch.known[:, :, :16] = 0
    spoiled = perfect.clone()
    spoiled[:, :, :16] = 0.5
    _, terms = objective(spoiled, perfect[:0], batch)
    assert terms["l1"] == 0 and terms["coverage"] == 0
    spoiled[:, 3, 16:] = 0.25
    assert objective(spoiled, perfect[:0], batch)[1]["coverage"] == pytest.approx(0.375)
    steady = objective(perfect, warp(perfect[:1], -torch.nan_to_num(batch.flow)), batch)[1]["change"]
    shaken = objective(perfect, torch.rand(1, 4, 32, 32), batch)[1]["change"]
    assert steady < shaken


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
    both, first, second = np.intersect1d(*numbers, return_indices=True)
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


def test_invalid_pairs_are_refused_by_name(pairs, tmp_path):
    with pytest.raises(DataError, match=r"measured\.npy.*cannot be read"):
        Crops([tmp_path], 32, 1)
    np.save(tmp_path / "measured.npy", np.zeros((2, 4, 40, 40), np.float16))
    with pytest.raises(DataError, match=r"measured\.npy.*expected \(pairs, 6"):
        Crops([tmp_path], 32, 1)
    np.save(tmp_path / "measured.npy", np.zeros((2, 6, 40, 40), np.float16))
    np.save(tmp_path / "truth.npy", np.zeros((3, 5, 40, 40), np.uint8))
    with pytest.raises(DataError, match=r"truth\.npy.*does not match"):
        Crops([tmp_path], 32, 1)
    with pytest.raises(DataError, match="smaller than"):
        Crops([pairs], 320, 1)


def test_some_scans_have_widely_different_exposures(tmp_path):
    scene = load_scene(make_room(tmp_path / "box"))

    def ratio(seed):
        scan = scene.scan(seed)
        a, b = (scan.rgb[scan.station == s].astype(float).mean() for s in (0, 1))
        return abs(np.log(a / b))

    ratios = np.array([ratio(seed) for seed in range(24)])
    assert (ratios > 0.3).any() and np.median(ratios) < 0.2


def test_batches_prepared_by_workers_are_the_same(pairs):
    crops = Crops([pairs], 32, 4)
    with Prefetcher(crops, 2, 1, 0, 2) as ahead:
        made = [ahead.batch(step) for step in range(3, 7)]
    for step, batch in zip(range(3, 7), made, strict=True):
        alone = crops.batch(step, 2, 1)
        assert torch.equal(batch.x, alone.x) and torch.equal(batch.colour, alone.colour)
        assert torch.equal(torch.nan_to_num(batch.flow), torch.nan_to_num(alone.flow))


def test_scalars_and_pictures_reach_tensorboard(pairs, tmp_path, monkeypatch):
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    from pointglass.model.train import training_log

    monkeypatch.setattr(training_log, "EVERY", 2)
    monkeypatch.setattr(training_log, "PICTURES_EVERY", 4)
    train(_config(pairs, tmp_path / "run"))
    board = EventAccumulator(str(tmp_path / "run" / "fast-filtered" / "tensorboard"))
    board.Reload()
    assert {"loss", "l1", "rate"} <= set(board.Tags()["scalars"])
    lines = [json.loads(line) for line in (tmp_path / "run" / "fast-filtered" / "log.jsonl").read_text().splitlines()]
    told = {event.step: event.value for event in board.Scalars("loss")}
    assert told == pytest.approx({line["step"]: line["loss"] for line in lines}) and 8 in told
    picture = board.Images("filled, made, true")[-1]
    assert (picture.width, picture.height) == (3 * 32, 2 * 32)


def test_pictures_for_tensorboard_do_not_change_the_averaged_network(tmp_path, monkeypatch):
    """The paper's network has running statistics, which it updates in training mode."""
    monkeypatch.setattr("pointglass.model.train.trainer.make_network", lambda _quality: PaperUNet(4))
    averaged = Trainer(TrainConfig((), str(tmp_path), quality="paper"), Process(0, 1, torch.device("cpu"))).averaged
    before = {name: value.clone() for name, value in averaged.state_dict().items()}
    batch = SimpleNamespace(x=torch.rand(4, 5, 64, 64), colour=torch.rand(4, 3, 64, 64))
    with TrainingLog(tmp_path, 0, shown=True) as log:
        assert log.board is not None
        log.pictures(PICTURES_EVERY, averaged, batch)
    assert any("running_mean" in name for name in before)
    assert all(torch.equal(before[name], value) for name, value in averaged.state_dict().items())


def test_excess_error_counts_only_where_the_picture_is_further_from_the_truth_than_its_input(seed):
    rng = np.random.default_rng(seed)
    true = torch.tensor(rng.random((1, 3, 64, 64)), dtype=torch.float32)
    weight = torch.ones(1, 1, 64, 64)
    filled = true + 0.2
    assert float(excess_error(true + 0.1, filled, true, weight)) == 0, "nearer to the truth"
    assert float(excess_error(true - 0.2, filled, true, weight)) < 1e-6, "as far, on the other side"
    assert float(excess_error(true + 0.25, filled, true, weight)) == pytest.approx(0.05, rel=1e-3)
    left = weight.clone()
    left[..., 32:] = 0
    wrong = true + 0.2
    wrong[..., 32:] += 1
    assert float(excess_error(wrong, filled, true, left)) < 1e-6, "where the truth is unknown nothing counts"


def test_local_light_sees_a_shift_of_brightness_and_no_texture(seed):
    """A shift counts in full at both sizes; a texture of alternate pixels, which has no mean, counts nothing."""
    generator = torch.Generator().manual_seed(seed)
    true = torch.rand(2, 3, 32, 48, generator=generator)
    weight = torch.ones(2, 1, 32, 48)
    y, x = torch.meshgrid(torch.arange(32), torch.arange(48), indexing="ij")
    assert float(local_light(true + 0.1 * (-1.0) ** (x + y), true, weight)) < 1e-6
    assert float(local_light(true + 0.1, true, weight)) == pytest.approx(0.1, rel=1e-4)
    weight[:, :, :, 24:] = 0.0  # unknown truth does not count
    wrong = true.clone()
    wrong[..., 24:] += 1.0
    assert float(local_light(wrong, true, weight)) < 1e-6
