"""Augmentation of training crops: textures, lettering, disagreeing stations, noise."""

import numpy as np
import pytest
import torch

from pointglass.model.data.crops import Crops
from pointglass.model.data.surfaces.lettering import covered, lettering
from pointglass.model.reference.projection import NOISE_SCALE

KINDS = ("GRAIN", "LETTERING", "SPECKLE")


@pytest.fixture
def only(monkeypatch):
    """A function that restricts augmentation to one kind."""

    def choose(kind: str, share: float = 1.0) -> None:
        for other in KINDS:
            monkeypatch.setattr(f"pointglass.model.data.augmentation.{other}_SHARE", share if other == kind else 0.0)
        monkeypatch.setattr("pointglass.model.data.augmentation.CLEAN_SHARE", 0.0 if kind == "NOISE" else 1.0)

    return choose


def plain_wall(folder):
    """One pair: a uniform wall, measured at half of its pixels."""
    rng = np.random.default_rng(0)
    x = np.full((1, 6, 64, 64), 0.4, np.float16)
    x[0, 5] = 1.0
    x[0, 3] = 1.0
    x *= rng.random((64, 64)) < 0.5
    np.save(folder / "measured.npy", x)
    truth = np.full((1, 5, 64, 64), 102, np.uint8)
    truth[:, 3:] = 255
    np.save(folder / "truth.npy", truth)


def test_disagreeing_stations_are_speckle_in_points_and_their_mean_in_truth(tmp_path, only):
    plain_wall(tmp_path)
    only("SPECKLE")
    crops = Crops([tmp_path], 64, 3)
    for step in range(12):
        batch = crops.batch(step, 1)
        points, truth = batch.x[0, :3][:, batch.x[0, 3] > 0], batch.colour[0]
        levels = {tuple(pixel) for pixel in points.T.mul(1000).round().int().tolist()}
        assert len(levels) <= 2, "a point is of one station or of the other"
        assert float((points.mean(1) - truth.mean((1, 2))).abs().max()) < 0.02, "the truth leans to neither"
        assert float((truth[:, 1:] - truth[:, :-1]).abs().max()) < 0.05, "and has no speckle"


def test_grain_is_the_same_texture_in_points_and_truth(tmp_path, only):
    """Measured pixels get the same factor in points and truth, so that equal colours stay equal."""
    plain_wall(tmp_path)
    only("GRAIN", 0.4)
    crops, grained = Crops([tmp_path], 64, 2), 0
    for step in range(12):
        batch = crops.batch(step, 1)
        measured = batch.x[:, 3:4] > 0
        assert float(((batch.x[:, :3] - batch.colour).abs() * measured).max()) < 2e-3
        assert torch.equal(batch.coverage, torch.ones(1, 1, 64, 64)) and torch.equal(batch.known, batch.coverage)
        grained += bool(batch.colour[0, 0].std() > 0.003)
    assert 1 <= grained <= 10


def test_lettering_in_points_and_truth_differs_only_at_edges(tmp_path, only):
    plain_wall(tmp_path)
    only("LETTERING")
    crops, lettered = Crops([tmp_path], 64, 4), 0
    for step in range(12):
        batch = crops.batch(step, 1)
        points, truth = (picture[0, :3][:, batch.x[0, 3] > 0] for picture in (batch.x, batch.colour))
        even = truth.median(1, keepdim=True).values
        inside = (truth - even).abs() > 0.02
        assert float((points - truth).abs().mean()) <= 0.5 * float((truth - even).abs().mean()) + 2e-3
        lettered += bool(inside.float().mean() > 0.01)
    assert lettered >= 6


def test_lettering_in_points_differs_only_by_their_position_in_the_pixel():
    """Pixels completely inside or outside a stroke are equal in both; only borders of strokes differ."""
    rng, differ = np.random.default_rng(2), []
    for _ in range(20):
        seen, true = lettering(rng, 96)
        assert seen.shape == true.shape == (3, 96, 96) and seen.dtype == true.dtype == np.float32
        assert true.min() > 0
        step = np.abs(np.diff(true, axis=1)).max(axis=0)[:, :-1] + np.abs(np.diff(true, axis=2)).max(axis=0)[:-1]
        even = np.ones((96, 96), bool)
        for dy in (-1, 0, 1):
            for dx in (-1, 0, 1):
                even[1:94, 1:94] &= step[1 + dy : 94 + dy, 1 + dx : 94 + dx] == 0
        inner = even[2:93, 2:93]
        assert np.abs(seen - true).max(axis=0)[2:93, 2:93][inner].max(initial=0) < 1e-6
        differ.append(float(np.abs(seen - true).mean()))
    assert max(differ) > 0.001, "points lie somewhere within their pixel"


def test_strokes_cover_positions_within_half_their_width():
    at = np.mgrid[0:20, 0:20][::-1] + 0.5
    share = covered(np.array([[[4.0, 10.0], [16.0, 10.0]]]), 2.0, at, 1e-6)
    plain = (np.hypot(at[0] - np.clip(at[0], 4, 16), at[1] - 10) < 2).astype(np.float32)
    assert np.array_equal(share, plain) and 40 < plain.sum() < 70
    assert not covered(np.array([[[40.0, 40.0], [50.0, 50.0]]]), 2.0, at, 1.0).any(), "beyond the crop"


def test_noise_is_in_points_only_and_its_level_is_an_input(tmp_path, only):
    plain_wall(tmp_path)
    only("NOISE")
    crops, spread = Crops([tmp_path], 64, 3), []
    for step in range(40):
        batch = crops.batch(step, 1)
        points, truth = batch.x[0, :3][:, batch.x[0, 3] > 0], batch.colour[0]
        assert float(truth.std((1, 2)).max()) < 1e-6, "the truth has none"
        residue = points - truth.mean((1, 2))[:, None]
        assert abs(float(residue.mean())) < 0.03, "and stays as bright as it was"
        assert float(residue.std(0).mean()) < 0.6 * float(residue.std(1).mean()), "nearly alike in all channels"
        kurtosis = float((residue**4).mean() / residue.var() ** 2)
        robust = float((residue.mean(0) - residue.mean(0).median()).abs().median()) / 0.6745
        level = float(batch.x[0, 5].mean()) / NOISE_SCALE
        spread.append((float(residue.std()), kurtosis, level / robust))
    spreads, tails, ratio = np.array(spread).T
    assert spreads.min() > 0.003 and spreads.max() < 0.25 and np.median(tails) > 4, "heavy tails"
    assert 0.7 < np.median(ratio) < 1.1 and np.quantile(ratio, 0.9) < 2.0, "the estimate is right or somewhat low"


def test_colours_are_unchanged_without_recolouring(tmp_path):
    np.save(tmp_path / "measured.npy", np.full((1, 6, 40, 40), 0.5, np.float16))
    truth = np.zeros((1, 5, 40, 40), np.uint8)
    truth[:, :3] = np.array([10, 100, 200])[:, None, None]
    np.save(tmp_path / "truth.npy", truth)
    true = torch.tensor([10, 100, 200]) / 255
    plain, other = (
        torch.stack([Crops([tmp_path], 32, 1, recolour=r).batch(s, 1).colour[0].flatten(1).median(1).values for s in range(8)])
        for r in (False, True)
    )
    assert (plain - true).abs().max() < 0.05 < (other - true).abs().max()  # grain and lettering may cover most of a crop
