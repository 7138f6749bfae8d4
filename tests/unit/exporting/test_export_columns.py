"""Between formats: coordinates, intensities and every further column, read by laspy, plyfile and libe57."""

from typing import Any

import laspy
import numpy as np
import plyfile
import pyproj
import pytest
from e57_files import contents
from examples import examples
from untyped import libe57, read_las

from pointglass.viewer import cli

WKT = pyproj.CRS.from_epsg(25832).to_wkt("WKT1_GDAL")


def export(*arguments):
    assert cli.main(["export", "--no-cache", *map(str, arguments)]) == 0


def cloud(seed, count=4000, digits=3):
    """Coordinates of so many decimals on a national grid, colours, and columns of several types."""
    rng = np.random.default_rng(seed)
    xyz = np.round(rng.random((count, 3)) * (40, 30, 5), digits) + (500_000, 5_800_000, 100)
    columns = {"intensity": rng.uniform(-40, 3, count).astype(np.float32), "time": rng.uniform(3e8, 4e8, count),
               "quality": rng.integers(-5, 6, count).astype(np.int16),
               "level": rng.integers(0, 2**32, count).astype(np.uint32)}  # fmt: skip
    return np.round(xyz, digits), rng.integers(0, 256, (count, 3), dtype=np.uint8), columns


def write_ply(path, xyz, rgb, columns):
    rows = np.zeros(len(xyz), [*((axis, "f8") for axis in "xyz"), ("red", "u1"), ("green", "u1"), ("blue", "u1"),
                               *((name, values.dtype) for name, values in columns.items())])  # fmt: skip
    for i, (axis, colour) in enumerate(zip("xyz", ("red", "green", "blue"), strict=True)):
        rows[axis], rows[colour] = xyz[:, i], rgb[:, i]
    for name, values in columns.items():
        rows[name] = values
    plyfile.PlyData([plyfile.PlyElement.describe(rows, "vertex")]).write(str(path))


@pytest.mark.parametrize("seed", range(examples(2)))
@pytest.mark.parametrize("digits", [1, 3, 5])
def test_ply_to_laz_keeps_decimals_and_every_column(tmp_path, capsys, seed, digits):
    xyz, rgb, columns = cloud(seed, digits=digits)
    write_ply(tmp_path / "a.ply", xyz, rgb, columns)
    export(tmp_path / "a.ply", "--out", tmp_path / "b.laz")
    told = capsys.readouterr().err
    las = read_las(tmp_path / "b.laz")
    assert las.header.scales.tolist() == [10.0 ** -max(digits, 3)] * 3
    assert np.array_equal(np.round(las.xyz, digits), xyz)
    assert np.array_equal(np.stack([las.red, las.green, las.blue], axis=1), rgb * np.uint16(257))
    assert np.array_equal(las.gps_time, columns["time"])
    for name in ("quality", "level"):
        assert np.array_equal(las[name], columns[name]) and np.asarray(las[name]).dtype == columns[name].dtype
    assert np.array_equal(las["intensity_value"], columns["intensity"]) and "intensity_value" in told
    scale = np.ptp(columns["intensity"].astype(float)) / 65535
    assert np.abs(las.intensity * scale + columns["intensity"].min() - columns["intensity"]).max() <= scale


@pytest.mark.parametrize("seed", range(examples(2)))
def test_ply_to_e57_to_las_keeps_every_column(tmp_path, seed):
    xyz, rgb, columns = cloud(seed)
    write_ply(tmp_path / "a.ply", xyz, rgb, columns)
    export(tmp_path / "a.ply", "--out", tmp_path / "b.e57")
    points, found = "/data3D/0/points", contents(tmp_path / "b.e57")
    assert np.array_equal(np.frombuffer(found[f"{points}/cartesianX"]), xyz[:, 0])
    assert np.array_equal(np.frombuffer(found[f"{points}/intensity"], np.float32), columns["intensity"])
    assert np.array_equal(np.frombuffer(found[f"{points}/colorGreen"], np.int64), rgb[:, 1])
    assert np.array_equal(np.frombuffer(found[f"{points}/pg:time"]), columns["time"])
    export(tmp_path / "b.e57", "--out", tmp_path / "c.las")
    las = read_las(tmp_path / "c.las")
    assert np.array_equal(np.round(las.xyz, 3), xyz)
    assert np.array_equal(las.gps_time, columns["time"]) and np.array_equal(las["quality"], columns["quality"])


def test_ply_keeps_its_rows_and_names_what_they_cannot_hold(tmp_path, capsys):
    xyz, rgb, columns = cloud(3)
    write_ply(tmp_path / "a.ply", xyz, rgb, columns)
    export(tmp_path / "a.ply", "--out", tmp_path / "b.ply")
    told = capsys.readouterr().err
    assert "has no time, quality, level (--all-columns" in told and told.count("\n") == 1
    plain = plyfile.PlyData.read(str(tmp_path / "b.ply"))["vertex"]
    assert [p.name for p in plain.properties] == ["x", "y", "z", "red", "green", "blue", "intensity", "scan", "classification"]
    assert np.array_equal(plain["intensity"], columns["intensity"])
    assert np.array_equal(np.stack([plain[axis] for axis in "xyz"], axis=1), xyz)
    export(tmp_path / "a.ply", "--all-columns", "--out", tmp_path / "c.ply")
    whole = plyfile.PlyData.read(str(tmp_path / "c.ply"))["vertex"]
    for name, values in columns.items():
        assert np.array_equal(whole[name], values)
    assert "--all-columns" not in capsys.readouterr().err


def las_with(path, point_format, version, seed, shift=0.0, scale=0.001, wkt=WKT, wide=True):
    rng = np.random.default_rng(seed)
    header = laspy.LasHeader(point_format=point_format, version=version)
    header.scales, header.offsets = np.full(3, scale), np.floor(rng.uniform(0, 1000, 3))
    header.add_extra_dim(laspy.ExtraBytesParams(f"extra{point_format}", "f4"))
    if wkt:
        header.vlrs.append(laspy.vlrs.known.WktCoordinateSystemVlr(wkt))
        header.global_encoding.wkt = version == "1.4"
    las = laspy.LasData(header)
    las.x, las.y, las.z = (np.round(rng.random((3, 2000)) * 50, 2) + 500_000 + shift)
    las[f"extra{point_format}"] = rng.random(2000).astype(np.float32)
    las.intensity, las.gps_time = rng.integers(0, 65536, 2000), rng.uniform(0, 6e5, 2000)
    las.return_number, las.number_of_returns = rng.integers(1, 6, 2000), np.full(2000, 5)
    las.withheld = rng.integers(0, 2, 2000)
    las.classification = rng.integers(0, 32, 2000)
    las.red, las.green, las.blue = rng.integers(0, 256, (3, 2000)) * (257 if wide else 1)
    las.write(str(path))
    return read_las(path)


def test_las_files_of_different_formats_become_one_that_holds_all_their_dimensions(tmp_path):
    a = las_with(tmp_path / "a.las", 3, "1.2", 1)
    b = las_with(tmp_path / "b.laz", 7, "1.4", 2, shift=40.0, scale=0.01)
    export(tmp_path / "a.las", tmp_path / "b.laz", "--out", tmp_path / "c.laz")
    c, n = read_las(tmp_path / "c.laz"), len(a)
    assert c.header.point_format.id == 7 and c.header.parse_crs().to_epsg() == 25832
    assert np.array_equal(np.round(c.xyz, 3), np.round(np.concatenate([a.xyz, b.xyz]), 3))
    for name in ("intensity", "gps_time", "return_number", "number_of_returns", "withheld", "classification", "red", "blue"):
        assert np.array_equal(c[name], np.concatenate([np.asarray(a[name]), np.asarray(b[name])])), name
    assert np.array_equal(c["extra3"][:n], a["extra3"]) and np.array_equal(c["extra7"][n:], b["extra7"])
    assert np.isnan(c["extra7"][:n]).all()
    assert sorted(np.unique(c.point_source_id)) == [1, 2]  # all ids are 0, so they tell the files


def test_las_tiles_of_one_format_keep_each_value_in_the_finest_scale(tmp_path):
    a = las_with(tmp_path / "a.las", 7, "1.4", 1, wide=False)
    b = las_with(tmp_path / "b.laz", 7, "1.4", 2, shift=40.0, scale=0.01)
    export(tmp_path / "a.las", tmp_path / "b.laz", "--out", tmp_path / "c.laz")
    c, n = read_las(tmp_path / "c.laz"), len(a)
    assert c.header.scales.tolist() == [0.001] * 3
    assert np.array_equal(np.round(c.xyz, 3), np.round(np.concatenate([a.xyz, b.xyz]), 3))
    assert np.array_equal(c.red[:n], np.asarray(a.red) * 257) and np.array_equal(c.red[n:], b.red)
    assert np.array_equal(c["extra7"], np.concatenate([a["extra7"], b["extra7"]]))


@pytest.mark.parametrize("target", ["e57", "laz", "ply"])
def test_the_reference_system_goes_from_format_to_format(tmp_path, target):
    las_with(tmp_path / "a.las", 7, "1.4", 1)
    export(tmp_path / "a.las", "--out", tmp_path / f"b.{target}")
    export(tmp_path / f"b.{target}", "--out", tmp_path / "c.laz")
    assert read_las(tmp_path / "c.laz").header.parse_crs().to_epsg() == 25832


def test_files_of_different_systems_are_exported_without_one_and_both_are_named(tmp_path, capsys):
    las_with(tmp_path / "a.las", 7, "1.4", 1)
    las_with(tmp_path / "b.las", 7, "1.4", 2, wkt=pyproj.CRS.from_epsg(25833).to_wkt("WKT1_GDAL"))
    export(tmp_path / "a.las", tmp_path / "b.las", "--out", tmp_path / "c.laz")
    told = capsys.readouterr().err
    assert "zone 32N in a.las" in told and "zone 33N in b.las" in told
    assert read_las(tmp_path / "c.laz").header.parse_crs() is None


def test_geotiff_keys_become_the_text_of_an_e57(tmp_path):
    xyz, rgb, _ = cloud(5)
    header = laspy.LasHeader(point_format=2, version="1.2")
    header.scales, header.offsets = np.full(3, 0.001), np.floor(xyz.min(axis=0))
    keys = np.array([1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 25832], "<u2")
    header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", keys.tobytes()))
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = rgb.T.astype(np.uint16)
    las.write(str(tmp_path / "a.las"))
    export(tmp_path / "a.las", "--out", tmp_path / "b.e57")
    image = libe57.ImageFile(str(tmp_path / "b.e57"), "r")
    text = image.root()["coordinateMetadata"].value()
    image.close()
    assert pyproj.CRS.from_wkt(text).to_epsg() == 25832


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_further_fields_of_pcd_are_kept(tmp_path, data):
    import open3d

    library: Any = open3d.t  # its types know neither arrays nor paths
    rng = np.random.default_rng(4)
    xyz = np.round(rng.random((500, 3)) * 4, 2).astype(np.float32)
    curvature, ring = rng.random(500).astype(np.float32), rng.integers(0, 64, 500).astype(np.int32)
    points = library.geometry.PointCloud(xyz)
    points.point["curvature"], points.point["ring"] = curvature[:, None], ring[:, None]
    assert library.io.write_point_cloud(str(tmp_path / "a.pcd"), points, write_ascii=data == "ascii",
                                        compressed=data == "binary_compressed")  # fmt: skip
    export(tmp_path / "a.pcd", "--out", tmp_path / "b.las")
    las = read_las(tmp_path / "b.las")
    assert np.array_equal(np.round(las.xyz, 2), np.round(xyz.astype(float), 2))
    assert np.allclose(las["curvature"], curvature, rtol=1e-5) and np.array_equal(las["ring"], ring)


def test_shares_of_full_intensity_are_written_in_16_bits_and_kept_by_all_columns(tmp_path, capsys):
    xyz, rgb, _ = cloud(6)
    shares = np.linspace(0.25, 0.5, len(xyz)).astype(np.float32)
    write_ply(tmp_path / "a.ply", xyz, rgb, {"intensity": shares})
    export(tmp_path / "a.ply", "--out", tmp_path / "b.ply")
    assert "times 65535" in capsys.readouterr().err
    assert np.array_equal(plyfile.PlyData.read(str(tmp_path / "b.ply"))["vertex"]["intensity"], np.rint(shares * 65535.0))
    export(tmp_path / "a.ply", "--all-columns", "--out", tmp_path / "c.ply")
    assert np.array_equal(plyfile.PlyData.read(str(tmp_path / "c.ply"))["vertex"]["intensity"], shares)


def test_a_ply_exported_again_keeps_the_numbers_of_its_scans(tmp_path, capsys):
    a, b = (las_with(tmp_path / f"{name}.las", 7, "1.4", seed) for seed, name in enumerate("ab"))
    export(tmp_path / "a.las", tmp_path / "b.las", "--out", tmp_path / "c.ply")
    capsys.readouterr()
    export(tmp_path / "c.ply", "--clip", "-9e9,-9e9,-9e9,9e9,9e9,9e9", "--out", tmp_path / "d.ply")
    assert capsys.readouterr().err == ""
    first, again = (plyfile.PlyData.read(str(tmp_path / f"{name}.ply"))["vertex"].data for name in "cd")
    assert np.array_equal(first["scan"], np.repeat([0, 1], [len(a), len(b)])) and np.array_equal(first, again)
