"""The lines of ``info``: a name in a file may hold anything, and never makes a line of its own."""

import numpy as np

from pointglass.viewer.commands.info import facts, format_text
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary


def test_a_scan_whose_name_has_newlines_and_tabs_has_one_line(seed):
    rng = np.random.default_rng(seed)
    names = ScanDescription(scans=(ScanSummary("hall\nwarning  all is well", 50), ScanSummary("\ttwo\x1b[2J", 50)))
    scene = scene_from_arrays(rng.random((100, 3)), np.zeros((100, 3), np.uint8), meta=names)
    lines = format_text(scene).split("\n")
    assert [line for line in lines if line.startswith("scan ")] == [
        "scan     hall warning all is well: 50 points, no pose", r"scan     two\x1b[2J: 50 points, no pose"]
    assert not any(line.startswith("warning  all") for line in lines) and all(line.isprintable() for line in lines)


def test_the_spacing_of_points_in_one_place_is_unknown():
    for count in (1, 200):
        scene = scene_from_arrays(np.ones((count, 3)), np.zeros((count, 3), np.uint8))
        assert "spacing  unknown: all points lie in one place" in format_text(scene).split("\n")
        assert facts(scene)["spacing"] is None


def test_coordinates_of_a_thousand_million_keep_their_millimetres():
    xyz = 1e9 + np.arange(30).reshape(-1, 3) * 0.001
    scene = scene_from_arrays(xyz, np.zeros((10, 3), np.uint8))
    lines = format_text(scene).split("\n")
    assert "from     (1000000000, 1000000000.001, 1000000000.002)" in lines
    assert "to       (1000000000.027, 1000000000.028, 1000000000.029)" in lines
