"""``bench flight`` in a real window: what it reports of each frame, and what its errors mean."""

import json

import numpy as np
import pytest
from x_server import run_with_display

pytestmark = pytest.mark.window
FRAMES = 14


def test_flight_reports_every_frame_and_no_error_where_nothing_was_left_out(tmp_path):
    out = tmp_path / "flight.json"
    scan = ("--procedural", "60k", "--rooms", "1")
    done = run_with_display("command.py", tmp_path, "bench", "flight", *scan, "--size", "300x200", "--frames", str(FRAMES),
                            "--quality", "fast", "--json", str(out), seconds=400)
    assert done.returncode == 0, done.stderr
    made = json.loads(out.read_text())
    assert list(made["views"]) == ["raw", "filled", "neural"] and made["size"] == [300, 200] and made["target_ms"] == 66.0
    for view, run in made["views"].items():
        assert len(run["ms"]) == len(run["drawn"]) == FRAMES
        assert run["fps"] == pytest.approx(1e3 / np.mean(run["ms"])) and run["p50"] == pytest.approx(np.median(run["ms"]))
        assert len(run["errors"]) == 12 and {frame["view"] for frame in run["drawn"]} <= {view, "filled"}
        for error in run["errors"]:
            frame = run["drawn"][error["frame"]]
            if view == "raw" and frame["resolution"] == 1.0 and frame["points_per_pixel"] is None:
                assert error["psnr"] is None and error["ssim"] == pytest.approx(1.0), "null is infinite: equal to the byte"
            else:
                assert error["psnr"] is None or error["psnr"] > 5.0
    assert "raw: pictures per second" in done.stdout and "neural: error of what is shown" in done.stdout


def test_without_a_display_it_says_so_in_one_line(capsys, monkeypatch):
    from pointglass.viewer.cli import main

    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert main(["bench", "flight", "--procedural", "20k", "--rooms", "1"]) == 3
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "display" in said.lower()
