"""PCD, text, PTX, Potree and EPT return the points that were written, in every variant: coordinates bit for bit, colour,
intensity, class.  LAS, PLY and E57 too, beyond test_readers: versions, kinds of numbers, classes."""

import subprocess
import sys

import numpy as np
import pytest
from cloud_files import E57Scan, surface, write_e57, write_las
from format_files import FAR, Points, PtxScan, some, text_rows, write_ept, write_pcd, write_potree1, write_potree2, write_ptx

from pointglass.viewer.cli import main
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.readers.formats import FORMATS, entry_of, open_source

NAMES = ("xyz", "rgb", "intensity", "classification")


def gather(path, columns=None):
    """(source, xyz, rgb, intensity, classification, scan numbers) of all chunks together."""
    source = open_source(path, columns)
    chunks = list(source.chunks())
    joined = [None if getattr(chunks[0], n) is None else np.concatenate([getattr(c, n) for c in chunks]) for n in NAMES]
    return source, *joined, np.concatenate([np.full(len(c.xyz), c.scan) for c in chunks])


def same(got: tuple, points: Points, *, wide: bool = False, classes: bool = True, intensity: bool = True, atol: float = 0.0):
    """Asserts that the points are those written, in any order.  wide: colours were written 16 bits wide."""
    _, xyz, rgb, level, found, _ = got
    assert len(xyz) == len(points.xyz)
    order, other = np.lexsort(xyz.T), np.lexsort(points.xyz.T)
    np.testing.assert_allclose(xyz[order], points.xyz[other], rtol=0, atol=atol)
    assert rgb.dtype == (np.uint16 if wide else np.uint8)
    np.testing.assert_array_equal(rgb[order], points.rgb[other].astype(np.uint16) * (257 if wide else 1))
    if intensity:
        np.testing.assert_array_equal(level[order], points.intensity[other])
    if classes:
        np.testing.assert_array_equal(found[order], points.classes[other])


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("form", [{}, {"packed": "U", "rgb_name": "rgba"}, {"packed": None}, {"pad": True}, {"packed": "I"}])
def test_pcd(tmp_path, data, form):
    points = some()
    got = gather(write_pcd(tmp_path / "a.pcd", points, data, **form))
    same(got, points)
    assert got[0].format == "PCD" and got[0].count == 400
    assert len(got[0].warnings) == ("pad" in form) and all("histogram (3 values)" in text for text in got[0].warnings)


def test_pcd_of_float32_has_their_precision_and_a_viewpoint_gives_a_warning(tmp_path):
    points = some(origin=(10.0, 0.0, 0.0))
    got = gather(write_pcd(tmp_path / "a.pcd", points, "binary", real="f4", viewpoint=(1, 2, 3, 1, 0, 0, 0)))
    same(got, points)
    assert got[0].precision == 2.0**-24 and "VIEWPOINT is not applied" in got[0].warnings[0]


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_pcd_points_that_are_nan_are_left_out_by_the_grid(tmp_path, data):
    points = some()
    points.xyz[7:10] = np.nan
    scene = open_scene(write_pcd(tmp_path / "a.pcd", points, data), cache=False)
    assert scene.count == 397 and scene.meta.dropped.nan == 3


def test_pcd_agrees_with_open3d(tmp_path):
    """Open3D is an independent reader, for the variants that it reads correctly."""
    o3d = pytest.importorskip("open3d")
    points = some()
    for data in ("ascii", "binary"):
        theirs = o3d.t.io.read_point_cloud(str(write_pcd(tmp_path / f"{data}.pcd", points, data))).point
        _, xyz, rgb, _, _, _ = gather(tmp_path / f"{data}.pcd")
        np.testing.assert_array_equal(xyz, theirs["positions"].numpy())
        np.testing.assert_array_equal(rgb, theirs["colors"].numpy())


@pytest.mark.parametrize(("names", "head"), [
    ("xyz", ""), ("xyzirgb", ""), ("xyzirgb", "# made for a test\n\n"), ("xyzrgbi", "X Y Z R G B Intensity\n"),
    ("xyzrgbic", "//X Y Z R G B Scalar_Intensity Classification\n"), ("xyzrgbn", ""), ("xyznrgb", ""),
    ("xyzrgbin", "Easting Northing Elevation[m] Red Green Blue Intensity Nx Ny Nz\n"), ("zyxbgr", "Z Y X B G R\n"),
])  # fmt: skip
@pytest.mark.parametrize(("suffix", "delimiter"), [("xyz", " "), ("txt", "\t"), ("csv", ","), ("asc", ";"), ("csv", ", ")])
def test_text_columns_are_recognised(tmp_path, names, head, suffix, delimiter):
    points = some()
    points.intensity[0] = 60_000  # larger than colours
    normals = np.random.default_rng(0).normal(size=(400, 3))
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    parts = dict(zip("xyz", points.xyz.T)) | dict(zip("rgb", points.rgb.T))
    parts |= {"i": points.intensity, "c": points.classes, "n": normals.round(6)}
    title = head if head.startswith("# ") else head.replace(" ", delimiter)
    path = tmp_path / f"a.{suffix}"
    path.write_text(title + text_rows([parts[name] for name in names], delimiter))
    got = gather(path)
    if "r" in names:
        same(got, points, classes="c" in names, intensity="i" in names)
    else:
        np.testing.assert_array_equal(got[1], points.xyz)
        assert got[2] is None
    assert (got[3] is None) == ("i" not in names) and got[0].format == suffix.upper()


def test_text_columns_that_are_not_recognised_are_asked_for(tmp_path, capsys):
    points = some()
    path = tmp_path / "a.txt"
    # Four columns alike, the first or last three of which may be a colour.
    path.write_text(text_rows([points.xyz, np.random.default_rng(1).integers(0, 256, (len(points.xyz), 4))]))
    assert main(["info", "--no-cache", str(path)]) == 2
    said = capsys.readouterr().err
    assert "may be columns 4 to 6 or 5 to 7" in said and "--columns x,y,z,i,r,g,b,-" in said and said.count("\n") == 1
    path.write_text(text_rows([points.xyz, points.rgb, points.classes]))
    assert main(["info", "--no-cache", "--columns", "x,y,z,r,g,b,c", str(path)]) == 0
    same(gather(path, "x,y,z,r,g,b,c"), points, intensity=False)
    for wrong, why in (("x,y,z,q", "'q' is none of"), ("x,y,z,x,r,g,b", "x stands there twice"), ("x,y,i", "z are needed"),
                       ("x,y,z,r,g", "all or none"), ("x,y,z", "names 3 columns, but a row has 7")):  # fmt: skip
        assert main(["info", "--no-cache", f"--columns={wrong}", str(path)]) == 2
        assert why in capsys.readouterr().err
    las = write_las(tmp_path / "a.las", points.xyz, points.rgb)
    assert main(["info", "--no-cache", "--columns", "x,y,z", str(las)]) == 2
    assert "--columns is for text files" in capsys.readouterr().err


def test_named_columns_are_part_of_the_cache_key(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    points = some(origin=(0, 0, 0))
    path = tmp_path / "a.xyz"
    path.write_text(text_rows([points.xyz]))
    plain, turned = open_scene(path), open_scene(path, columns="z,y,x")
    np.testing.assert_array_equal(plain.bounds, turned.bounds[:, ::-1])
    assert open_scene(path).meta == plain.meta


@pytest.mark.parametrize("full", [1.0, 255.0, 65535.0])
def test_text_colours_are_read_by_their_range(tmp_path, full):
    points = some()
    points.rgb[0] = 255
    path = tmp_path / "a.csv"
    path.write_text("x,y,z,r,g,b\n" + text_rows([points.xyz, points.rgb / 255 * full], ","))
    same(gather(path), points, wide=full > 255, classes=False, intensity=False)


def test_text_numbers_are_rounded_as_python_rounds_them(tmp_path):
    random = np.random.default_rng(3)
    digits = [f"{m}" for m in random.integers(0, 2**63, 3000, dtype=np.uint64)]
    points = [f"{d[:k]}.{d[k:]}" for d, k in zip(digits, random.integers(0, 19, 3000))]
    powers = [f"{d[0]}.{d[1:k]}e{e}" for d, k, e in zip(digits, random.integers(2, 19, 3000), random.integers(-40, 40, 3000))]
    edges = ["9007199254740993", "-0.0", "1e22", "1e-22", "+.5", "5.", "0.1e1", "1234567890123456789012345", "1E5", "1e-400"]
    edges += ["179769313486231570000", "0.3", "2.2250738585072014e-308", "8000000.0000000001", "18446744073709551615e0"]
    for words in (digits, points, powers, edges):
        path = tmp_path / "a.xyz"
        path.write_text("".join(f"{w} 1 -{w.lstrip('+-')}\n" for w in words))
        _, xyz, *_ = gather(path, "x,y,z")
        np.testing.assert_array_equal(xyz[:, 0], [float(w) for w in words])
        np.testing.assert_array_equal(xyz[:, 2], [-float(w.lstrip("+-")) for w in words])


def test_text_with_other_line_ends_empty_fields_marks_and_names(tmp_path):
    path = tmp_path / "a.csv"
    path.write_bytes(b'\xef\xbb\xbf"x","y","z","name","intensity"\r\n1,2,3,wall 7,9\r\n\r\n# note\r\n'
                     b'4, 5 ,nan,,\r\n"7",8,9,x,11')  # fmt: skip
    _, xyz, _, level, _, _ = gather(path)
    np.testing.assert_array_equal(xyz, [[1, 2, 3], [4, 5, np.nan], [7, 8, 9]])
    assert level.tolist() == [9, 0, 11]


@pytest.mark.parametrize("block", [1 << 10, 1 << 24])
def test_the_size_of_blocks_of_text_does_not_change_the_result(tmp_path, monkeypatch, block):
    monkeypatch.setattr("pointglass.viewer.readers.text.text_rows.TextRows.__init__.__defaults__", (0, block))
    monkeypatch.setattr("pointglass.viewer.readers.text.xyz.ROWS", 57)
    points = some()
    path = tmp_path / "a.xyz"
    path.write_text(text_rows([points.xyz, points.rgb]).rstrip("\n"))  # the last line has no end
    same(gather(path), points, classes=False, intensity=False)


@pytest.mark.parametrize("form", ["xyz", "xyzi", "xyzrgb", "xyzirgb"])
def test_pts(tmp_path, form):
    points = some()
    points.intensity //= 300  # as small as colours: the format determines the columns
    columns = [points.xyz, *([points.intensity] if "i" in form else []), *([points.rgb] if "r" in form else [])]
    path = tmp_path / "a.pts"
    path.write_text("400\n" + text_rows(columns))
    got = gather(path)
    if "r" in form:
        same(got, points, classes=False, intensity="i" in form)
    np.testing.assert_array_equal(got[1], points.xyz)
    assert got[0].count == 400 and got[0].warnings == []


def test_pts_of_several_parts_and_signed_intensity(tmp_path):
    points = some()
    levels = np.linspace(-2048, 2047, 400).astype(int)
    rows = text_rows([points.xyz, levels, points.rgb]).splitlines(True)
    path = tmp_path / "a.pts"
    path.write_text("100\n" + "".join(rows[:100]) + "300 \n" + "".join(rows[100:]) + "\n")
    got = gather(path)
    same(got, points, classes=False, intensity=False)
    assert [scan.name for scan in got[0].scans] == ["a 1", "a 2"] and np.bincount(got[5]).tolist() == [100, 300]
    assert (got[3].min(), got[3].max()) == (0, 65535)


@pytest.mark.parametrize("colour", [True, False])
def test_ptx_scans_are_placed_by_their_poses(tmp_path, colour):
    points = some(origin=(1.0, 1.0, 1.0))
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])  # x -> y
    scans = [PtxScan(points), PtxScan(points, turn, FAR, empty=30)]
    got = gather(write_ptx(tmp_path / "a.ptx", scans, colour=colour))
    assert [scan.position for scan in got[0].scans] == [(0, 0, 0), FAR] and got[0].count == 830
    np.testing.assert_array_equal(got[1][got[5] == 0], points.xyz)
    np.testing.assert_allclose(got[1][got[5] == 1], points.xyz @ turn.T + FAR, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(got[3], np.tile(points.intensity, 2))
    if colour:
        np.testing.assert_array_equal(got[2], np.tile(points.rgb, (2, 1)))
    assert sum(chunk.invalid for chunk in got[0].chunks()) == 30
    scene = open_scene(tmp_path / "a.ptx", cache=False)
    assert [scan.position for scan in scene.meta.scans] == [(0, 0, 0), tuple(FAR)] and scene.meta.units == "metre"


def test_ptx_points_are_not_moved_by_an_invalid_pose(tmp_path):
    points = some()
    got = gather(write_ptx(tmp_path / "a.ptx", [PtxScan(points, np.eye(3) * 2)]))
    same(got, points, classes=False)
    assert "pose of 'a 1' is not usable" in got[0].warnings[0] and got[0].scans[0].position is None


@pytest.mark.parametrize(("version", "form"), [
    ("1.3", "bin"), ("1.4", "bin"), ("1.7", "bin"), ("1.8", "bin"), ("1.7", "las"), ("1.7", "laz"),
])  # fmt: skip
def test_potree_1(tmp_path, version, form):
    points = some(2000 if form == "bin" else 60)
    folder = write_potree1(tmp_path / "house", points, version=version, form=form)
    got = gather(folder)
    same(got, points, wide=form != "bin", classes=form == "bin")
    assert got[0].scans[0].name == "house" and got[0].units == "metre"
    assert open_scene(folder / "cloud.js", cache=False).count == len(points.xyz)


@pytest.mark.parametrize("encoding", ["DEFAULT", "BROTLI"])
def test_potree_2(tmp_path, encoding):
    points = some(2000)
    folder = write_potree2(tmp_path / "house", points, encoding=encoding)
    same(gather(folder), points, wide=True)
    assert open_scene(folder / "metadata.json", cache=False).count == 2000


def test_potree_2_with_coordinates_left_of_its_offset(tmp_path):
    """The interleaved bits of a negative int32 are all used."""
    points = some(500)
    same(gather(write_potree2(tmp_path / "a", points, encoding="BROTLI", right=100.0)), points, wide=True)


@pytest.mark.parametrize(("data", "hierarchy", "real"), [
    ("laszip", "json", False), ("binary", "json", False), ("binary", "gzip", True), ("zstandard", "gzip", False),
])  # fmt: skip
def test_ept(tmp_path, data, hierarchy, real):
    points = some(60 if data == "laszip" else 2000)
    folder = write_ept(tmp_path / "house", points, data=data, hierarchy=hierarchy, real=real)
    got = gather(folder)
    same(got, points, wide=True)
    assert got[0].crs == "EPSG:25832" and got[0].count == len(points.xyz)


def test_folders_are_opened_described_and_converted(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    scans = tmp_path / "scans"
    write_potree2(scans / "north", some(500))
    write_ept(scans / "south", some(600), data="binary")
    write_pcd(scans / "west.pcd", some(100), "binary")
    (scans / "prices.csv").write_text("a table,of,no points\n")
    assert main(["info", str(scans / "north")]) == 0
    assert "Potree 2" in capsys.readouterr().out
    assert main(["convert", "--each", "--out", str(tmp_path / "out"), str(scans)]) == 0
    assert [open_scene(tmp_path / "out" / name).count for name in ("north", "south", "west")] == [500, 600, 100]
    assert entry_of(scans) == scans
    assert main(["info", str(scans)]) == 0
    assert "points   1,200" in capsys.readouterr().out


def test_help_and_messages_name_every_format(tmp_path, capsys):
    names = {name for row in FORMATS for name in row.names}
    with pytest.raises(SystemExit):
        main(["info", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert all(name in text for name in names)
    (tmp_path / "a.bin").write_bytes(b"\1\2\3")
    assert main(["info", str(tmp_path / "a.bin")]) == 2
    said = capsys.readouterr().err
    assert all(name in said for name in names)


@pytest.mark.parametrize("point_format", range(11))
def test_las_point_formats_keep_class_and_intensity(tmp_path, point_format):
    import laspy

    points = some()
    header = laspy.LasHeader(point_format=point_format, version="1.4")
    header.scales, header.offsets = np.full(3, 1 / 4096), np.floor(points.xyz.min(axis=0))
    las = laspy.LasData(header)
    las.x, las.y, las.z = points.xyz.T
    las.intensity, las.classification = points.intensity, points.classes
    if "red" in header.point_format.dimension_names:
        las.red, las.green, las.blue = points.rgb.T.astype(np.uint16) * 257
    las.write(str(path := tmp_path / "a.las"))
    got = gather(path)
    np.testing.assert_array_equal(got[1], points.xyz)
    np.testing.assert_array_equal(got[3], points.intensity)
    np.testing.assert_array_equal(got[4], points.classes)
    if got[2] is not None:
        np.testing.assert_array_equal(got[2], points.rgb.astype(np.uint16) * 257)
    assert (got[2] is not None) == (point_format in (2, 3, 5, 7, 8, 10))


@pytest.mark.parametrize("minor", range(5))
def test_las_versions(tmp_path, minor):
    points = some()
    wide = points.rgb.astype(np.uint16) * 257
    path = write_las(tmp_path / "a.las", points.xyz, wide, points.intensity, classes=points.classes)
    data = bytearray(path.read_bytes())
    if minor < 4:
        data[25] = minor  # 1.0 to 1.3 have the same first 227 bytes
        path.write_bytes(data)
    else:
        import laspy

        laspy.convert(laspy.read(path), file_version="1.4", point_format_id=7).write(str(path))
    same(gather(path), points, wide=True)


def test_las_reference_systems_in_records_behind_the_points(tmp_path):
    import laspy

    wkt = 'PROJCS["zone 32",GEOGCS["E",UNIT["degree",0.0174]],UNIT["metre",1]]'
    header = laspy.LasHeader(point_format=6, version="1.4")
    las = laspy.LasData(header)
    las.x, las.y, las.z = surface(100)[0].T
    las.evlrs = laspy.vlrs.vlrlist.VLRList([laspy.VLR("LASF_Projection", 2112, "", wkt.encode() + b"\0")])
    for suffix in ("las", "laz"):
        las.write(str(path := tmp_path / f"a.{suffix}"))
        source = open_source(path)
        assert (source.crs, source.units) == ("zone 32", "metre")


@pytest.mark.parametrize("kind", ["scaled", "float", "double"])
@pytest.mark.parametrize("spherical", [False, True])
def test_e57_coordinates_of_every_kind_and_fields_beside_them(tmp_path, kind, spherical):
    points = some(origin=(1.0, 1.0, 1.0))
    no_colour, no_level = np.arange(400) % 5 == 0, np.arange(400) % 7 == 0
    beside = {name: np.arange(400) for name in ("rowIndex", "columnIndex", "timeStamp", "returnIndex")}
    beside |= {"isColorInvalid": no_colour, "isIntensityInvalid": no_level}
    scan = E57Scan(points.xyz, points.rgb, points.intensity / 65535.0, translation=FAR, spherical=spherical, kind=kind,
                   beside=beside)  # fmt: skip
    got = gather(write_e57(tmp_path / "a.e57", [scan]))
    atol = {"scaled": 1e-4, "float": 1e-5, "double": 1e-8}[kind]
    np.testing.assert_allclose(got[1], points.xyz + FAR, rtol=0, atol=atol)
    np.testing.assert_array_equal(got[2], np.where(no_colour[:, None], 0, points.rgb))
    np.testing.assert_allclose(got[3], np.where(no_level, 0, points.intensity), atol=1)


@pytest.mark.parametrize("kind", ["uchar", "float", "int"])
def test_ply_classes(tmp_path, kind):
    points = some(50)
    table = np.zeros(50, [("xyz", "<f8", 3), ("class", {"uchar": "u1", "float": "<f4", "int": "<i4"}[kind])])
    table["xyz"], table["class"] = points.xyz, points.classes
    head = "".join(f"property double {axis}\n" for axis in "xyz") + f"property {kind} scalar_Classification\n"
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex 50\n{head}end_header\n"
    (tmp_path / "a.ply").write_bytes(head.encode() + table.tobytes())
    _, xyz, _, _, classes, _ = gather(tmp_path / "a.ply")
    np.testing.assert_array_equal(xyz, points.xyz)
    np.testing.assert_array_equal(classes, points.classes)


def test_readers_know_no_grid():
    """Neither torch nor the libraries of formats are imported before a file needs them."""
    code = """
import importlib, pkgutil, sys, pointglass.viewer.readers as readers
names = [found.name for found in pkgutil.walk_packages(readers.__path__, "pointglass.viewer.readers.")]
assert len(names) > 40
for name in names:
    importlib.import_module(name)
heavy = ("pointglass.viewer.grid", "pointglass.viewer.render", "torch", "open3d", "laspy", "pye57", "brotli")
print([name for name in heavy if name in sys.modules])
"""
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


def test_the_table_of_formats_imports_nothing_heavy():
    code = "import sys, pointglass.viewer.readers.formats; print('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "False\n"
