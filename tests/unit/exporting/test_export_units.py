"""Units and places of exports: an E57 says in which unit it is, and what does not belong together is said."""

import laspy
import numpy as np
import pyproj
import pytest
from cloud_files import write_las
from e57_files import contents

from pointglass.viewer import cli
from pointglass.viewer.readers.formats import open_source

FOOT = 1200 / 3937


def export(*arguments, code=0):
    assert cli.main(["export", "--no-cache", *map(str, arguments)]) == code


def scan(path, crs=None, geokeys=(), at=(3_100_000, 1_700_000, 5000), count=300, seed=1, size=100.0):
    """LAS with a step of a ten-thousandth of its size.  crs: as WKT.  geokeys: (key, value)."""
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, size / 1e4), np.array(at, np.float64)
    if crs is not None:
        header.add_crs(pyproj.CRS.from_user_input(crs))
    if geokeys:
        rows = [(1, 1, 0, len(geokeys)), *((key, 0, 1, value) for key, value in geokeys)]
        header.vlrs.append(laspy.VLR("LASF_Projection", 34735, record_data=np.array(rows, "<u2").tobytes()))
        header.global_encoding.wkt = False
    las = laspy.LasData(header)
    las.xyz = np.random.default_rng(seed).random((count, 3)) * size + at
    las.red, las.green, las.blue = np.random.default_rng(seed).integers(0, 65536, (3, count), dtype=np.uint16)
    las.write(str(path))
    return laspy.read(str(path)).xyz


def points_of(path):
    parts = contents(path)
    return np.stack([np.frombuffer(parts[f"/data3D/0/points/cartesian{axis}"]) for axis in "XYZ"], axis=1)


@pytest.mark.parametrize(
    ("crs", "unit", "metres"), [(2231, "US survey foot", FOOT), (2992, "foot", 0.3048), (4326, "degree", None)]
)
def test_an_e57_in_another_unit_says_so_and_is_read_in_it(tmp_path, capsys, crs, unit, metres):
    at = (8.5, 47.4, 100) if metres is None else (1_000_000, 900_000, 500)
    xyz = scan(tmp_path / "a.las", crs, at=at, size=0.001 if metres is None else 100.0)
    export(tmp_path / "a.las", "--out", tmp_path / "b.e57")
    assert f"E57 counts in metres: coordinates stay in {unit}, as the stored" in capsys.readouterr().err
    assert np.array_equal(points_of(tmp_path / "b.e57"), xyz)
    source = open_source(tmp_path / "b.e57")
    assert source.units == unit and source.metres_per_unit == (metres and pytest.approx(metres))
    warning = f"b.e57: coordinateMetadata is in {unit}: coordinates are taken to be in it, although E57 counts in metres"
    assert source.warnings == [warning]
    export(tmp_path / "b.e57", "--clip=-1e9,-1e9,-1e9,1e9,1e9,1e9", "--out", tmp_path / "c.e57")
    assert "coordinates stay in" in capsys.readouterr().err and open_source(tmp_path / "c.e57").units == unit


def test_an_e57_in_metres_says_nothing(tmp_path, capsys):
    scan(tmp_path / "a.las", 32613)
    export(tmp_path / "a.las", "--out", tmp_path / "b.e57")
    assert "metre" not in capsys.readouterr().err.replace(str(tmp_path), "")
    source = open_source(tmp_path / "b.e57")
    assert (source.units, source.metres_per_unit, source.warnings) == ("metre", 1.0, [])


def test_feet_of_a_system_that_cannot_be_stored_become_metres(tmp_path, capsys):
    xyz = scan(tmp_path / "a.las", geokeys=((1024, 1), (3072, 32767), (3076, 9003)))
    export(tmp_path / "a.las", "--out", tmp_path / "b.e57")
    assert "coordinates are converted from US survey foot, since no reference system" in capsys.readouterr().err
    assert np.abs(points_of(tmp_path / "b.e57") - xyz * FOOT).max() < 1e-6
    source = open_source(tmp_path / "b.e57")
    assert (source.units, source.warnings) == ("metre", [])


@pytest.mark.parametrize(("target", "unit"), [("EPSG:4326", "degree"), ("EPSG:2992", "foot")])
def test_reprojected_e57_say_their_unit(tmp_path, capsys, target, unit):
    scan(tmp_path / "a.las", 26910, at=(560_000, 4_900_000, 100))
    export(tmp_path / "a.las", "--reproject", target, "--out", tmp_path / "b.e57")
    assert f"coordinates stay in {unit}, as the stored" in capsys.readouterr().err
    assert open_source(tmp_path / "b.e57").units == unit


def test_files_that_do_not_belong_together_are_named(tmp_path, capsys):
    scan(tmp_path / "feet.las", 2231)
    scan(tmp_path / "metres.las", 32613, at=(500_000, 4_400_000, 100))
    export(tmp_path / "feet.las", tmp_path / "metres.las", "--out", tmp_path / "mix.laz")
    told = capsys.readouterr().err
    assert "differ in their units" in told and "different coordinate reference systems" in told and "of 2 places" in told
    scan(tmp_path / "near.las", 32613, at=(500_100, 4_400_000, 100), seed=2)
    export(tmp_path / "near.las", tmp_path / "metres.las", "--out", tmp_path / "both.laz")
    assert capsys.readouterr().err == ""


def test_coordinates_that_are_rounded_beside_far_ones_are_named(tmp_path, capsys):
    np.savetxt(tmp_path / "near.txt", np.random.default_rng(3).random((300, 3)), fmt="%.17g")
    far = scan(tmp_path / "far.las")
    export(tmp_path / "near.txt", tmp_path / "far.las", "--out", tmp_path / "b.las")
    assert "coordinates are rounded to 0.001, the finest step" in capsys.readouterr().err
    made = laspy.read(tmp_path / "b.las")
    assert made.header.scales[0] == 0.001 and np.abs(made.xyz[-len(far) :] - far).max() < 1e-6


def test_single_precision_beside_far_files_is_named(tmp_path, capsys):
    rows = np.random.default_rng(4).random((300, 3)).astype("<f4")
    head = "ply\nformat binary_little_endian 1.0\nelement vertex 300\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    (tmp_path / "near.ply").write_bytes((head + "end_header\n").encode() + rows.tobytes())
    scan(tmp_path / "far.las", at=(600_000, 1_200_000, 10))
    export(tmp_path / "near.ply", tmp_path / "far.las", "--out", tmp_path / "b.las")
    assert "coordinates are rounded to 0.001, the finest step" in capsys.readouterr().err


def test_colours_of_16_bits_with_empty_lower_bytes_are_named(tmp_path, capsys):
    rng = np.random.default_rng(5)
    for factor, said in ((256, True), (257, False)):
        write_las(tmp_path / "a.las", rng.random((300, 3)) * 10, rng.integers(0, 256, (300, 3)).astype(np.uint16) * factor)
        export(tmp_path / "a.las", "--out", tmp_path / "b.ply")
        assert ("16-bit colours are cut to 8 bits, their lower 8 are all 0" in capsys.readouterr().err) == said


def test_a_file_in_a_grid_is_not_written(tmp_path, capsys):
    scan(tmp_path / "a.las", 32613)
    assert cli.main(["convert", str(tmp_path / "a.las"), "--out", str(tmp_path / "grid")]) == 0
    before = sorted(path.name for path in (tmp_path / "grid").iterdir())
    for name in ("points.laz", "b.las"):
        assert cli.main(["export", str(tmp_path / "grid"), "--out", str(tmp_path / "grid" / name)]) == 2
        assert "a folder made by convert" in capsys.readouterr().err
    assert sorted(path.name for path in (tmp_path / "grid").iterdir()) == before
