"""The tables of choices hold together: rows refer to rows that exist, and every number that shaders know is used."""

from dataclasses import replace
from typing import get_args

from pointglass.model.network.qualities import DEFAULT, QUALITIES, stand_ins, trainable
from pointglass.model.network.unet import make_network
from pointglass.model.network.weights_folder import shipped_qualities, weights_name
from pointglass.viewer.common.paths import shaders_dir
from pointglass.viewer.picture.colour_modes import COLOUR_BY, Need, PointValue
from pointglass.viewer.picture.look import TONES, Look
from pointglass.viewer.picture.settings import CHOICES, Settings
from pointglass.viewer.picture.views import POINT_VIEWS, VIEWS, PassName, ViewName, passes_of


def test_qualities_refer_to_smaller_and_to_trainable_ones():
    assert Settings().quality == DEFAULT and list(CHOICES["quality"]) == list(QUALITIES)
    for name, row in QUALITIES.items():
        assert row.mirrors is None or (row.mirrors in trainable() and row.size is None)
        assert all(QUALITIES[smaller].relative_time < row.relative_time for smaller in stand_ins(name))
        assert weights_name(name, filtered=True) == f"{row.mirrors or name}-filtered"
    assert stand_ins("best") == ("balanced", "fast") and stand_ins("fast") == ()
    assert DEFAULT in shipped_qualities(trainable=True)
    best, balanced = (sum(p.numel() for p in make_network(name).parameters()) for name in ("best", "balanced"))
    assert best == balanced


def test_views_name_passes_in_their_order():
    assert get_args(ViewName) == tuple(VIEWS) == tuple(CHOICES["view"])
    order = get_args(PassName)
    assert all(row.passes == order[: len(row.passes)] for row in VIEWS.values())
    assert passes_of(("raw",)) == set() and passes_of(("raw", "filled")) == {"filter", "fill"}
    assert POINT_VIEWS == ("raw", "filtered")
    assert len({row.short for row in VIEWS.values()}) == len({row.title for row in VIEWS.values()}) == len(VIEWS)


def test_colour_modes_show_every_value_that_shaders_know():
    text = (shaders_dir() / "common_edits.glsl").read_text("ascii")
    assert [value for value in PointValue if f"BY_{value.name}" not in text] == []
    assert [int(value) for value in PointValue] == list(range(len(PointValue))), "compiled loops on disk hold these numbers"
    assert {row.value for row in COLOUR_BY.values()} == set(PointValue)
    assert {row.needs for row in COLOUR_BY.values()} == {None, *Need}
    assert all((row.legend == "none") == (row.value is PointValue.COLOUR) for row in COLOUR_BY.values())
    assert not Look().recolours and Look("height").recolours


def test_each_tone_alone_develops_a_picture():
    assert list(TONES) == ["exposure", "brightness", "temperature", "tint"]
    assert all(replace(Look(), **{name: row.most}).develops for name, row in TONES.items()) and not Look().develops
