"""The evaluation whole: a row a method, density and exposure, its files, and Open3D where it is."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

import pointglass.model.evaluation.methods as methods_module
import pointglass.model.evaluation.room_scores as scene_module
from pointglass.model.common.errors import DataError
from pointglass.model.common.files.json_file import write_json
from pointglass.model.data.stations import load_scene, scan_stations
from pointglass.model.data.surfaces.projected import Projected, project_scan
from pointglass.model.evaluation.methods import WEIGHTED, thinned, view_points
from pointglass.model.evaluation.open3d_points import Open3DError, Open3DPoints
from pointglass.model.evaluation.report import format_table, plot
from pointglass.model.evaluation.room_scores import evaluate
from pointglass.model.network.unet import PaperUNet, mac_per_pixel
from pointglass.model.network.weights import load_weights
from pointglass.model.network.weights_folder import weights_dir
from pointglass.model.reference.depth_filter import keep_mask

pytestmark = pytest.mark.usefixtures("one_thread")


@pytest.fixture(scope="module")
def result(room, squeeze, tmp_path_factory):
    """Everything but Open3D: both exposures, two densities, our network, the paper's (narrow), a method from outside."""
    outside = tmp_path_factory.mktemp("outside")
    scene = load_scene(room)
    for shot in (*scene.views, *scene.path):
        Image.fromarray(shot.rgb()).save(outside / f"{Path(shot.rgb_file).stem}.png")
    paper = tmp_path_factory.mktemp("weights") / "paper.safetensors"
    paper.write_bytes(b"replaced below")
    torch.manual_seed(1)
    narrow = PaperUNet(4).eval().requires_grad_(False), {"quality": "paper", "input": "filtered"}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(methods_module, "load_weights", lambda path: narrow if path.stem == "paper" else load_weights(path))
        return evaluate(
            room, densities=(1.0, 0.3), distance_path=squeeze, exposures=("scanned", "matched"), outside={"oracle": outside},
            weights={"fast": weights_dir() / "fast-filtered.safetensors", "paper": paper},
            open3d=False, views=2,
        )


@pytest.mark.slow
def test_there_is_a_row_a_method_density_and_exposure(result):
    ours = {"raw", "pull-push, no filter", "pull-push, paper's filter", "pull-push, our filter", "pull-push, true visibility",
            "pull-push, NPBG++'s visibility", WEIGHTED, "network fast", "network paper"}
    keys = {(r["method"], r["density"], r["exposure"]) for r in result["rows"]}
    assert keys == {(m, d, e) for m in ours for d in (1.0, 0.3) for e in ("scanned", "matched")} | {
        ("oracle", 1.0, "-"), ("oracle", 0.3, "-")}
    assert len(keys) == len(result["rows"])
    assert {(r["method"], r["density"]) for r in result["flicker"]} == {(m, d) for m in (*ours, "oracle") for d in (1.0, 0.3)}
    invented = {r["density"]: set() for r in result["rows"]}
    for row in result["rows"]:
        invented[row["density"]].add(row["invented"])
    assert all(len(values) == 1 for values in invented.values())  # the same pixels for all
    text = format_table(result)
    assert "SqueezeNet distance" in text and "matched: stations' gains" in text and "along 4 frames" in text


@pytest.mark.slow
def test_invented_pixels_are_those_outside_our_filter(room, result):
    scene = load_scene(room)
    scan = scan_stations(scene, 11)
    share = []
    for number, shot in enumerate((scene.views[0], scene.views[3])):
        left = thinned(project_scan(scan, shot, seed=11 + number), 0.3)
        spacing = scene_module.scan_spacing(scan) / 0.3**0.5
        seen = view_points(left, torch.from_numpy(shot.depth()), spacing)
        share.append(float((~keep_mask(seen.raster.depth)).double().mean()))
    row = next(r for r in result["rows"] if r["density"] == 0.3)
    assert row["invented"] == pytest.approx(np.mean(share)) and row["invented"] > 0.05


@pytest.mark.slow
def test_time_and_work_are_given_for_every_method(result):
    rows = {(r["method"], r["density"], r["exposure"]): r for r in result["rows"]}
    for (name, _, _), row in rows.items():
        assert (row["ms"] is None) == (name == "oracle") and (row["network_ms"] is not None) == name.startswith("network")
    assert rows["network paper", 1.0, "scanned"]["mac"] == pytest.approx(mac_per_pixel(PaperUNet(4)))
    assert rows["raw", 1.0, "scanned"]["mac"] == 0
    assert rows["network paper", 1.0, "scanned"]["network_ms"] < rows["network paper", 1.0, "scanned"]["ms"]


@pytest.mark.parametrize("placed", [True, False])
def test_every_methods_time_holds_one_rasteriser(room, monkeypatch, placed):
    scene = load_scene(room)
    scan = scan_stations(scene, 11)
    seen = project_scan(scan if placed else replace(scan, places=None), scene.views[0])
    view, rasters, raster = view_points(seen, torch.from_numpy(scene.views[0].depth()), 0.05), [], Projected.raster
    monkeypatch.setattr(Projected, "raster", lambda self, soft: (rasters.append(self), raster(self, soft))[1])

    def counted(work):
        before = len(rasters)
        work()
        return len(rasters) - before

    monkeypatch.setattr(methods_module, "_median_ms", counted)
    assert (seen.weight is not None) == placed
    assert {ms for ms, _ in methods_module.timings(methods_module.plain_methods(), view).values()} == {1}


@pytest.mark.slow
def test_pictures_left_by_others_are_judged_as_they_are(result):
    for row in (r for r in result["rows"] if r["method"] == "oracle"):
        assert row["psnr"] == row["invented_psnr"] == float("inf")
        assert row["ssim"] == pytest.approx(1) and row["distance"] == pytest.approx(0, abs=1e-6)
    oracle = [r for r in result["flicker"] if r["method"] == "oracle"]
    assert len(oracle) == 2 and all(r["flicker"] == r["gradient"] == pytest.approx(1) for r in oracle)


@pytest.mark.slow
def test_json_and_plot_are_whole_files(result, tmp_path):
    write_json(tmp_path / "a.json", result)
    stored = json.loads((tmp_path / "a.json").read_text(), parse_constant=lambda name: pytest.fail(name))
    assert next(r for r in stored["rows"] if r["method"] == "oracle")["psnr"] is None
    plot(result, tmp_path / "a.png")
    with Image.open(tmp_path / "a.png") as image:
        assert min(image.size) > 300
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.json", "a.png"]
    with pytest.raises(DataError, match=r"a\.gif: the name must end in \.png"):
        plot(result, tmp_path / "a.gif")


@pytest.mark.slow
def test_open3d_draws_points_where_they_belong_or_says_why_not():
    # the third lies behind the second
    xyz = np.array([[0.5, 0.5, 40], [20.5, 0.5, 40], [30.75, 0.75, 60], [0.5, -9.5, 40]], np.float32) / 20
    rgb = np.array([[250, 10, 20], [30, 240, 50], [9, 9, 9], [60, 70, 230]], np.uint8)
    try:
        renderer = Open3DPoints()
    except Open3DError as error:
        assert str(error)
        pytest.skip(f"Open3D cannot draw here: {error}")
    (small, large), spent = renderer.draw(xyz, rgb, (64, 48), 40.0)
    renderer.close()
    assert small.shape == (48, 64, 3) and len(spent) == 2 and min(spent) > 0
    for pixel, colour in (((24, 32), 0), ((24, 52), 1), ((14, 32), 3)):
        assert np.abs(small[pixel].astype(int) - rgb[colour]).max() <= 1
        assert np.abs(large[pixel[0] - 2, pixel[1] + 2].astype(int) - rgb[colour]).max() <= 1
    assert (small.sum(2) > 0).sum() == 3 and (large.sum(2) > 0).sum() == 75


def test_without_open3d_the_table_says_why(room, monkeypatch):
    def broken(*_):
        raise Open3DError("no Vulkan on this planet")

    monkeypatch.setattr(scene_module, "Open3DPoints", broken)
    result = evaluate(room, densities=(0.3,), views=1, flicker=False)
    assert not any(r["method"].startswith("Open3D") for r in result["rows"])
    assert "not in the table: Open3D: no Vulkan on this planet" in format_table(result)
