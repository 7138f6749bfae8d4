"""Crops of training pairs: where they are, what they depend on, and that their flow fits."""

import numpy as np
import pytest
import torch

from pointglass.model.common.errors import DataError
from pointglass.model.data.crops import Crops, Prefetcher
from pointglass.model.train.objective import inside_flow, warp


def test_a_batch_depends_only_on_seed_step_and_process(pairs):
    crops, again = Crops([pairs], 32, 5), Crops([pairs], 32, 5)
    for _ in range(3):
        again.batch(99, 2)
    a, b = crops.batch(7, 3, 1), again.batch(7, 3, 1)
    assert torch.equal(a.x, b.x) and torch.equal(a.colour, b.colour) and torch.equal(a.neighbour, b.neighbour)
    assert not torch.equal(a.x, crops.batch(8, 3, 1).x) and not torch.equal(a.x, crops.batch(7, 3, 1, process=1).x)


@pytest.mark.slow
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


def test_crops_of_a_noisy_scan_are_averaged_where_they_are_sparse_as_its_pictures_are(tmp_path):
    rng = np.random.default_rng(4)
    measured = rng.random((1, 6, 96, 96)).astype(np.float16)
    measured[:, 3], measured[:, 4], measured[:, 5] = rng.random((96, 96)) < 0.01, 0.0, 1.0
    np.save(tmp_path / "measured.npy", measured * (measured[:, 3:4] > 0))
    np.save(tmp_path / "truth.npy", np.zeros((1, 5, 96, 96), np.uint8))
    np.save(tmp_path / "noise.npy", np.full((1, 1, 96, 96), 0.07, np.float16))
    weights = []
    for overall in (0.03, 0.07):
        (tmp_path / "pairs.json").write_text(f'{{"overall": {overall}}}')
        weights.append(Crops([tmp_path], 64, 1, recolour=False).batch(0, 8).x[:, 3])
    (tmp_path / "pairs.json").write_text("[]")
    with pytest.raises(DataError, match=r"noise cannot be read.*pairs\.json|pairs\.json.*noise cannot be read"):
        Crops([tmp_path], 64, 1)
    assert weights[0].max() == 1.0 and 0 < weights[1].max() < 0.8 and torch.equal(weights[0] > 0, weights[1] > 0)


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


@pytest.mark.slow
def test_batches_prepared_by_workers_are_the_same(pairs):
    crops = Crops([pairs], 32, 4)
    with Prefetcher(crops, 2, 1, 0, 2) as ahead:
        made = [ahead.batch(step) for step in range(3, 7)]
    for step, batch in zip(range(3, 7), made, strict=True):
        alone = crops.batch(step, 2, 1)
        assert torch.equal(batch.x, alone.x) and torch.equal(batch.colour, alone.colour)
        assert torch.equal(torch.nan_to_num(batch.flow), torch.nan_to_num(alone.flow))
