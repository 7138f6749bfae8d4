"""What the evaluation is given: pictures from outside, settings, options.  Bad input is named before the work."""

import argparse
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest
from PIL import Image

import pointglass.model.evaluation.room_scores as scene_module
from pointglass.model.common.errors import DataError
from pointglass.model.data.stations import load_scene
from pointglass.model.evaluation.command import add_arguments, names_of, run
from pointglass.model.evaluation.open3d_points import Open3DError
from pointglass.model.evaluation.outside import open_outside, parse_outside
from pointglass.model.evaluation.room_scores import evaluate

ROOT = Path(__file__).resolve().parents[3]

pytestmark = pytest.mark.usefixtures("one_thread")


def test_pictures_missing_or_of_another_size_are_refused_naming_ten(room, tmp_path, monkeypatch):
    scene = load_scene(room)
    shots = [scene.views[k % 4] for k in range(4)]
    wide = [SimpleNamespace(rgb_file=f"w{k:02}.jpg", width=48, height=36) for k in range(12)]
    with pytest.raises(DataError) as caught:
        open_outside({"x": tmp_path}, wide, [], [1.0])  # type: ignore[arg-type]
    said = str(caught.value)
    assert "12 pictures" in said and said.count("is missing") == 10 and "and 2 more" in said
    for shot in shots:
        Image.new("RGB", (48, 36)).save(tmp_path / f"{Path(shot.rgb_file).stem}.png")
    assert not open_outside({"x": tmp_path}, shots, scene.path, [1.0, 0.1])[0].path_frames
    (tmp_path / "D10").mkdir()
    with pytest.raises(DataError, match=r"4 pictures.*D10/v0\.png is missing"):
        open_outside({"x": tmp_path}, shots, [], [1.0, 0.1])
    (tmp_path / "D10").rmdir()
    Image.new("RGB", (40, 36)).save(tmp_path / "v1.png")
    (tmp_path / "v2.png").write_bytes((tmp_path / "v0.png").read_bytes()[:60])
    with pytest.raises(DataError, match=r"2 pictures.*v1\.png is 40x36, not 48x36; .*v2\.png cannot be read"):
        open_outside({"x": tmp_path}, shots, [], [1.0])
    with monkeypatch.context() as small, pytest.raises(DataError, match=r"4 pictures.*v0\.png cannot be read"):
        small.setattr(Image, "MAX_IMAGE_PIXELS", 10)  # a header may claim any size
        open_outside({"x": tmp_path}, shots, [], [1.0])
    for name in ("v1.png", "v2.png", "p0.png"):
        Image.new("RGB", (48, 36)).save(tmp_path / name)
    with pytest.raises(DataError, match=r"3 pictures.*p1\.png is missing"):  # some of the path, not all
        open_outside({"x": tmp_path}, shots, scene.path, [1.0])


def test_a_scene_without_a_return_is_refused(room, tmp_path):
    import shutil

    shutil.copytree(room, tmp_path / "empty")
    depths = {face.depth_file for faces in load_scene(room).stations for face in faces}
    for name in depths:
        with Image.open(room / name) as depth:
            Image.new(depth.mode, depth.size).save(tmp_path / "empty" / name)
    with pytest.raises(DataError, match=r"empty: the depth pictures of its stations have no return"):
        evaluate(tmp_path / "empty")


def test_a_density_has_a_folder_of_its_own_where_there_is_one(room, tmp_path):
    scene = load_scene(room)
    for name, value in (("D100", 250), ("D30", 30)):
        (tmp_path / name).mkdir()
        Image.new("RGB", (48, 36), (value,) * 3).save(tmp_path / name / "v0.png")
    (outside,) = open_outside({"x": tmp_path}, scene.views[:1], [], [1.0, 0.3])
    assert [round(255 * float(outside.picture(scene.views[0], d).mean())) for d in (1.0, 0.3)] == [250, 30]


@pytest.mark.parametrize("texts, said", [
    (["nerf"], "expected NAME=FOLDER"), (["=x"], "expected NAME=FOLDER"), (["a=x", "a=y"], "given twice"),
])
def test_outside_arguments_are_read_strictly(texts, said):
    with pytest.raises(DataError, match=said):
        parse_outside(texts)
    assert parse_outside(["a=x=y"]) == {"a": Path("x=y")}


@pytest.mark.parametrize("options, said", [
    ({"densities": (1.0, 1.5)}, "density 1.5"), ({"densities": (0.0,)}, "density 0"), ({"densities": ()}, "no density"),
    ({"views": 0}, "0 views"), ({"frames": 1}, "1 frames"), ({"exposures": ("bright",)}, "bright"),
    ({"outside": {"raw": Path(".")}}, "compared already"), ({"outside": {"x": Path("missing")}}, "no such folder"),
])
def test_bad_settings_are_refused_before_the_work(room, monkeypatch, options, said):
    monkeypatch.setattr(scene_module, "scan_stations", lambda *_: pytest.fail("work was begun"))
    with pytest.raises(DataError, match=said) as caught:
        evaluate(room, **options)
    assert "\n" not in str(caught.value)


def test_the_command_writes_what_was_asked_for(room, squeeze, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(scene_module, "Open3DPoints", lambda: (_ for _ in ()).throw(Open3DError("left out")))
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    files = [str(tmp_path / name) for name in ("r.json", "r.svg")]
    shipped = "fast-filtered"  # a name in place of a path
    assert run(parser.parse_args([str(room), "--weights", shipped, "--densities", "0.5", "--views", "1", "--json", files[0],
                                  "--plot", files[1], "--no-flicker", "--exposures", "matched"])) == 0
    out = capsys.readouterr()
    assert "network fast-filtered" in out.out and not out.err
    stored = json.loads(Path(files[0]).read_text())
    assert {r["exposure"] for r in stored["rows"]} == {"matched"} and not stored["flicker"]
    assert "<svg" in Path(files[1]).read_text()
    with pytest.raises(DataError, match=r"plot\.gif"):
        run(parser.parse_args([str(room), "--plot", str(tmp_path / "plot.gif")]))
    with pytest.raises(DataError, match="cannot be written"):
        run(parser.parse_args([str(room), "--json", str(tmp_path / "nowhere" / "r.json")]))


def test_weights_of_one_name_are_told_apart_by_folder():
    assert list(names_of([Path("a/w.st"), Path("b/w.st"), Path("b/v.st")])) == ["a/w", "b/w", "v"]
    with pytest.raises(DataError, match="same name"):
        names_of([Path("a/w.st"), Path("a/w.st")])


def test_the_options_load_nothing_heavy():
    code = ("import sys, argparse; from pointglass.model.evaluation.command import add_arguments;"
            "add_arguments(argparse.ArgumentParser());"
            "sys.exit(', '.join({'torch', 'numpy', 'open3d', 'scipy', 'matplotlib'} & set(sys.modules)) or 0)")
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, timeout=60).returncode == 0
