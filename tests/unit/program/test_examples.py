"""The scripts in assets/examples: each says what it shows, and runs as a user runs it, with the results that it names."""

import ast
import runpy
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

FOLDER = Path(__file__).resolve().parents[3] / "assets" / "examples"
SCRIPTS = sorted(FOLDER.glob("*.py"))
RESULTS = {
    "compare_views": {"raw_filtered_filled.png"},
    "dask_on_one_machine": {"transforms.json", *(f"view_{n}.png" for n in range(4))},
    "draw_section": {"plan.pdf", "section.png"},
    "e57_photographs": {"made.e57", "0_photograph.png", "0_scan.png"},
    "exchange_cameras": {"colmap", "transforms.json", "view_0.png", "view_1.png", "view_2.png"},
    "export_selection": {"corner.laz", "station.laz"},
    "film_along_keyframes": {"camera_path.json", "walk.mp4"},
    "film_in_flight": {"flight.mp4"},
    "measure_room": {"room.csv", "room.dxf", "room.geojson"},
    "points_from_numpy": {"sphere.png"},
    "read_points": {"points.npz", "heights.png"},
    "render_picture": {"raw.png", "filtered.png", "filled.png", "neural.png"},
    "splats_and_notebook": {"demo.glb", "corner.splats.ply"},
}
"""Script -> what it leaves in its folder."""
SAID = {
    "compare_views": "13.0% filled", "dask_on_one_machine": "Dask: 2 tasks at a time on 1 host",
    "draw_section": "2 sheets", "e57_photographs": "living room: pinhole",
    "exchange_cameras": "3 cameras; poses differ by at most", "export_selection": "points in a quarter",
    "film_along_keyframes": "walk.mp4", "film_in_flight": "with the neural picture moved: 3",
    "measure_room": "height  2.70", "points_from_numpy": "150,000 points, 2 stations",
    "read_points": "13,500 points read",
    "render_picture": "4 pictures", "splats_and_notebook": "splats of a corner",
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.gl
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_an_example_does_what_it_says(script, tmp_path, monkeypatch, capsys):
    if script.stem == "dask_on_one_machine":
        pytest.importorskip("distributed")
    monkeypatch.setattr(sys, "argv", [str(script), str(tmp_path / "out")])
    runpy.run_path(str(script), run_name="__main__")
    assert {path.name for path in (tmp_path / "out").iterdir()} == RESULTS[script.stem]
    said = capsys.readouterr().out
    assert SAID[script.stem] in said
    if script.stem == "e57_photographs":
        difference = float(said.partition("difference from the scan ")[2].split()[0])
        assert difference < 20, "the pose is read as it was written"
    for picture in (tmp_path / "out").glob("*.png"):
        with Image.open(picture) as image:
            assert np.asarray(image.convert("RGB")).std() > 10, picture.name


@pytest.mark.slow
@pytest.mark.gl
def test_an_example_is_run_as_a_process(tmp_path):
    """The shortest: the others differ in what they import of the product."""
    command = [sys.executable, FOLDER / "points_from_numpy.py", tmp_path]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert SAID["points_from_numpy"] in done.stdout and {path.name for path in tmp_path.iterdir()} == {"sphere.png"}


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda script: script.stem)
def test_an_example_opens_with_what_it_shows_and_how_it_is_run(script):
    text = ast.get_docstring(ast.parse(script.read_text("utf-8")))
    assert text is not None and f"python assets/examples/{script.name} out/" in text
    assert text.splitlines()[0].endswith(".") and len(script.read_text("utf-8").splitlines()) < 130


@pytest.mark.slow
@pytest.mark.gl
def test_the_tasks_of_a_slurm_array_make_all_pictures(tmp_path):
    """One process for each task, with the variables that Slurm sets; then all again without it, which keeps every picture."""
    import os

    import pointglass

    cameras = [pointglass.look_at((4.8 - 0.3 * n, 3.2, 1.55), (3.0, 2.0, 1.2), fov=60, size=(80, 60), name=f"view_{n}")
               for n in range(3)]  # fmt: skip
    pointglass.write_cameras(tmp_path / "transforms.json", cameras)
    out = tmp_path / "out"
    line = ["bash", FOLDER / "many_machines" / "slurm_array.sh", pointglass.demo_scan(), tmp_path / "transforms.json", out]
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    own = os.environ | {"PATH": path, "OPTIONS": "--view raw"}
    for task, count in (0, 2), (1, 1):
        slurm = {"SLURM_ARRAY_TASK_ID": str(task), "SLURM_ARRAY_TASK_COUNT": "2"}
        done = subprocess.run(line, env=own | slurm, capture_output=True, text=True, timeout=300)
        assert done.returncode == 0 and f"{count} picture" in done.stdout, done.stderr
    again = subprocess.run(line, env=own, capture_output=True, text=True, timeout=300)
    assert "(2 pictures already there)" in again.stdout and "(1 picture already there)" in again.stdout
    assert {path.name for path in out.iterdir()} == {"view_0.png", "view_1.png", "view_2.png"}
