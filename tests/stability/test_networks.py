"""The networks in every precision, at every scale and on masks that no scan has: numbers, in range, close to float64."""

import numpy as np
import pytest
import torch
from network_claims import PRECISION_LIMITS, masks, network_rows, scaled

from pointglass.model.network.reconstruct import PRECISIONS, Reconstructor
from pointglass.model.network.weights_folder import shipped

SIZE = (56, 40)
QUALITY = "fast" if "fast-filtered" in shipped() else "balanced"


@pytest.mark.parametrize("filtered", [True, False])
@pytest.mark.parametrize("precision", list(PRECISIONS))
def test_outputs_are_numbers_in_range_and_close_to_float64(seed, claims, precision, filtered):
    rows, table = network_rows(seed, SIZE, QUALITY, (1e-3, 1.0, 1e3, 1e6), (precision,), filtered=filtered)
    claims(rows)
    kinds = {entry["kind"] for entry in table}
    assert kinds >= {"empty", "full", "checkerboard", "one point", "random", "extremes", "scale 0.001", "scale 1e+06"}


def test_every_precision_has_limits_and_half_precision_is_really_used(seed):
    assert set(PRECISION_LIMITS) == set(PRECISIONS)
    _, table = network_rows(seed, SIZE, QUALITY, scales=(1.0,))
    for precision in ("bf16", "fp16"):
        mine, plain = ([entry["largest"] for entry in table if entry["precision"] == name] for name in (precision, "fp32"))
        assert max(mine) > 1.2 * max(plain), "no further from float64 than fp32 is"


@pytest.mark.parametrize("shift", [1e-3, -1e-3])
def test_the_claim_of_fp32_does_not_hold_for_a_network_that_is_a_little_off(seed, monkeypatch, shift):
    made = Reconstructor.made
    monkeypatch.setattr(Reconstructor, "made", lambda self, packed: (made(self, packed) + shift).clamp(0, 1))
    rows, _ = network_rows(seed, SIZE, QUALITY, scales=(1.0,), precisions=("fp32",))
    assert [row["ok"] for row in rows if "difference from float64" in row["name"]] == [False, False]


def test_odd_sizes_and_a_single_pixel_are_drawn(seed):
    for size in ((1, 1), (3, 5), (17, 2), (31, 23)):
        rows, _ = network_rows(seed, size, QUALITY, scales=(), precisions=("fp32", "bf16"))
        assert [row for row in rows if "NaN" in row["name"] and row["value"]] == []


def test_the_networks_input_does_not_depend_on_the_scale(seed):
    """What the network is given: the same to half precision but where a point lies on the border of two pixels."""
    given = scaled(seed, (96, 72), (1e-3, 1.0, 1e6, 2.0**11))
    plain = given[1.0].float()
    for made in given.values():
        assert made.isfinite().all() and made[..., 3].min() >= 0 and made[..., 4].abs().max() <= 2
        assert ((made.float() - plain).abs() > 2e-3).any(-1).float().mean() <= 5e-3
    assert torch.equal(given[2.0**11], given[1.0])


def test_the_masks_are_what_they_are_called(seed):
    made = {kind: packed[..., 3].float() for kind, packed in masks(seed, SIZE).items()}
    assert made["empty"].sum() == 0 and made["one point"].sum() == 1 and made["full"].min() == 1
    assert np.abs(np.diff(made["checkerboard"].numpy(), axis=0)).min() == 1
    assert len(made["partial confidence"].unique()) > 200 and 0.4 < made["partial confidence"].mean() < 0.6
