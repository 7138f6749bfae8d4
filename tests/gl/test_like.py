"""``render --like SHOT.png`` draws a saved picture again, to the byte."""

from dataclasses import replace

import numpy as np
import pytest

from pointglass.viewer import cli
from pointglass.viewer.common.files import write_png
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.clip import Box
from pointglass.viewer.picture.composition import joined
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.look import Look
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.work.cameras.camera_files import write_camera_path
from pointglass.viewer.work.pictures.shot_metadata import KEY, describe_shot, read_shot


@pytest.mark.parametrize("view", ["raw", "filled"])
def test_a_picture_drawn_again_is_the_same_file(tmp_path, view, capsys):
    rng = np.random.default_rng(3)
    xyz = rng.uniform(0, 4, (40_000, 3)) * (1, 1, 0) + (0, 0, 1)
    np.savetxt(tmp_path / "floor.xyz", np.column_stack([xyz, rng.integers(40, 256, xyz.shape)]), "%.4f %.4f %.4f %d %d %d")
    write_camera_path(tmp_path / "cameras.json", [from_fov(96, 64, 70, look_at((1.0, 1.2, 2.1), (2.0, 2.5, 1.0)))])
    scan = str(tmp_path / "floor.xyz")
    cameras = ["--cameras", str(tmp_path / "cameras.json"), "--size", "80x50"]
    look = ["--view", view, "--background", "sky", "--lod", "2"]
    assert cli.main(["render", scan, *cameras, *look, "--out", str(tmp_path / "a"), "--no-cache"]) == 0
    (made,) = (tmp_path / "a").glob("*.png")
    assert cli.main(["render", scan, "--like", str(made), "--out", str(tmp_path / "b"), "--no-cache"]) == 0
    assert (tmp_path / "b" / made.name).read_bytes() == made.read_bytes()
    assert "may differ" not in capsys.readouterr().err


def scan_of(tmp_path, seed):
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(0, 4, (40_000, 3)) * (1, 1, 0) + (0, 0, 1)
    xyz[: len(xyz) // 3, 2] = rng.uniform(1, 2, len(xyz) // 3)
    np.savetxt(tmp_path / "floor.xyz", np.column_stack([xyz, rng.integers(40, 256, xyz.shape)]), "%.4f %.4f %.4f %d %d %d")
    return tmp_path / "floor.xyz"


EDITS = {
    "a clip": Edits(clips=(Box((2.0, 2.0, 1.0), (1.2, 1.5, 2.0)),)),
    "colours by height": Edits(look=Look(colour_by="height", ramp="turbo", point_size=3, edl=0.4)),
    "tones": Edits(look=Look(exposure=0.7, temperature=0.4)),
}


@pytest.mark.parametrize("what, other", [*((what, "") for what in EDITS), ("a clip", "raw")])
def test_a_picture_of_a_project_says_what_was_done_to_it_and_is_drawn_again(tmp_path, what, other, capsys):
    """As F12 saves it: alterations and comparisons are in the metadata, and `render --like` applies them."""
    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.render.described_picture import picture_of
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.renderer import Renderer

    scan = scan_of(tmp_path, 7)
    scene = open_scene([scan], cache=False)
    context = create_context()
    renderer = Renderer(context, scene)
    camera = from_fov(160, 100, 70, look_at((1.0, 1.2, 2.6), (2.0, 2.5, 1.0)), "shot")
    plain = PictureSpec(camera, Settings(view="filtered"), background="gradient")
    spec = replace(plain, edits=EDITS[what], views=("filtered", other) if other else ("filtered",), split_at=0.4)
    shot = describe_shot(scene, spec, exposures="matched")
    image = picture_of(renderer, spec)
    assert not np.array_equal(image, picture_of(renderer, plain))
    renderer.release()
    context.release()
    made = tmp_path / "shot.png"
    write_png(made, image, {KEY: shot.text()})
    assert read_shot(made).spec == replace(spec, split_at=spec.split_at if other else 0.5)
    assert cli.main(["render", str(scan), "--like", str(made), "--out", str(tmp_path / "b"), "--no-cache"]) == 0
    assert (tmp_path / "b" / "shot.png").read_bytes() == made.read_bytes()
    assert "may differ" not in capsys.readouterr().err
    assert cli.main(["render", str(scan), "--like", str(made), "--out", str(tmp_path / "c"), "--no-cache", "--aux"]) == 2
    assert "--aux" in capsys.readouterr().err and not (tmp_path / "c").exists()


def test_a_picture_of_moved_scans_is_drawn_again_where_they_were(tmp_path, capsys):
    from pointglass.viewer.common.rigid_transform import rigid, rotation_about
    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.render.described_picture import picture_of
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.renderer import Renderer

    scan = scan_of(tmp_path, 8)
    moved = rigid(rotation_about(np.array([0.1, 0.2, 1.0]), 10.0), np.array([0.3, -0.2, 0.1]))
    scene = open_scene([scan], cache=False, moves={str(scan.resolve()): moved})
    context = create_context()
    renderer = Renderer(context, scene)
    camera = from_fov(160, 100, 70, look_at((1.0, 1.2, 2.6), (2.0, 2.5, 1.0)), "shot")
    spec = PictureSpec(camera, Settings(view="filtered"), background="gradient")
    image = picture_of(renderer, spec)
    write_png(tmp_path / "shot.png", image, {KEY: describe_shot(scene, spec, exposures="matched").text()})
    renderer.release()
    context.release()
    again = ["render", str(scan), "--like", str(tmp_path / "shot.png"), "--out", str(tmp_path / "b"), "--no-cache"]
    assert cli.main(again) == 0
    assert (tmp_path / "b" / "shot.png").read_bytes() == (tmp_path / "shot.png").read_bytes()
    assert "may differ" not in capsys.readouterr().err


def test_a_comparison_carries_the_names_of_its_sides():
    left, right = (np.full((240, 400, 4), level, np.uint8) for level in (100, 200))
    for side in (left, right):
        side[..., 3] = 255
    picture = joined([left, right], "black", ("raw", "neural"), 0.5)
    assert (picture[100:, :200] == 100).all() and (picture[100:, 200:] == 200).all()
    for half, level in ((picture[:, :200], 100), (picture[:, 200:], 200)):
        assert (half < level // 2).any() and (half > 210).any()  # a dark plate, bright letters
    assert not np.array_equal(picture, joined([left, right], "black", ("raw", "filled"), 0.5))


def test_a_neural_picture_drawn_again_is_the_same_file(tmp_path, capsys):
    pytest.importorskip("torch")
    scan = scan_of(tmp_path, 9)
    write_camera_path(tmp_path / "cameras.json", [from_fov(64, 48, 70, look_at((1.0, 1.2, 2.6), (2.0, 2.5, 1.0)))])
    assert cli.main(["render", str(scan), "--cameras", str(tmp_path / "cameras.json"), "--size", "64x48", "--quality", "fast",
                     "--device", "cpu", "--out", str(tmp_path / "a"), "--no-cache"]) == 0
    (made,) = (tmp_path / "a").glob("*.png")
    assert read_shot(made).weights
    assert cli.main(["render", str(scan), "--like", str(made), "--out", str(tmp_path / "b"), "--no-cache"]) == 0
    assert (tmp_path / "b" / made.name).read_bytes() == made.read_bytes()
    assert "may differ" not in capsys.readouterr().err
