"""Recipes: one is run to its end on a tiny room and continued; the command line of ``train``."""

import json
import shutil

import pytest
from rooms import make_room

from pointglass.model.network.weights import load_weights
from pointglass.model.train.recipes import RECIPES, Recipe, Stage, _Job, _make, follow
from pointglass.viewer.cli import main

TINY = Recipe(0.05, 0.1, (
    Stage("fast", True, 0.5, batch=2, crop=32),
    Stage("fast", False, 0.3, after="fast-filtered", batch=2, crop=32),
))


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    return make_room(tmp_path_factory.mktemp("data") / "box", view=(72, 96))


def test_the_shares_of_every_recipe_add_up_and_its_stages_exist():
    for recipe in RECIPES.values():
        assert recipe.data_share + sum(stage.share for stage in recipe.stages) == pytest.approx(1.0)
        made = set()
        for stage in recipe.stages:
            assert stage.after is None or stage.after in made
            made.add(f"{stage.quality}-{'filtered' if stage.filtered else 'unfiltered'}")
        assert {f"{q}-{i}" for q in ("fast", "balanced") for i in ("filtered", "unfiltered")} <= made


@pytest.mark.slow
def test_a_finished_recipe_trains_no_further_when_repeated(room, tmp_path):
    made = follow(TINY, [room], tmp_path, minutes=0.04, perceptual=None, device="cpu", most_places=0)
    headers = [load_weights(path)[1] for path in made]
    assert [h["input"] for h in headers] == ["filtered", "unfiltered"]
    pairs = sorted(tmp_path.glob("pairs/*/*"))
    pieces = ["box cut out" in (folder / "pairs.json").read_text() for folder in pairs]
    assert len(pairs) == 3 and pieces == [not folder.name.endswith("-2") for folder in pairs]
    assert (tmp_path / "pairs" / "filtered" / "folder-box-2" / "neighbours.npy").is_file()
    before = [p.stat().st_mtime_ns for p in pairs]
    steps = json.loads(headers[0]["notes"])["step"]
    follow(TINY, [room], tmp_path, minutes=0.04, perceptual=None, device="cpu", most_places=0)
    assert [p.stat().st_mtime_ns for p in pairs] == before
    assert json.loads(load_weights(made[0])[1]["notes"])["step"] == steps  # its time is used up


def test_every_place_of_a_recipe_is_degraded_differently(room, tmp_path):
    """A common seed would give all places the same densities, patches and missing stations."""
    other = shutil.copytree(room, tmp_path / "data" / "another")
    for job in (_Job("folder-box", str(room)), _Job("folder-another", str(other))):
        _make(job, str(tmp_path), ("unfiltered",), 1, None)
    stored = [json.loads((tmp_path / "pairs" / "unfiltered" / f"folder-{name}-1" / "pairs.json").read_text())["pairs"]
            for name in ("box", "another")]  # fmt: skip
    densities = [{pair["density"] for pair in pairs} - {1.0, 0.1} for pairs in stored]
    assert min(map(len, densities)) > 3 and not densities[0] & densities[1]


@pytest.mark.slow
def test_train_from_the_command_line_resumes_and_prints_the_path_of_the_weights(room, tmp_path, capsys):
    line = ["train", str(room), "--out", str(tmp_path / "run"), "--quality", "fast", "--batch", "2", "--crop", "32",
            "--device", "cpu", "--minutes", "10"]
    assert main([*line, "--steps", "2"]) == 0
    assert "fast-filtered.safetensors" in capsys.readouterr().out
    assert main([*line, "--steps", "3"]) == 0
    pieces = ["box cut out" in (tmp_path / "run" / f"pairs-filtered-0-{n}" / "pairs.json").read_text() for n in (1, 2)]
    assert pieces == [True, False]
    notes = json.loads(load_weights(tmp_path / "run" / "fast-filtered.safetensors")[1]["notes"])
    assert notes["step"] == 3 and notes["steps"] == 3


@pytest.mark.parametrize("line, message", [
    ([], "--out DIR is missing"), (["--out", "OUT"], "no training data"), (["NOWHERE", "--out", "OUT"], "no such folder"),
    (["EMPTY", "--out", "OUT"], "neither scene.json"), (["--tune", "NOWHERE"], "no such file"),
])
def test_bad_training_input_gives_one_line_and_leaves_no_files(tmp_path, capsys, line, message):
    (tmp_path / "EMPTY").mkdir()
    names = {name: str(tmp_path / name) for name in ("OUT", "NOWHERE", "EMPTY")}
    assert main(["train", *(str(names.get(word, word)) for word in line)]) == 2
    error = capsys.readouterr().err
    assert message in error and error.count("\n") == 1
    assert not (tmp_path / "OUT").exists()
