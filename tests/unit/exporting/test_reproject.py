"""``export --reproject``: coordinates as pyproj computes them, all columns kept, read by laspy, plyfile and libe57."""

import shlex

import laspy
import numpy as np
import plyfile
import pyproj
import pytest
from e57_files import Writer, contents
from scipy.spatial.transform import Rotation
from untyped import libe57, read_las

import pointglass
from pointglass.viewer import cli
from pointglass.viewer.common.errors import InputError

MILLIMETRE = 1e-3


def export(*arguments, code=0):
    assert cli.main(["export", "--no-cache", *map(str, arguments)]) == code


def write_las(path, xyz, crs=None, *, colours=65536):
    rng = np.random.default_rng(8)
    header = laspy.LasHeader(point_format=7, version="1.4")
    step = 1e-9 if np.ptp(xyz[:, :2], axis=0).max() < 1 else 1e-6 if np.abs(xyz).max() < 360 else 1e-3
    header.scales, header.offsets = np.array([step, step, 1e-3]), np.floor(xyz.min(axis=0))
    header.add_extra_dim(laspy.ExtraBytesParams("quality", "int16"))
    header.vlrs.append(laspy.VLR("somebody", 7, "a note", b"kept"))
    header.vlrs.append(laspy.VLR("liblas", 2112, "the former system", b"PROJCS[]\0"))
    header.global_encoding.gps_time_type = laspy.header.GpsTimeType.STANDARD
    if crs is not None:
        header.add_crs(pyproj.CRS.from_user_input(crs))
    las = laspy.LasData(header)
    las.xyz = xyz
    count = len(xyz)
    las.red, las.green, las.blue = rng.integers(0, colours, (3, count), dtype=np.uint16)
    las.intensity, las.gps_time = rng.integers(0, 65536, count), rng.random(count) * 1e8
    las.quality, las.classification, las.point_source_id = rng.integers(-9, 9, (3, count)) + np.array([[0], [20], [50]])
    las.return_number, las.number_of_returns = np.ones((2, count), np.uint8)
    las.write(str(path))
    return read_las(str(path))


def place(seed, at, side, count=3000, tall=30.0):
    rng = np.random.default_rng(seed)
    return np.c_[rng.random((count, 2)) * side, rng.random(count) * tall] + (*at, 100.0)


def moved(xyz, source, target):
    change = pyproj.Transformer.from_crs(source, target, always_xy=True)
    return np.stack([*change.transform(xyz[:, 0], xyz[:, 1]), xyz[:, 2]], axis=1)


SCANS = [  # system in the file, system of its numbers, place, side, target, its code
    (None, "EPSG:4326", (8.5, 47.4), 0.002, "auto", "EPSG:32632"),
    ("EPSG:4326", "EPSG:4326", (151.2, -33.8), 0.002, "auto", "EPSG:32756"),
    ("EPSG:25832", "EPSG:25832", (500_000, 5_700_000), 200, "EPSG:25833", "EPSG:25833"),
    ("EPSG:25832", "EPSG:25832", (500_000, 5_700_000), 200, "4326", "EPSG:4326"),
    ("EPSG:2056", "EPSG:2056", (2_600_000, 1_200_000), 150, "auto", "EPSG:32632"),
]


@pytest.mark.parametrize(("stated", "system", "at", "side", "target", "code"), SCANS)
def test_las_is_reprojected_with_all_its_columns(tmp_path, capsys, stated, system, at, side, target, code):
    before = write_las(tmp_path / "a.las", place(1, at, side), stated, colours=256 if stated == "EPSG:2056" else 65536)
    export(tmp_path / "a.las", "--reproject", target, "--out", tmp_path / "b.laz")
    told = capsys.readouterr().err
    after = read_las(tmp_path / "b.laz")
    unit = MILLIMETRE if code != "EPSG:4326" else MILLIMETRE / 111_000
    assert np.abs(after.xyz - moved(before.xyz, system, code))[:, :2].max() < unit
    assert np.abs(after.z - before.z).max() < 1e-6
    assert (after.header.scales <= 1e-3).all() and (np.abs(after.header.offsets - after.xyz.mean(axis=0)) < 5000).all()
    assert after.header.parse_crs().to_epsg() == int(code[5:])
    for name in before.point_format.dimension_names:
        if name not in ("X", "Y", "Z"):
            assert np.array_equal(before[name], after[name]), name
    assert after.header.global_encoding.gps_time_type == before.header.global_encoding.gps_time_type
    notes = [(record.description, record.record_data) for record in after.header.vlrs if record.user_id == "somebody"]
    assert notes == [("a note", b"kept")] and not any(record.user_id == "liblas" for record in after.header.vlrs)
    assert ("read as EPSG:4326" in told) == (stated is None) and told.count("\n") <= 1
    assert (code in told) or target != "auto"


@pytest.mark.parametrize("ending", [".e57", ".ply"])
def test_e57_and_ply_hold_the_same_coordinates(tmp_path, ending):
    before = write_las(tmp_path / "a.laz", place(2, (11.5, 48.1), 0.002), "EPSG:4326")
    path = tmp_path / f"b{ending}"
    export(tmp_path / "a.laz", "--reproject", "EPSG:25832", "--all-columns", "--out", path)
    wanted = moved(before.xyz, "EPSG:4326", "EPSG:25832")
    if ending == ".ply":
        rows = plyfile.PlyData.read(str(path))
        found = np.stack([rows["vertex"][axis] for axis in "xyz"], axis=1)
        assert any("EPSG:25832" in comment for comment in rows.comments)
        assert np.array_equal(rows["vertex"]["quality"], before.quality)
    else:
        parts = contents(path)
        found = np.stack([np.frombuffer(parts[f"/data3D/0/points/cartesian{axis}"]) for axis in "XYZ"], axis=1)
        assert pyproj.CRS.from_user_input(parts["/coordinateMetadata"][1]).to_epsg() == 25832
    assert np.abs(found - wanted).max() < 1e-8


def write_e57(path, xyz, crs, position, turn):
    """One scan whose points are counted from a turned scanner."""
    writer = Writer(path)
    image, root = writer.image, writer.image.root()
    for name, value in {"formatName": "ASTM E57 3D Imaging Data File", "guid": "{file}", "versionMajor": 1, "versionMinor": 0,
                        "e57LibraryVersion": "other", "coordinateMetadata": pyproj.CRS.from_epsg(crs).to_wkt("WKT1_GDAL"),
                        "creationDateTime": {"dateTimeValue": 1.2e9, "isAtomicClockReferenced": 0}}.items():  # fmt: skip
        root.set(name, writer.node(value))
    data = libe57.VectorNode(image, True)
    root.set("data3D", data)
    root.set("images2D", libe57.VectorNode(image, True))
    x, y, z, w = turn.as_quat().tolist()
    rotation, translation = {"w": w, "x": x, "y": y, "z": z}, dict(zip("xyz", position.tolist(), strict=True))
    scan = writer.node({"guid": "{scan}", "name": "hall", "pose": {"rotation": rotation, "translation": translation}})
    own = turn.inv().apply(xyz - position)
    fields = {f"cartesian{axis}": (libe57.FloatNode(image, 0.0, libe57.E57_DOUBLE), np.ascontiguousarray(own[:, column]))
              for column, axis in enumerate("XYZ")}  # fmt: skip
    points = writer.vector(scan, "points", fields)
    data.append(scan)
    writer.fill(points, fields)
    image.close()


def test_scanner_positions_of_e57_are_transformed_and_lost_rotations_are_named(tmp_path, capsys):
    xyz, position = place(3, (500_000, 5_700_000), 40), np.array([500_010.0, 5_700_010.0, 101.0])
    write_e57(tmp_path / "a.e57", xyz, 25832, position, Rotation.from_euler("xyz", (0.1, -0.2, 1.1)))
    export(tmp_path / "a.e57", "--reproject", "EPSG:25833", "--out", tmp_path / "b.e57")
    assert "rotations of poses are not written" in capsys.readouterr().err
    parts = contents(tmp_path / "b.e57")
    found = np.array([parts[f"/data3D/0/pose/translation/{axis}"][1] for axis in "xyz"])
    assert np.abs(found - moved(position[None], 25832, 25833)[0]).max() < 1e-6
    own = np.stack([np.frombuffer(parts[f"/data3D/0/points/cartesian{axis}"]) for axis in "XYZ"], axis=1)
    assert np.abs(own + found - moved(xyz, 25832, 25833)).max() < 1e-6
    export(tmp_path / "a.e57", "--reproject", "EPSG:4258", "--out", tmp_path / "c.e57")
    assert "without poses" in capsys.readouterr().err
    assert not any("/pose" in name for name in contents(tmp_path / "c.e57"))


def test_clips_are_in_the_scans_own_coordinates(tmp_path):
    xyz = place(4, (8.5, 47.4), 0.002)
    before = write_las(tmp_path / "a.las", xyz).xyz
    export(tmp_path / "a.las", "--reproject", "auto", "--clip", "8.5,47.4,0,8.501,47.402,200", "--out", tmp_path / "b.las")
    wanted = moved(before[before[:, 0] <= 8.501], 4326, 32632)
    assert np.abs(read_las(tmp_path / "b.las").xyz - wanted).max() < MILLIMETRE


def test_latitude_before_longitude_is_recognised_where_only_that_is_possible(tmp_path, capsys):
    xyz = place(5, (-33.8, 151.2), 0.002)
    np.savetxt(tmp_path / "a.xyz", xyz, fmt="%.10f")
    export(tmp_path / "a.xyz", "--reproject", "auto", "--out", tmp_path / "b.las")
    assert "latitude, longitude" in capsys.readouterr().err
    assert np.abs(read_las(tmp_path / "b.las").xyz - moved(xyz[:, [1, 0, 2]], 4326, 32756)).max() < MILLIMETRE


def test_heights_in_feet_become_metres_for_every_target_in_metres_or_degrees(tmp_path, capsys):
    before = write_las(tmp_path / "a.las", place(6, (3_100_000, 1_700_000), 500), 2231)
    for target, unit in ((32613, MILLIMETRE), (4326, MILLIMETRE / 111_000)):
        export(tmp_path / "a.las", "--reproject", f"EPSG:{target}", "--out", tmp_path / "b.laz")
        assert "heights are converted from US survey foot, the unit of x and y, to metre" in capsys.readouterr().err
        after = read_las(tmp_path / "b.laz")
        assert np.abs(after.xyz - moved(before.xyz, 2231, target))[:, :2].max() < unit
        assert np.abs(after.z - before.z * (1200 / 3937)).max() < MILLIMETRE / 10
    export(tmp_path / "a.las", "--reproject", "EPSG:32613+5703", "--out", tmp_path / "c.las")
    assert "taken for those of" in capsys.readouterr().err
    after = read_las(tmp_path / "c.las")
    assert np.abs(after.z - before.z * (1200 / 3937)).max() < MILLIMETRE
    assert after.header.parse_crs().sub_crs_list[1].to_epsg() == 5703


def test_heights_get_the_unit_of_a_target_in_feet(tmp_path, capsys):
    before = write_las(tmp_path / "a.las", place(6, (560_000, 4_900_000), 300), 26910)
    export(tmp_path / "a.las", "--reproject", "EPSG:2992", "--out", tmp_path / "b.las")
    assert "heights are converted from metre, the unit of x and y, to foot" in capsys.readouterr().err
    assert np.abs(read_las(tmp_path / "b.las").z - before.z / 0.3048).max() < MILLIMETRE
    write_las(tmp_path / "c.las", before.xyz, "EPSG:26910+6360")  # heights in US survey feet
    export(tmp_path / "c.las", "--reproject", "EPSG:2992", "--out", tmp_path / "d.las")
    assert "heights are converted from US survey foot to foot" in capsys.readouterr().err
    assert np.abs(read_las(tmp_path / "d.las").z - before.z / 0.3048 * (1200 / 3937)).max() < MILLIMETRE


def test_heights_of_geocentric_coordinates_are_in_the_unit_of_the_target(tmp_path):
    xyz = place(13, (-123.07, 44.05), 0.002)
    ecef = np.stack(pyproj.Transformer.from_crs(4979, 4978, always_xy=True).transform(*xyz.T), axis=1)
    write_las(tmp_path / "a.las", ecef, 4978)
    for target, length in ((32610, 1.0), (2992, 0.3048), (4326, 1.0)):
        export(tmp_path / "a.las", "--reproject", f"EPSG:{target}", "--out", tmp_path / "b.las")
        assert np.abs(read_las(tmp_path / "b.las").z * length - xyz[:, 2]).max() < 3 * MILLIMETRE


def test_both_systems_with_heights_are_transformed_in_three_dimensions(tmp_path):
    before = write_las(tmp_path / "a.las", place(7, (500_000, 4_400_000), 300), "EPSG:26913+6360")
    export(tmp_path / "a.las", "--reproject", "EPSG:26912+5703", "--out", tmp_path / "b.las")
    change = pyproj.Transformer.from_crs("EPSG:26913+6360", "EPSG:26912+5703", always_xy=True)
    wanted = np.stack(change.transform(*before.xyz.T), axis=1)
    assert np.abs(read_las(tmp_path / "b.las").xyz - wanted).max() < MILLIMETRE
    assert np.abs(wanted - before.xyz)[:, 2].min() > 60


@pytest.mark.parametrize(("crs", "at", "side", "target", "said"), [
    (25832, (500_000, 5_700_000), 200, "EPSG:999999", "no such"), (25832, (500_000, 5_700_000), 200, "UTM", "not an EPSG code"),
    (25832, (500_000, 5_700_000), 200, "EPSG:4978", "geocentric"), (25832, (500_000, 5_700_000), 200, "EPSG:5773", "no such"),
    (None, (500_000, 5_700_000), 200, "auto", "states no coordinate reference system"),
    (4326, (500_000, 5_700_000), 200, "auto", "is no place in WGS 84"),
    (25832, (400_000_000, 5_700_000), 200, "EPSG:25833", "is no place in"),
])  # fmt: skip
def test_what_cannot_be_transformed_is_refused_in_one_line(tmp_path, capsys, crs, at, side, target, said):
    write_las(tmp_path / "a.las", place(9, at, side), crs)
    export(tmp_path / "a.las", "--reproject", target, "--out", tmp_path / "b.las", code=2)
    told = capsys.readouterr().err.strip().splitlines()
    assert said in told[-1] and "--reproject" in told[-1] and not (tmp_path / "b.las").exists()


def test_points_that_have_no_place_in_the_target_are_counted(tmp_path, capsys):
    xyz = place(10, (0, 60), 20, tall=5.0)
    xyz[:40, 1] += 31
    write_las(tmp_path / "a.las", xyz, 4326)
    wrong = int((~np.isfinite(moved(read_las(tmp_path / "a.las").xyz, 4326, 3035)).all(axis=1)).sum())
    export(tmp_path / "a.las", "--reproject", "EPSG:3035", "--out", tmp_path / "b.las", code=2)
    assert wrong and f"{wrong:,} of 3,000 points" in capsys.readouterr().err and not (tmp_path / "b.las").exists()


def test_the_warning_about_degrees_names_the_command_which_then_works(tmp_path, capsys, monkeypatch):
    before = write_las(tmp_path / "old town.las", place(11, (8.5, 47.4), 0.002))
    assert cli.main(["info", "--no-cache", str(tmp_path / "old town.las")]) == 0
    said = capsys.readouterr()
    command = next(line for line in (said.out + said.err).splitlines() if "--reproject" in line).split("pointglass export ")[1]
    monkeypatch.chdir(tmp_path)
    assert shlex.split(command)[:3] == ["old town.las", "--reproject", "EPSG:32632"]
    export(*shlex.split(command))
    after = read_las(tmp_path / shlex.split(command)[-1])
    assert np.abs(after.xyz - moved(before.xyz, 4326, 32632)).max() < MILLIMETRE


def test_python_reprojects_too(tmp_path):
    before = write_las(tmp_path / "a.las", place(12, (500_000, 5_700_000), 100), 25832)
    with pointglass.open(tmp_path / "a.las") as scan:
        assert scan.export(tmp_path / "b.laz", reproject="EPSG:25833") == len(before.xyz)
        with pytest.raises(InputError, match="no such"):
            scan.export(tmp_path / "c.laz", reproject="EPSG:999999")
    assert np.abs(read_las(tmp_path / "b.laz").xyz - moved(before.xyz, 25832, 25833)).max() < MILLIMETRE
