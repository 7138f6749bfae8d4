"""The ablation's variants are what their names say, and its table is written after every row."""

import json

import pytest
import torch
from rooms import make_room

from model.ablation import VARIANTS, run
from model.data.pairs import build
from model.data.stations import load_scene
from model.unet import mac_per_pixel


@pytest.mark.parametrize("name", VARIANTS)
def test_every_variant_begins_at_the_filled_picture(name):
    x = torch.rand(1, 5, 37, 50)
    made = VARIANTS[name]()(x)
    assert made.shape == (1, 4, 37, 50)
    assert torch.allclose(made[:, :3], x[:, :3], atol=1e-6) and torch.equal(made[:, 3:], torch.ones(1, 1, 37, 50))


def test_variants_that_claim_the_same_size_have_it():
    same = ("as shipped (fast size)", "no blends: plain residual", "no depth", "depth linear")
    assert len({mac_per_pixel(VARIANTS[name](), 64) for name in same}) == 1
    assert mac_per_pixel(VARIANTS["gated convolutions"](), 64) > 1.5 * mac_per_pixel(VARIANTS[same[0]](), 64)


def test_a_row_a_variant_is_written(tmp_path):
    build([load_scene(make_room(tmp_path / "box"))], tmp_path / "pairs", scans=1, variants=1, neighbours=True)
    rows = run([tmp_path / "pairs"], tmp_path / "pairs", tmp_path / "a.json", steps=2, batch=2, crop=32, count=2,
               perceptual=None, only=["as shipped (fast size)", "no depth"])
    written = json.loads((tmp_path / "a.json").read_text())
    assert [row["variant"] for row in written["rows"]] == [row.variant for row in rows]
    assert len(rows) == 3 and rows[0].mac == 0 and all(row.psnr > 5 and row.energy > 0 for row in rows)
