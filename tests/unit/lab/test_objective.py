"""The training loss against plain sums, and the warp of its temporal term."""

import numpy as np
import pytest
import torch
from scipy.ndimage import map_coordinates

from pointglass.model.data.crops import Batch, Crops
from pointglass.model.train.objective import Objective, excess_error, inside_flow, local_light, warp


def test_warp_follows_a_known_motion():
    picture = torch.rand(1, 2, 9, 12)
    flow = torch.zeros(1, 2, 9, 12)
    flow[:, 0], flow[:, 1] = 2.0, -1.0
    moved = warp(picture, flow)
    assert torch.allclose(moved[..., 1:, :-2], picture[..., :-1, 2:], atol=1e-5)
    assert inside_flow(flow)[0, 0].sum() == 8 * 10
    flow[0, 0, 4, 4] = float("nan")
    assert not inside_flow(flow)[0, 0, 4, 4]


class _Squares(torch.nn.Module):
    """Replaces the perceptual distance and records its arguments."""

    def __init__(self):
        super().__init__()
        self.given = []

    def forward(self, a, b):
        self.given.append((a, b))
        return (a - b).square().mean()


def _random_batch(seed: int, count: int, beside: int, height: int = 11, width: int = 14) -> Batch:
    """Crops with background, partly covered and unknown pixels; flow with invisible pixels and ones that leave the picture."""
    rng = np.random.default_rng(seed)

    def random(*shape):
        return torch.from_numpy(rng.random(shape).astype(np.float32))

    coverage = torch.from_numpy(rng.choice([0.0, 0.3, 1.0], (count, 1, height, width)).astype(np.float32))
    known = torch.from_numpy(rng.choice([0.0, 0.6, 1.0], (count, 1, height, width)).astype(np.float32))
    flow = torch.from_numpy(rng.normal(0, 3, (beside, 2, height, width)).astype(np.float32))
    flow[:, :, torch.from_numpy(rng.random((height, width)) < 0.2)] = torch.nan
    return Batch(random(count, 5, height, width), random(count, 3, height, width), coverage, known,
                 random(beside, 5, height, width), flow)


def _plain_change(made: np.ndarray, beside: np.ndarray, flow: np.ndarray) -> float:
    """Mean difference of a picture (3, H, W) and its warped neighbour, over the pixels visible in the neighbour."""
    height, width = made.shape[1:]
    total, seen = 0.0, 0
    for n in range(len(flow)):
        for j in range(height):
            for i in range(width):
                x, y = i + flow[n, 0, j, i], j + flow[n, 1, j, i]
                if 0 <= x <= width - 1 and 0 <= y <= height - 1:
                    seen += 1
                    there = [map_coordinates(channel, [[y], [x]], order=1)[0] for channel in beside[n]]
                    total += np.abs(there - made[:, j, i]).sum()
    return total / (3 * seen)


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("count", [1, 3])
def test_the_loss_equals_plain_sums(monkeypatch, seed, count, channels):
    distance = _Squares()
    monkeypatch.setattr("pointglass.model.train.objective.perceptual", lambda _path: (distance, "squares"))
    batch = _random_batch(seed, count, 1)
    made, beside = torch.randn(count, channels, 11, 14) + 0.5, torch.rand(1, channels, 11, 14)
    loss, terms = Objective(None, 0.2, 0.3, 0.4)(made, beside, batch)
    picture, true, coverage, known = (t.double().numpy() for t in (made, batch.colour, batch.coverage, batch.known))
    weight = coverage * known
    expected = {"l1": (np.abs(picture[:, :3] - true) * weight).sum() / (3 * weight.sum())}
    shown = np.where(weight > 0.5, picture[:, :3].clip(0, 1), true)[-max(1, count // 2) :]
    assert np.allclose(distance.given[0][0].numpy(), shown) and np.allclose(distance.given[0][1].numpy(), true[-len(shown) :])
    expected["distance"] = ((shown - true[-len(shown) :]) ** 2).mean()
    expected["change"] = _plain_change(picture[0, :3], beside[:, :3].double().numpy(), batch.flow.numpy())
    total = 0.8 * expected["l1"] + 0.2 * expected["distance"] + 0.4 * expected["change"]
    if channels == 4:
        shown = picture[:, 3:].clip(np.where(coverage == 0, 0, -np.inf), np.where(coverage == 1, 1, np.inf))
        expected["coverage"] = (np.abs(shown - coverage) * known).mean()
        total += 0.3 * expected["coverage"]
    assert {name: float(value) for name, value in terms.items()} == pytest.approx(expected, rel=1e-4)
    assert float(loss) == pytest.approx(total, rel=1e-4)


def test_a_batch_without_known_pixels_has_no_gradient():
    batch = _random_batch(1, 2, 1)
    batch.known[:] = 0
    batch.flow[:] = torch.nan
    made = torch.rand(2, 4, 11, 14, requires_grad=True)
    loss, _ = Objective(None, 0.1, 0.1, 0.1)(made, torch.rand(1, 4, 11, 14), batch)
    loss.backward()
    assert float(loss.detach()) == 0 and made.grad is not None and not made.grad.any()


def test_dissimilarity_is_the_same_in_a_mixed_precision_step():
    from pointglass.model.evaluation.metrics.perceptual import Dissimilarity

    flat = torch.full((1, 3, 32, 32), 0.9)
    made = (flat + 0.002 * torch.randn(flat.shape, generator=torch.Generator().manual_seed(3))).to(torch.bfloat16)
    judge = Dissimilarity()
    plain = float(judge(made.float(), flat))
    with torch.autocast("cpu", torch.bfloat16):
        assert float(judge(made, flat)) == pytest.approx(plain, abs=1e-4)
    assert 0 <= plain < 1


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
