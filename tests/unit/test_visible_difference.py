"""model.train.visible_difference against the authors' FLIP, on even pictures, in which FLIP has no edges to compare."""

import numpy as np
import pytest
import torch

from model.train.visible_difference import VisibleDifference


def tensors(*pictures):
    return (torch.tensor(picture).permute(2, 0, 1)[None] for picture in pictures)


def test_even_pictures_differ_as_in_flip():
    flip = pytest.importorskip("flip_evaluator")
    rng, loss = np.random.default_rng(), VisibleDifference()
    for change in (0.01, 0.05, 0.2, 0.8):
        a = rng.uniform(0, 1, 3)
        b = np.clip(a + rng.choice([-1, 1], 3) * change * rng.uniform(0.5, 1, 3), 0, 1)
        a, b = (np.broadcast_to(colour, (48, 48, 3)).astype(np.float32) for colour in (a, b))
        expected = flip.evaluate(a, b, "LDR", applyMagma=False)[1]
        assert float(loss(*tensors(a, b))) == pytest.approx(expected, abs=0.012)  # of which 0.007 from _SMALLEST


def test_equal_pictures_have_no_difference_and_a_finite_slope():
    picture = torch.rand(1, 3, 40, 40, requires_grad=True)
    loss = VisibleDifference()(picture, picture.detach())
    loss.backward()
    assert loss.item() == pytest.approx(0, abs=1e-6)
    assert picture.grad is not None and torch.isfinite(picture.grad).all()


def test_a_checkerboard_too_fine_for_the_eye_counts_less_than_a_coarse_one():
    fine, coarse = np.indices((64, 64)).sum(0) % 2, np.indices((64, 64)).sum(0) // 8 % 2
    even = np.full((64, 64, 3), 0.5, np.float32)
    fine, coarse = (np.repeat((0.45 + 0.1 * board)[..., None], 3, 2).astype(np.float32) for board in (fine, coarse))
    loss = VisibleDifference()
    assert float(loss(*tensors(fine, even))) < 0.3 * float(loss(*tensors(coarse, even)))


def test_pixels_without_weight_count_nothing():
    rng = np.random.default_rng()
    a, b = rng.uniform(0, 1, (2, 64, 64, 3)).astype(np.float32)
    b[:, :32] = a[:, :32]
    weight = torch.zeros(1, 1, 64, 64)
    weight[..., :16] = 1  # farther from the difference than the widest blur reaches
    assert float(VisibleDifference()(*tensors(a, b), weight)) == pytest.approx(0, abs=1e-5)
