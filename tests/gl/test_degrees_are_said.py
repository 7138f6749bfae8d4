"""``render`` of a scan in degrees says so in one line, with the command that reprojects it."""

import sys
from pathlib import Path

import numpy as np
import pytest

import pointglass
from pointglass.viewer.cli import main

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "unit"))
from cloud_files import write_ply

pytestmark = pytest.mark.gl


def rendered(tmp_path, xyz, capfd) -> list[str]:
    """The lines that ``render`` writes on stderr."""
    write_ply(tmp_path / "a.ply", xyz, np.full((len(xyz), 3), 90))
    middle = xyz.mean(axis=0)
    camera = pointglass.look_at(tuple(middle + (0, 0, 50)), tuple(middle), up=(0, 1, 0), size=(64, 48), name="top")
    pointglass.write_cameras(tmp_path / "cameras.json", [camera])
    capfd.readouterr()
    assert main(["render", str(tmp_path / "a.ply"), "--no-cache", "--cameras", str(tmp_path / "cameras.json"),
                 "--out", str(tmp_path / "out"), "--view", "raw"]) == 0
    return capfd.readouterr().err.splitlines()


def test_a_render_in_degrees_names_the_command_that_reprojects_and_one_in_metres_says_nothing(tmp_path, capfd, seed):
    rng = np.random.default_rng(seed)
    along = np.linspace(0, 1, 4000)
    flat = np.column_stack([along, np.abs(np.sin(40 * along)), rng.normal(400, 1, len(along))])
    told = [line for line in rendered(tmp_path, flat * (0.01, 0.01, 1) + (8.5, 47.4, 0), capfd) if "look like degrees" in line]
    assert len(told) == 1
    assert told[0].endswith("pointglass export a.ply --reproject EPSG:32632 --out a-utm.laz")
    assert not any("look like degrees" in line for line in rendered(tmp_path, flat * (500, 500, 1), capfd))
