"""Degrees are recognised for small and wide, flat and hilly areas, and no scan in metres is taken for degrees."""

import numpy as np
import pytest
from cloud_files import write_las

from pointglass.viewer import cli
from pointglass.viewer.grid.building.degrees import like_degrees
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.readers.arrays import ArraySource

COUNT = 20_000


def recognised(xyz) -> bool:
    source = ArraySource(xyz, np.zeros((len(xyz), 3), np.uint8))
    return like_degrees(np.array([xyz.min(axis=0), xyz.max(axis=0)]), source)


def in_lines(side, across):
    """(COUNT, 2) in flight lines over a square: neighbours in the file are neighbours on the ground."""
    lines = 4
    along = np.linspace(0, side, COUNT // lines)
    return np.concatenate([np.column_stack([along, np.full_like(along, at)]) for at in np.linspace(0, side * across, lines)])


@pytest.mark.parametrize("side", [0.0005, 0.005, 0.05, 0.3, 1.0, 3.0])
@pytest.mark.parametrize(("relief", "rough"), [(3, 0.3), (30, 2), (800, 5)])
@pytest.mark.parametrize("place", [(8.5, 47.4), (-75.2, 39.9), (151.2, -33.8), (-3.0, 5.0), (47.4, 8.5), (52.0, 120.0)])
def test_areas_in_degrees_are_recognised(side, relief, rough, place, seed):
    rng = np.random.default_rng((seed, int(side * 1e4), relief))
    flat = in_lines(side, rng.uniform(0.5, 1))
    hills = relief / 2 * (np.sin(flat[:, 0] / side * 7) + np.cos(flat[:, 1] / side * 5)) / 2
    height = hills + rng.normal(0, rough, len(flat))
    assert recognised(np.column_stack([flat + place, height + rng.uniform(0, 500)]))


def room(rng, size, place):
    """Points on the six sides of a box, a wall after the other."""
    parts = []
    for axis in range(3):
        for end in (0.0, 1.0):
            part = rng.random((COUNT // 6, 3))
            part[:, axis] = end
            order = (axis + 1) % 3
            parts.append(part[np.argsort(part[:, order])])
    return np.concatenate(parts) * size + place + rng.normal(0, 0.001, (COUNT // 6 * 6, 3))


SIZES = [(4, 3, 2.5), (10, 10, 10), (10, 10, 0.1), (1, 1, 30), (0.3, 0.3, 20), (0.1, 0.1, 9), (60, 40, 12), (2, 50, 60),
         (80, 80, 300)]  # fmt: skip


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("place", [(0, 0, 0), (10, 45, 0), (-75, 40, 12), (100, 50, 3), (3, 80, 100), (-2, 1, 0)])
def test_scans_in_metres_are_not_taken_for_degrees(size, place, seed):
    rng = np.random.default_rng(seed)
    for centred in (0.0, 0.5):
        xyz = room(rng, np.array(size), np.array(place) - centred * np.array(size))
        assert not recognised(xyz), (size, place)
        assert not recognised(rng.permutation(xyz)), (size, place)


@pytest.mark.parametrize("spacing", [0.005, 0.05])
@pytest.mark.parametrize("place", [(0, 0), (10, 45), (-75, 40), (0.5, 0.2)])
def test_masts_and_facades_in_vertical_scan_lines_are_not_taken_for_degrees(spacing, place, seed):
    rng = np.random.default_rng(seed)
    for width, height in ((0.4, 30.0), (0.1, 9.0), (12.0, 40.0)):
        heights = np.tile(np.arange(0, height, spacing), 40)
        across = np.repeat(np.linspace(0, width, 40), len(heights) // 40)
        xyz = np.column_stack([across, np.zeros_like(across), heights]) + (*place, 0.0)
        assert not recognised(np.round(xyz + rng.normal(0, 0.001, xyz.shape), 3))


def test_a_wide_flat_area_gives_the_warning_and_can_be_reprojected(tmp_path):
    rng = np.random.default_rng(3)
    flat = in_lines(1.0, 1.0)
    xyz = np.column_stack([flat + (5.0, 52.0), 8 + rng.normal(0, 1.0, len(flat))])
    path = write_las(tmp_path / "a.las", xyz, np.full((len(xyz), 3), 90), scale=1e-7)
    assert any("look like degrees" in text for text in open_scene(path, cache=False).meta.warning_texts)
    assert cli.main(["export", "--no-cache", str(path), "--reproject", "auto", "--out", str(tmp_path / "b.las")]) == 0


@pytest.mark.parametrize("half", [0.5, 5.0, 50.0])
def test_a_scan_around_its_scanner_is_not_taken_for_degrees(half, seed):
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(COUNT, 3))
    xyz = directions / np.abs(directions).max(axis=1, keepdims=True) * half
    assert not recognised(xyz) and not recognised(xyz * (1, 1, 0.1))


@pytest.mark.parametrize("stated", [False, True])
def test_info_and_convert_say_degrees_in_one_line_with_the_command_that_reprojects(tmp_path, capfd, stated):
    flat = in_lines(0.01, 1.0)
    xyz = np.column_stack([flat + (8.5, 47.4), 400 + np.random.default_rng(4).normal(0, 1.0, len(flat))])
    path = tmp_path / "a.csv"
    np.savetxt(path, xyz, delimiter=",", fmt="%.8f", comments="", header="longitude,latitude,height" if stated else "x,y,z")
    command = "pointglass export a.csv --reproject EPSG:32632 --out a-utm.laz"
    for arguments in (["info", "--no-cache", path], ["convert", path, "--out", tmp_path / "grid"], ["info", tmp_path / "grid"]):
        capfd.readouterr()
        assert cli.main(list(map(str, arguments))) == 0
        told = [line for text in capfd.readouterr() for line in text.splitlines() if "degrees" in line]
        assert len(told) == 1 and told[0].endswith(command), (arguments, told)
