"""What training crops are disturbed by: textures, stations that disagree, points that stray."""

import numpy as np
import torch

from model.data.crops import Crops


def plain_wall(folder):
    """One pair: a wall of one colour, measured at half of its pixels."""
    rng = np.random.default_rng(0)
    x = np.full((1, 5, 64, 64), 0.4, np.float16)
    x[0, 3] = rng.random((64, 64)) < 0.5
    np.save(folder / "inputs.npy", x)
    truth = np.full((1, 5, 64, 64), 102, np.uint8)
    truth[:, 3:] = 255
    np.save(folder / "truth.npy", truth)


def test_stations_that_disagree_are_speckle_on_points_and_their_mean_in_truth(tmp_path, monkeypatch):
    plain_wall(tmp_path)
    monkeypatch.setattr("model.data.disturbances.GRAIN_SHARE", 0.0)
    monkeypatch.setattr("model.data.disturbances.SPECKLE_SHARE", 1.0)
    monkeypatch.setattr("model.data.disturbances.STRAY_SHARE", 0.0)
    crops = Crops([tmp_path], 64, 3)
    for step in range(12):
        batch = crops.batch(step, 1)
        points, truth = batch.x[0, :3][:, batch.x[0, 3] > 0], batch.colour[0]
        levels = {tuple(pixel) for pixel in points.T.mul(1000).round().int().tolist()}
        assert len(levels) <= 2, "a point is of one station or of the other"
        assert float((points.mean(1) - truth.mean((1, 2))).abs().max()) < 0.02, "the truth leans to neither"
        assert float((truth[:, 1:] - truth[:, :-1]).abs().max()) < 0.05, "and has no speckle"


def test_grain_is_the_same_texture_on_points_and_truth(tmp_path, monkeypatch):
    """Where a pixel is measured, points and truth get the same factor: what was equal stays equal."""
    plain_wall(tmp_path)
    monkeypatch.setattr("model.data.disturbances.SPECKLE_SHARE", 0.0)
    monkeypatch.setattr("model.data.disturbances.STRAY_SHARE", 0.0)
    crops, grained = Crops([tmp_path], 64, 2), 0
    for step in range(12):
        batch = crops.batch(step, 1)
        measured = batch.x[:, 3:4] > 0
        assert float(((batch.x[:, :3] - batch.colour).abs() * measured).max()) < 2e-3
        assert torch.equal(batch.coverage, torch.ones(1, 1, 64, 64)) and torch.equal(batch.known, batch.coverage)
        grained += bool(batch.colour[0, 0].std() > 0.003)
    assert 1 <= grained <= 10


def test_points_that_stray_do_so_alone_and_their_truth_stays_even(tmp_path, monkeypatch):
    plain_wall(tmp_path)
    monkeypatch.setattr("model.data.disturbances.GRAIN_SHARE", 0.0)
    monkeypatch.setattr("model.data.disturbances.SPECKLE_SHARE", 0.0)
    monkeypatch.setattr("model.data.disturbances.STRAY_SHARE", 1.0)
    crops, spread = Crops([tmp_path], 64, 3), []
    for step in range(24):
        batch = crops.batch(step, 1)
        points, truth = batch.x[0, :3][:, batch.x[0, 3] > 0], batch.colour[0]
        assert float(truth.std((1, 2)).max()) < 1e-6, "what points alone have is none of the truth's"
        ratio = points / truth.mean((1, 2))[:, None]
        assert abs(float(ratio.mean()) - 1) < 0.02, "and leaves it as light as it was"
        assert float(ratio.std(0).mean()) < 0.3 * float(ratio.std(1).mean()), "nearly alike in all channels"
        residue = (ratio - ratio.mean()).flatten()
        spread.append((float(residue.std()), float((residue**4).mean() / residue.var() ** 2)))
    spreads, tails = np.array(spread).T
    assert spreads.min() > 0.003 and spreads.max() < 0.2 and np.median(tails) > 4, "most a little, some by much"


def test_colours_stay_as_they_are_where_asked(tmp_path):
    np.save(tmp_path / "inputs.npy", np.full((1, 5, 40, 40), 0.5, np.float16))
    truth = np.zeros((1, 5, 40, 40), np.uint8)
    truth[:, :3] = np.array([10, 100, 200])[:, None, None]
    np.save(tmp_path / "truth.npy", truth)
    true = torch.tensor([10, 100, 200]) / 255
    plain, other = (
        torch.stack([Crops([tmp_path], 32, 1, recolour=r).batch(s, 1).colour.mean((0, 2, 3)) for s in range(8)])
        for r in (False, True)
    )
    assert (plain - true).abs().max() < 0.05 < (other - true).abs().max()  # grain alone moves a mean a little
