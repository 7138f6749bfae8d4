"""The rule that a neural picture is never worse than the filled one: counted by each judge, the worst view kept."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

import pointglass.model.evaluation.room_scores as scene_module
from pointglass.model.common.errors import DataError
from pointglass.model.data.stations import load_scene
from pointglass.model.evaluation.metrics.figures import Figures, Truth
from pointglass.model.evaluation.metrics.flip import flip_metric
from pointglass.model.evaluation.worse import Case, Worst, error_ratio, format_summary, ratio_of_room, summary
from pointglass.model.network.weights_folder import weights_dir
from pointglass.viewer.cli import main

pytestmark = pytest.mark.usefixtures("one_thread")


def of(psnr=30.0, ssim=0.9, distance=0.1, flip=0.1):
    return Figures(psnr, psnr, ssim, distance, flip, 0.0, psnr, 0.0, distance)


def case(view, neural, filled):
    return Case("room", view, "network n", 1.0, "matched", neural, filled)


def test_views_are_counted_by_each_judge_for_itself():
    cases = [case("a", of(psnr=29), of()), case("b", of(ssim=0.8, flip=0.2), of()), case("c", of(31, 0.95, 0.05, 0.05), of())]
    found = summary(cases)
    assert found["worse"] == {"psnr": 1, "ssim": 1, "distance": 0, "flip": 1} and found["views"] == 3
    assert format_summary(found) == "worse than filled: PSNR 1, SSIM 1, distance 0, FLIP 1 of 3" and found["worst_view"] == "b"
    assert summary([case("same", of(), of())])["worse"] == {"psnr": 0, "ssim": 0, "distance": 0, "flip": 0}
    blind = summary([case("a", of(distance=math.nan), of(distance=math.nan))])
    assert blind["worse"]["distance"] is None and "distance -" in format_summary(blind) and blind["ratio"] == pytest.approx(1)


def test_the_error_ratio_is_the_mean_of_what_every_judge_finds():
    assert error_ratio(of(), of()) == pytest.approx(1)
    assert error_ratio(of(psnr=30 - 20 * math.log10(2), ssim=0.8, distance=0.2, flip=0.2), of()) == pytest.approx(2)
    assert error_ratio(of(flip=0.2), of()) == pytest.approx(2**0.25)
    assert error_ratio(of(math.inf, 1.0, 0.0, 0.0), of(math.inf, 1.0, 0.0, 0.0)) == pytest.approx(1)


def test_the_worst_of_all_views_is_kept_as_pictures():
    worst = Worst()
    for view, flip, light in (("a", 0.1, 0.2), ("b", 0.3, 0.6), ("c", 0.2, 0.9)):
        worst.look(case(view, of(flip=flip), of()), *(torch.full((3, 20, 400), light) for _ in range(3)))
    assert worst.case is not None and worst.case.view == "b"
    sheet = worst.sheet()
    assert sheet.shape[1] > 1200 and (sheet == 153).sum() >= 3 * 3 * 20 * 400  # 0.6, three times


def test_flip_agrees_with_what_is_known_of_it():
    judge = flip_metric()
    if judge is None:
        pytest.skip("flip-evaluator is not installed")
    true = torch.rand(3, 40, 50, generator=torch.Generator().manual_seed(1))
    assert judge(true, true) == pytest.approx(0, abs=1e-6)
    near, far = (judge(true, (true + change).clamp(0, 1)) for change in (0.02, 0.3))
    assert 0 < near < far < 1
    black, white = torch.zeros(3, 40, 50), torch.ones(3, 40, 50)
    assert judge(black, white) > 0.9
    figures = Truth(true, None, judge).figures((true + 0.02).clamp(0, 1), torch.zeros(40, 50, dtype=torch.bool))
    assert figures.flip == pytest.approx(near)


def test_without_the_package_the_others_judge(monkeypatch, room):
    monkeypatch.setattr(scene_module, "flip_metric", lambda: None)
    result = scene_module.evaluate(room, densities=(1.0,), views=1, fast=True)
    assert "pip install 'pointglass[lab]'" in result["absent"]["FLIP"] and np.isnan(result["rows"][0]["flip"])


def test_a_network_is_counted_against_what_goes_into_it(room, monkeypatch):
    """One that returns its input is worse nowhere; one that darkens it is, everywhere."""
    from pointglass.model.evaluation.methods import OURS, Method

    def method(gain):
        return lambda name, _path: Method(f"network {name}", lambda view_points: view_points.input(OURS, weighted=True), OURS,
                                          lambda x: x[:3] * gain, 0.0, True)

    rows = {}
    for gain in (1.0, 0.5):
        monkeypatch.setattr(scene_module, "network_method", method(gain))
        worst = Worst()
        found = scene_module.evaluate(room, densities=(1.0,), weights={"n": Path(__file__)}, views=3, fast=True, worst=worst)
        rows[gain] = next(row for row in found["rows"] if row["method"] == "network n")["against_filled"]
        assert worst.case is not None and [p.shape for p in worst.pictures] == [(36, 48, 3)] * 3
    assert rows[1.0]["worse"]["psnr"] == rows[1.0]["worse"]["ssim"] == 0 and rows[1.0]["ratio"] == pytest.approx(1)
    assert rows[0.5]["worse"]["psnr"] == 3 and rows[0.5]["ratio"] > 1.2
    names = {Path(shot.rgb_file).stem for shot in load_scene(room).views}
    assert rows[0.5]["worst_view"] in names


def test_rooms_are_told_the_worst_first():
    bad, good, none = ({"rows": [{"psnr": 20.0, "against_filled": {"ratio": r} if r else None}]} for r in (1.2, 0.9, None))
    assert sorted([none, good, bad], key=ratio_of_room, reverse=True) == [bad, good, none]


def test_a_folder_of_rooms_and_the_worst_view_in_one_command(room, squeeze, tmp_path, capsys):
    files = [str(tmp_path / name) for name in ("r.json", "w.png")]
    (rooms := tmp_path / "rooms").mkdir()
    for name in "ba":
        (rooms / name).symlink_to(room)
    (rooms / "notes").mkdir()
    told = ["evaluate", str(rooms), "--fast", "--views", "2", "--densities", "1", "--exposures", "matched",
            "--weights", str(weights_dir() / "fast-filtered.safetensors"), "--perceptual", str(squeeze)]
    assert main([*told, "--json", files[0], "--worst", files[1]]) == 0
    out = capsys.readouterr().out
    assert out.count("worse than filled: PSNR") == 2 and out.count("box, 2 views") == 2 and "worst view: box, v" in out
    assert "net ms" not in out  # columns without a figure are left out
    stored = json.loads(Path(files[0]).read_text())
    assert len(stored["scenes"]) == 2 and {row["method"] for row in stored["scenes"][0]["rows"]} == {
        "pull-push, our filter, view-dependent blending", "network fast-filtered"}
    with Image.open(files[1]) as sheet:
        assert sheet.width > 3 * 48
    before = [Path(file).read_bytes() for file in files]
    assert main([*told, "--json", files[0], "--worst", files[1], "--workers", "2"]) == 0
    assert [Path(file).read_bytes() for file in files] == before, "by two processes: the same to the byte"
    with pytest.raises(DataError, match="--plot: for one folder, but 2 are given"):
        from pointglass.model.evaluation.command import run
        from pointglass.viewer.command_table import make_parser

        run(make_parser().parse_args([*told, "--plot", str(tmp_path / "p.png")]))
