"""Coordinates with all digits of double precision are rounded to the steps of LAS, which one line names; others are exact."""

import laspy
import numpy as np
import pytest
from cloud_files import E57Scan, write_e57, write_ply
from format_files import Points, write_pcd

from pointglass.viewer import cli

COUNT = 400
STEP = 1e-7
LINE = "coordinates are rounded to 1e-07"


def write_text(path, xyz):
    np.savetxt(path, xyz, fmt="%.17g")


def write_double_pcd(path, xyz):
    grey = np.full((len(xyz), 3), 90, np.uint8)
    write_pcd(path, Points(xyz, grey, np.zeros(len(xyz), np.uint16), np.zeros(len(xyz), np.uint8)), "binary")


WRITERS = {
    "a.e57": lambda path, xyz: write_e57(path, [E57Scan(xyz)]),
    "a.ply": write_ply,
    "a.pcd": write_double_pcd,
    "a.txt": write_text,
}


@pytest.fixture
def export(tmp_path, capsys):
    """Exports coordinates, (n, 3) float64, of a file of a format.  Returns what laspy reads, and the lines on stderr."""

    def run(name, xyz, target):
        WRITERS[name](tmp_path / name, xyz)
        capsys.readouterr()
        assert cli.main(["export", "--no-cache", str(tmp_path / name), "--out", str(tmp_path / target)]) == 0
        return laspy.read(tmp_path / target), capsys.readouterr().err.splitlines()

    return run


@pytest.mark.parametrize("target", ["b.las", "b.laz"])
@pytest.mark.parametrize("name", WRITERS)
def test_the_step_to_which_doubles_are_rounded_is_named(export, seed, name, target):
    xyz = np.random.default_rng(seed).random((COUNT, 3)) * (20, 10, 3)
    made, lines = export(name, xyz, target)
    np.testing.assert_array_equal(made.header.scales, STEP)
    error = np.abs(made.xyz - xyz).max()
    assert 0 < error <= STEP / 2 * (1 + 1e-6)
    assert sum(LINE in line for line in lines) == 1, lines


@pytest.mark.parametrize("name", WRITERS)
def test_coordinates_of_a_tenth_of_a_millimetre_are_exact_and_nothing_is_said(export, seed, name):
    whole = np.random.default_rng(seed).integers(0, 200_000, (COUNT, 3))
    made, lines = export(name, whole / 1e4, "b.laz")
    np.testing.assert_array_equal(np.rint(made.xyz * 1e4), whole)
    np.testing.assert_allclose(made.xyz, whole / 1e4, rtol=0, atol=1e-11)
    assert not any("rounded" in line for line in lines), lines


def test_a_coarser_step_that_32_bits_force_is_the_one_that_is_named(export, seed):
    xyz = np.random.default_rng(seed).random((COUNT, 3)) * (20, 10, 3)
    xyz[0] = 3000.0, 10.0, 3.0
    made, lines = export("a.txt", xyz, "b.las")
    assert made.header.scales[0] == 1e-6
    assert np.abs(made.x - xyz[:, 0]).max() <= 0.5e-6 * (1 + 1e-6)
    assert ["1e-06, the finest step" in line for line in lines if "rounded" in line] == [True]
