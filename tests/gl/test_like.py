"""``render --like SHOT.png`` draws a saved picture again, to the byte."""

import numpy as np
import pytest

from viewer import cli
from viewer.camera import from_fov, look_at
from viewer.tools.camera_files import write_camera_path


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
