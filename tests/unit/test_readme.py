"""The README's figures come from bench files, and from nothing else."""

import inspect
import json
import re
from pathlib import Path

import numpy as np
import pytest
from rooms import make_room

from model.data.stations import load_scene, scan_stations
from viewer.bench import readme
from viewer.bench.figures import FIGURES, command
from viewer.bench.figures import main as run_figures
from viewer.bench.readme import BLOCKS, filled, main
from viewer.grid.open_scene import open_scene
from viewer.paths import assets_dir
from viewer.window.controls import table_markdown

MACHINE = {"cores": 2, "processor": "X", "gpu": None, "versions": {"torch": "9"}}
BENCH = {
    "machine": MACHINE, "opengl": "llvmpipe (LLVM)", "scans": ["../x/plant_room.laz"], "points": 11_605_395,
    "network": "balanced-filtered 7e69 bf16 on cpu",
    "approximations": ["level of detail: 4 points per pixel", "network in bf16"],
    "runs": [{"size": [960, 720], "frames": 48,
              "views": {v: {"total": {"p50": 1.4, "p95": 2.6}} for v in ("raw", "filtered", "filled", "neural")}}],
}
SCALE = {
    "machine": MACHINE, "size": [960, 720], "lod": 2.0,
    "growth": {"rooms": {"from": 1e7, "to": 1e8, "raw": 1.25, "filled": 1.5, "neural": 1.1}},
    "rows": [
        {"series": "rooms", "points": 10**7, "rooms": 10, "fits": True, "open_to_first_picture_s": 0.5, "packed_bytes": 12e7,
         "resident_bytes": 90e7, "resident_before_bytes": 56e7,
         "milliseconds": {"raw": {"p50": 31.0}, "filled": {"p50": 42.0}, "neural": {"p50": 250.0}}},
        {"series": "rooms", "points": 10**9, "rooms": 1000, "fits": False, "why": "does not fit: needs 13 GB"},
    ],
}
VERSUS = {
    "machine": MACHINE, "scans": ["/a/plant.laz"], "points": 11_600_000, "device": "cpu", "said": "few frames",
    "runs": [{
        "size": [960, 720], "precision": "bf16",
        "contenders": {
            "ours, balanced": {"network": "n", "milliseconds": {"total": {"p50": 200.0}}},
            "paper, as published": {"network": None, "milliseconds": {"total": {"p50": 700.0}}},
        },
        "fairness": {"share_of_matmul": 0.45, "matmul_rate": 2e11, "fair": True, "needed": 0.4},
    }],
}
ERRORS = {
    "machine": MACHINE, "scans": ["/a/plant.laz"], "size": [960, 720],
    "rows": [
        {"group": "filter", "name": "4 levels", "view": "filled",
         "milliseconds": 9.0, "time": 0.5, "psnr": None, "largest": 0.0, "mask": None},
        {"group": "filter", "name": "off", "view": "filled",
         "milliseconds": 8.0, "time": 0.6, "psnr": 31.26, "largest": 9.0, "mask": 0.5},
    ],
}


def test_a_block_is_replaced_and_the_rest_kept():
    text = "before\n<!-- frames -->\nold\n<!-- /frames -->\nafter <!-- truth -->\nkept\n<!-- /truth -->\n"
    made = filled(text, {"frame-plant_room": BENCH})
    assert "old" not in made and "1 / 3" in made and "48 frames" in made and "kept" in made
    assert made.startswith("before\n<!-- frames -->\n") and made.endswith("<!-- /truth -->\n")
    assert filled(made, {"frame-plant_room": BENCH}) == made
    assert filled(text, {}) == text


def block(name: str, files: dict) -> str:
    return filled(f"<!-- {name} -->\n<!-- /{name} -->", files)


def test_what_is_said_of_a_bench_is_what_its_file_says():
    """Also where the file is of a version that recorded less."""
    made = block("frames", {"frame-plant_room": BENCH})
    assert "2 cores of an X, software OpenGL (llvmpipe (LLVM))" in made
    assert "| plant room, 11.6 M points, 960x720, balanced, level of detail 4 points per pixel | 1 / 3" in made
    steps = "from the files", "cache to first picture", "cache to every point in view", "cache to full quality"
    times = dict.fromkeys(steps, 1e3)
    opened = {"scans": ["a/big_hall.e57"], "milliseconds": times}
    assert "- Opening the big hall: 1.0 s" in block("frames", {"frame-plant_room": BENCH, "open-plant_room": opened})
    newer = {**BENCH, "software": False, "opengl": "H200", "quality": "fast", "approximations": []}
    opened["file_bytes"] = 79_400_000
    made = block("frames", {"frame-plant_room": newer, "open-plant_room": opened})
    assert "X, OpenGL (H200)" in made and "points, 960x720, fast | 1 / 3" in made and "big hall (79 MB E57): 1.0 s" in made


def test_every_size_of_the_demo_has_its_line():
    sizes = {**BENCH, "points": 1_350_000, "runs": [{**BENCH["runs"][0], "size": s} for s in ([960, 720], [3840, 2160])]}
    made = block("frames", {"frame-plant_room": BENCH, "frame-demo-sizes": sizes})
    assert "1.35 M points, 960x720" in made and "3840x2160" in made


def test_scale_says_what_did_not_fit():
    made = block("scale", {"scale": SCALE})
    assert "| by rooms | 10 M | 10 | 31 | 42 | 250 | 0.50 | 120 | 340 |" in made
    assert "does not fit: needs 13 GB" in made and "raw 1.25x, filled 1.50x, neural 1.10x" in made


def test_versus_gives_times_and_whether_the_opponent_is_fair():
    made = block("versus", {"versus-plant_room": VERSUS})
    assert "plant.laz" in made and "| paper, as published | none | 700 | 3.50 |" in made and "45% of the measured" in made
    assert "a fair opponent" in made
    unfair = json.loads(json.dumps(VERSUS))
    unfair["runs"][0]["fairness"] |= {"fair": False, "share_of_matmul": 0.1}
    assert "below the share" in block("versus", {"versus-plant_room": unfair})


def test_errors_mark_the_front_and_equal_pictures():
    made = block("errors", {"error-demo": ERRORS})
    assert "| **filter: 4 levels** | 9 | 0.50 | equal | 0 |  |" in made
    assert "by more than noise" in made
    assert "| filter: off | 8 | 0.60 | 31.3 | 9 | 50.000% |" in made


def test_documents_are_renewed_and_missing_benches_named(tmp_path, capsys):
    document = tmp_path / "README.md"
    document.write_text("<!-- frames -->\n<!-- /frames -->\n")
    (tmp_path / "frame-plant_room.json").write_text(json.dumps(BENCH))
    assert main(tmp_path, [document]) == 0
    assert "pixel | 1 / 3" in document.read_text()
    said = capsys.readouterr().out
    assert "not there: error-demo, scale, stability" in said


def test_figures_run_every_bench_the_readme_needs():
    assert set[str]().union(*(needed for _, needed in BLOCKS.values())) <= FIGURES.keys()
    from viewer.bench import KINDS

    assert {arguments[0] for arguments in FIGURES.values()} == set(KINDS)
    source = inspect.getsource(readme)
    assert [name for name in FIGURES if f'"{name}"' not in source] == [], "nothing reads them"


def test_a_scan_that_is_not_there_is_named_and_its_bench_left_out(tmp_path, capsys):
    given, missing = command(("open", "plant_room.laz", "--size", "64x48"), tmp_path, tmp_path)
    assert given == ["open", str(tmp_path / "plant_room.laz"), "--size", "64x48"] and missing == [tmp_path / "plant_room.laz"]
    assert command(("error", "cellar.ply"), tmp_path, tmp_path, tmp_path / "rooms")[1] == [tmp_path / "rooms" / "cellar"]
    assert run_figures(["open-plant_room"], tmp_path / "out", tmp_path) == 0
    assert "plant_room.laz is not there" in capsys.readouterr().out
    assert not list((tmp_path / "out").iterdir())
    assert run_figures(["nothing"], Path(tmp_path)) == 2 and "expected one of" in capsys.readouterr().err


def test_a_room_is_written_as_one_plain_file_that_keeps_its_stations_in_turn(tmp_path):
    make_room(tmp_path / "rooms" / "box")
    made = tmp_path / "box.ply"
    assert command(("error", "box.ply"), tmp_path, tmp_path, tmp_path / "rooms") == (["error", str(made)], [])
    scan, scene = scan_stations(load_scene(tmp_path / "rooms" / "box"), 11), open_scene(made, cache=False)
    assert scene.count == len(scan.xyz) and [path.name for path in tmp_path.glob("*.ply*")] == ["box.ply"]
    assert np.allclose(scene.bounds, [scan.xyz.min(0), scan.xyz.max(0)])
    before = made.stat().st_mtime_ns
    assert command(("error", "box.ply"), tmp_path, tmp_path, tmp_path / "rooms")[1] == [] and made.stat().st_mtime_ns == before


def test_stability_names_what_is_nearest_to_its_limit():
    rows = [
        {"group": "scale", "name": "depth", "value": 0.001, "limit": 0.005, "ok": True},
        {"group": "scale", "name": "mask", "value": 0.004, "limit": 0.005, "ok": True},
        {"group": "same", "name": "twice", "value": 0.0, "limit": 0.0, "ok": True},
        {"group": "bad", "name": "sums", "value": 72.0, "limit": 0.0, "ok": False},
        {"group": "bad", "name": "huge", "value": 0.0, "limit": 0.0, "ok": True, "skipped": "no room"},
        {"group": "scanners", "name": "near", "value": 46.5, "limit": 40.0, "least": True, "ok": True},
        {"group": "scanners", "name": "far", "value": 52.0, "limit": 40.0, "least": True, "ok": True},
        {"group": "scanners", "name": "shifted", "value": 0.0, "limit": 0.0, "ok": True},
    ]
    made = block("stability", {"stability": {"seed": 3, "rows": rows, "machine": MACHINE, "opengl": "llvmpipe"}})
    assert "6 of 7 claims hold" in made and "| scale | 2 | mask: 0.004, limit 0.005 |" in made
    assert "| same | 1 | all exact |" in made and "| bad | 1 | sums |" in made
    assert "| scanners | 3 | near: 46.5, at least 40 |" in made


def test_what_is_skipped_is_told_with_its_saving():
    files = {
        "frame-plant_room": BENCH,
        "raster": {"points": 2_000_000, "milliseconds": {"compute": 81.4, "points": 500.0}, "ratio": 6.14},
        "void": {"scans": ["/a/street.laz"], "rows": [
            {"group": "exact", "name": "x"},
            {"group": "void", "name": "y", "time": 1.43, "by_view": {"near": 1.1, "far": 1.8}}]},
        "cull": {"cells": 10**6, "rooms": 9261, "detail": {
            "every point": {"visible": 219_391.0, "cells_ms": 1.91, "list_ms": 3.02},
            "1 point a pixel": {"visible": 219_391.0, "cells_ms": 2.64, "list_ms": 2.76}}},
        "stations": {"scans": ["/a/hall.ply"], "points": 3_000_000, "rows": [
            {"group": "exact", "name": "x"},
            {"group": "stations", "name": "y", "time": 0.82, "psnr": 27.25}]},
        "occlusion": {"machine": MACHINE, "rooms": 20,
                      "points": 10**8, "points_drawn_share": 0.3, "all_time_share": 0.44, "wrong_worst": 0.00051,
                      "wrong_after_jump": 0.0001},
    }
    made = block("frames", files)
    for figure in ("81 ms", "6.1 times", "1.43 times", "*far* 1.8", "20 rooms of 100 M", "30% of the points", "44% of the time",
                   "0.051%", "hall (3.0 M points", "0.82 of the time", "27.2 dB", "1.0 M cells in 9,261 rooms",
                   "219 k in view are found in 1.9 ms", "listed in 3.0 ms (2.6 and 2.8 ms"):
        assert figure in made, figure


@pytest.mark.gl
def test_the_picture_shows_four_views_and_is_where_the_readme_looks(tmp_path):
    from PIL import Image

    from viewer.bench.readme_picture import PICTURE, SIZE, main
    from viewer.settings import Settings

    assert f"](assets/{PICTURE.as_posix()})" in (assets_dir().parent / "README.md").read_text("utf-8")
    with Image.open(main(tmp_path / "four.jpg", Settings(quality="fast"))) as picture:
        shown = np.asarray(picture, int)
    width, height = SIZE
    corners = [(4 + (height + 4) * row, 4 + (width + 4) * column) for row in (0, 1) for column in (0, 1)]
    views = [shown[y : y + height, x : x + width] for y, x in corners]
    dark = [float((view.max(axis=-1) < 40).mean()) for view in views]
    assert dark[1] > dark[0] > 0.2 and max(dark[2:]) < 0.05, "points on black, hidden ones gone, filled, repainted"
    with Image.open(assets_dir() / PICTURE) as kept:
        assert np.abs(np.asarray(kept, int)[:height] - shown[:height]).mean() < 4, "as it is drawn today"


def test_the_readme_is_short_and_has_the_controls_that_there_are():
    text = (assets_dir().parent / "README.md").read_text("utf-8")
    assert len(text.encode()) <= 12_000
    assert table_markdown() in text
    for page in re.findall(r"\]\(((?:viewer|model|assets)[^)]*)\)", text):
        assert (assets_dir().parent / page).exists(), page
