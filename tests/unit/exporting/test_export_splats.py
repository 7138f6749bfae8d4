"""Splats by the command line, read by other libraries: of the points in sight, with the way back to the scan's coordinates."""

import gzip
import json
import struct
from typing import Any

import numpy as np
import pytest
from command_line import run_here

from pointglass.viewer.commands.exporting.command import export
from pointglass.viewer.commands.exporting.formats.splat_spz import fraction_bits, packed_quaternions
from pointglass.viewer.commands.exporting.splat_export import SPLATS, Placed
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene, scene_from_arrays
from pointglass.viewer.picture.edits import NO_EDITS
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import write_project
from pointglass.viewer.work.selection import Selection, clips_of
from pointglass.viewer.work.splats.make_splats import splats_of_points
from pointglass.viewer.work.splats.splat_cloud import SH0, matrices_of

FILES = ("room.glb", "room.spz", "splats.ply")


@pytest.fixture(scope="module")
def scan(tmp_path_factory):
    """A floor at map coordinates, z up, red where x is large, and green elsewhere: a LAS file with metres."""
    import laspy
    import pyproj

    rng = np.random.default_rng(5)
    file = tmp_path_factory.mktemp("splats") / "floor.las"
    las = laspy.LasData(laspy.LasHeader(point_format=7))
    las.header.offsets, las.header.scales = np.array([500_000.0, 5_000_000.0, 0.0]), np.full(3, 0.001)
    own = pyproj.CRS.from_epsg(25832).to_wkt("WKT1_GDAL").replace("ETRS89 / UTM zone 32N", "Plant grid in UTM zone 32N")
    las.header.add_crs(pyproj.CRS.from_wkt(own))  # its name alone does not define it
    las.x, las.y = rng.random((2, 20_000)) * [[8], [4]] + [[500_000], [5_000_000]]
    las.z = 30 + rng.normal(0, 0.001, 20_000)
    red = las.x > 500_004
    las.red, las.green, las.blue = np.where(red, 60_000, 10_000), np.where(red, 10_000, 50_000), np.full(20_000, 20_000)
    las.write(file)
    return file


def read(file) -> Any:
    """xyz in the scan's coordinates where the file leads there, else in its own; normals there; rgb 0..1; opacity; standard
    deviations; points; by a library that is not ours."""
    if file.suffix == ".glb":
        pygltflib = pytest.importorskip("pygltflib")
        glb = pygltflib.GLTF2().load(str(file))
        primitive = glb.meshes[0].primitives[0]
        named = vars(primitive.attributes)
        assert primitive.mode == pygltflib.POINTS and glb.extensionsUsed == ["KHR_gaussian_splatting"]
        assert primitive.extensions["KHR_gaussian_splatting"]["colorSpace"] == "srgb_rec709_display"
        blob, found = glb.binary_blob(), {}
        for name, number in named.items():
            if number is None:
                continue
            accessor = glb.accessors[number]
            view = glb.bufferViews[accessor.bufferView]
            width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor.type]
            kind = {pygltflib.FLOAT: np.float32, pygltflib.UNSIGNED_BYTE: np.uint8}[accessor.componentType]
            found[name] = np.frombuffer(blob, kind, accessor.count * width, view.byteOffset).reshape(-1, width)
        place, prefix = np.array(glb.asset.extras["to_scan"]), "KHR_gaussian_splatting:"
        assert np.allclose(glb.accessors[named["POSITION"]].min, found["POSITION"].min(axis=0))
        own, turns = found["POSITION"].astype(float), matrices_of(found[prefix + "ROTATION"][:, [3, 0, 1, 2]])
        rgb = 0.5 + SH0 * found[prefix + "SH_DEGREE_0_COEF_0"]
        linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
        assert np.abs(found["COLOR_0"][:, :3] / 255 - linear).max() < 0.003  # glTF's vertex colours are linear
        return (own, place, turns, rgb, found[prefix + "OPACITY"][:, 0], found[prefix + "SCALE"], found["_POINTS"][:, 0])
    gsply = pytest.importorskip("gsply")
    place, points = None, None
    data = gsply.read_spz(file) if file.suffix == ".spz" else gsply.plyread(file)
    if file.suffix == ".ply":
        from plyfile import PlyData

        ply = PlyData.read(file)
        place = np.array(next(c for c in ply.comments if c.startswith("frame ")).split()[1:], float).reshape(3, 4)
        points = ply["provenance"]["points"]
        assert ply["vertex"].data.dtype.itemsize == 17 * 4
    return (np.asarray(data.means, float), place, matrices_of(data.quats), 0.5 + SH0 * np.asarray(data.sh0),
            1 / (1 + np.exp(-np.asarray(data.opacities, float))), np.exp(np.asarray(data.scales, float)), points)


@pytest.mark.parametrize("name", FILES)
def test_a_file_is_read_by_other_libraries_and_lies_on_the_scan(tmp_path, scan, name):
    out = tmp_path / name
    done = run_here("export", scan, "--out", out, "--budget", "5k")
    assert done.returncode == 0, done.stderr
    own, place, turns, rgb, opacity, scale, points = read(out)
    assert 2500 < len(own) <= 5000 and done.stdout == f"{len(own):,} splats in {out}\n"
    up = turns[:, :, 2] @ (np.array([0, -1.0, 0]) if name == "splats.ply" else np.array([0, 1.0, 0]))
    assert np.quantile(np.abs(up), 0.1) > 0.95  # the floor is level in the frame that viewers expect
    if place is not None:
        assert points.sum() == 20_000
        xyz = own @ place[:, :3].T + place[:, 3]
        assert (xyz.min(axis=0) >= [499_999.99, 4_999_999.99, 29.98]).all()
        assert (xyz.max(axis=0) <= [500_008, 5_000_004, 30.02]).all()
        across = turns.transpose(0, 2, 1) @ place[:, :3].T
        assert np.quantile(np.abs(across[:, 2, 2]), 0.1) > 0.95
        red = xyz[:, 0] > 500_004
    else:
        red = own[:, 0] > 0
        assert "has no place for the origin 500004, 5000002, 30, the scan's axes, unit and reference" in done.stderr
    source = open_source(out)  # comes back to where the scan is
    back = np.concatenate([chunk.xyz for chunk in source.chunks()])
    assert (source.units, source.metres_per_unit) == ("metre", 1.0) and source.crs == "Plant grid in UTM zone 32N"
    assert "25832" in (source.crs_text or "")
    assert np.abs(back.min(axis=0) - [500_000, 5_000_000, 30]).max() < 0.3
    assert np.abs(back.max(axis=0) - [500_008, 5_000_004, 30]).max() < 0.3
    clear = np.abs(own[:, 0]) > 0.2
    assert np.abs(rgb[red & clear].mean(axis=0) * 255 - [234, 39, 78]).max() < 6
    assert np.abs(rgb[~red & clear].mean(axis=0) * 255 - [39, 195, 78]).max() < 6
    assert opacity.min() > 0.5 and opacity.max() < 1
    assert scale.max() < 0.5 and np.median(scale[:, 2] / scale[:, 0]) < 0.3


def test_a_project_s_splats_are_of_what_is_in_sight_and_nothing_is_left_of_a_failure(tmp_path, scan):
    pytest.importorskip("gsply")
    document = Document(clips=clips_of(["500000,5000000,0,500003,5000004,99"]), scans=(ScanFile(str(scan)),))
    write_project(tmp_path / "part.pointglass", document)
    out = tmp_path / "part.ply"
    done = run_here("export", tmp_path / "part.pointglass", "--out", out, "--splats", "--budget", "1k")
    assert done.returncode == 0, done.stderr
    own, place, _, rgb, *_, points = read(out)
    x = (own @ place[:, :3].T + place[:, 3])[:, 0]
    assert x.max() <= 500_003.01 and (rgb[:, 1] > rgb[:, 0]).all() and 6000 < points.sum() < 9000
    before = sorted(tmp_path.iterdir())
    for arguments, said in (
        (("--out", tmp_path / "a.glb", "--budget", "lots"), "--budget 'lots': expected a number of splats"),
        (("--out", tmp_path / "a.laz", "--budget", "1M"), "splats are written as .glb, .spz, splats.ply"),
        (("--out", tmp_path / "a.ply", "--budget", "1M"), "choose such a name, or add --splats, or leave out --budget"),
        (("--out", tmp_path / "a.glb", "--reproject", "auto"), "splats are neither reprojected"),
        (("--out", tmp_path / "a.spz", "--clip", "0,0,0,1,1,1"), "leave no point"),
    ):
        failed = run_here("export", scan, *arguments)
        assert failed.returncode == 2 and said in failed.stderr and len(failed.stderr.strip().splitlines()) == 1, failed.stderr
    assert sorted(tmp_path.iterdir()) == before


def test_units_are_metres_and_up_is_the_document_s(tmp_path, scan):
    pytest.importorskip("pygltflib")
    from dataclasses import replace

    scene = open_scene(scan, cache=False)
    feet = replace(scene, meta=replace(scene.meta, units="feet", metres_per_unit=0.3048))
    export(Selection.in_sight(feet, NO_EDITS), tmp_path / "a.glb", budget=2000, up=(1.0, 0.0, 0.0))
    own, place, *_ = read(tmp_path / "a.glb")
    assert np.allclose(np.linalg.norm(place[:, 0]), 1 / 0.3048) and np.isclose(np.linalg.det(place[:, :3]), 0.3048**-3)
    xyz = own @ place[:, :3].T + place[:, 3]
    assert abs(np.median(xyz[:, 2]) - 30) < 0.01 and np.allclose(np.ptp(own[:, 1]), np.ptp(xyz[:, 0]) * 0.3048)
    nameless = replace(feet, meta=replace(feet.meta, crs=None))
    export(Selection.in_sight(nameless, NO_EDITS), tmp_path / "splats.ply", budget=2000, up=(0.0, 0.0, 1.0))
    again = open_scene(tmp_path / "splats.ply", cache=False)
    assert again.meta.metres_per_unit == 0.3048 and again.meta.units == "feet"
    assert np.abs(again.bounds - scene.bounds).max() < 0.1
    data = (tmp_path / "splats.ply").read_bytes()
    assert b"comment crs unknown\n" in data and again.meta.crs is None
    (tmp_path / "named.ply").write_bytes(data.replace(b"comment crs unknown\n", b"comment crs Site 7\n"))
    assert (named := open_source(tmp_path / "named.ply")).crs == "Site 7" and named.units == "feet"


def test_degrees_are_refused_with_the_remedy(tmp_path):
    from dataclasses import replace

    scene = scene_from_arrays(np.random.default_rng(0).random((500, 3)), np.full((500, 3), 99, np.uint8))
    degrees = replace(scene, meta=replace(scene.meta, units="degree"))
    with pytest.raises(InputError, match=r"these are degrees.*--reproject auto"):
        export(Selection.in_sight(degrees, NO_EDITS), tmp_path / "a.glb")
    assert not list(tmp_path.iterdir())


def test_quaternions_of_spz_come_back_and_coordinates_have_the_bits_that_fit(tmp_path, seed):
    gsply = pytest.importorskip("gsply")
    rng = np.random.default_rng(seed)
    q = rng.normal(size=(500, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    count = len(q)
    head = struct.pack("<IIIBBBB", 0x5053474E, 3, count, 0, 12, 0, 0)
    body = bytes(9 * count) + bytes([128]) * count + bytes(3 * count) + bytes(3 * count) + packed_quaternions(q).tobytes()
    (tmp_path / "a.spz").write_bytes(gzip.compress(head + body))
    back = np.asarray(gsply.read_spz(tmp_path / "a.spz").quats, float)
    assert np.abs(np.abs((back * q).sum(axis=1)) - 1).max() < 1e-5
    for reach in rng.uniform(0.1, 8e6, 50):
        bits = fraction_bits(reach)
        assert reach * 2**bits < 2**23 and (bits == 20 or (reach + 1) * 2 ** (bits + 1) >= 2**23)
    with pytest.raises(InputError, match="SPZ holds 8,388,608"):
        fraction_bits(1e7)


def test_a_glb_begins_as_the_format_says(tmp_path):
    scene = scene_from_arrays(np.random.default_rng(0).random((900, 3)), np.full((900, 3), 99, np.uint8))
    export(Selection.in_sight(scene, NO_EDITS), tmp_path / "a.glb")
    data = (tmp_path / "a.glb").read_bytes()
    magic, version, total, length, kind = struct.unpack("<4sIII4s", data[:20])
    assert (magic, version, total, kind) == (b"glTF", 2, len(data), b"JSON") and length % 4 == 0
    document = json.loads(data[20 : 20 + length])
    assert all(view["byteOffset"] % 4 == 0 for view in document["bufferViews"])
    assert struct.unpack("<I4s", data[20 + length : 28 + length]) == (document["buffers"][0]["byteLength"], b"BIN\0")
    assert len(data) == 28 + length + document["buffers"][0]["byteLength"]


@pytest.mark.parametrize("name", FILES)
def test_the_change_of_colours_by_direction_is_read_by_other_libraries(tmp_path, seed, name):
    """A scan of two stations, one of which saw everything redder: from the side of either a splat has its colours."""
    gsply = pytest.importorskip("gsply")
    rng = np.random.default_rng(seed)
    flat, station = rng.random((12_000, 2)) * 4, rng.integers(0, 2, 12_000)
    xyz = np.c_[flat, rng.normal(0, 0.001, 12_000)]
    rgb = np.where(station[:, None] == 1, [190, 120, 120], [130, 120, 120]).astype(np.uint8)
    places = np.array([[0.0, 2, 1.5], [4, 2, 1.5]])
    splats = splats_of_points(xyz, np.c_[rgb, np.ones(len(xyz), np.uint8)], 2000, places, station=station)
    target = SPLATS[name if name == "splats.ply" else f".{name.partition('.')[2]}"]
    target.write(tmp_path / name, splats.turned(target.axes), Placed(np.eye(3, 4), {}), lambda _: None)
    if name == "room.glb":
        pygltflib = pytest.importorskip("pygltflib")
        glb = pygltflib.GLTF2().load(str(tmp_path / name))
        prefix, attributes = "KHR_gaussian_splatting:SH_DEGREE_", vars(glb.meshes[0].primitives[0].attributes)
        columns = [np.frombuffer(glb.binary_blob(), np.float32, 3 * len(splats), glb.bufferViews[
            glb.accessors[attributes[f"{prefix}{end}"]].bufferView].byteOffset).reshape(-1, 3)
            for end in ("0_COEF_0", "1_COEF_0", "1_COEF_1", "1_COEF_2")]  # fmt: skip
        sh0, sh1 = columns[0], np.stack(columns[1:], axis=1)
    else:
        data = (gsply.read_spz if name == "room.spz" else gsply.plyread)(tmp_path / name)
        sh0, sh1 = np.asarray(data.sh0), np.asarray(data.shN).reshape(len(splats), 3, 3)
    for place, red in zip(places, (130, 190)):
        way = (splats.xyz + splats.origin - place) @ target.axes.T
        x, y, z = (way / np.linalg.norm(way, axis=1, keepdims=True)).T
        harmonics = 0.4886025119029199 * np.stack([-y, z, -x], axis=1)  # of the extension and of the published renderer
        seen = 0.5 + SH0 * sh0 + np.einsum("no,nok->nk", harmonics, sh1)
        middle = (np.abs(splats.xyz + splats.origin - [2, 2, 0]) < [1, 1, 1]).all(axis=1)
        assert np.abs(seen[middle].mean(axis=0) * 255 - [red, 120, 120]).max() < 16  # between both without: 30
        assert np.abs(seen - splats.seen(place - splats.origin)).max() < 0.04


GLTF_FLOAT, GLTF_BYTE = 5126, 5121
KERNEL = {  # attribute -> (accessor type, component type): "Attributes" of the ellipse kernel; COLOR_0: "Fallback Behavior"
    "POSITION": ("VEC3", GLTF_FLOAT), "KHR_gaussian_splatting:ROTATION": ("VEC4", GLTF_FLOAT),
    "KHR_gaussian_splatting:SCALE": ("VEC3", GLTF_FLOAT), "KHR_gaussian_splatting:OPACITY": ("SCALAR", GLTF_FLOAT),
    "KHR_gaussian_splatting:SH_DEGREE_0_COEF_0": ("VEC3", GLTF_FLOAT), "COLOR_0": ("VEC4", GLTF_BYTE),
}  # fmt: skip


def test_a_glb_keeps_each_clause_of_khr_gaussian_splatting(tmp_path, seed):
    """Release candidate of 2026 (KhronosGroup/glTF, extensions/2.0/Khronos/KHR_gaussian_splatting), in its order."""
    rng = np.random.default_rng(seed)
    xyz = np.concatenate([np.c_[rng.random((4000, 2)) * 5, rng.normal(0, 0.002, 4000)], rng.random((60, 3)) * 5])
    scan = scene_from_arrays(xyz, rng.integers(0, 256, (len(xyz), 3)).astype(np.uint8))
    count = export(Selection.in_sight(scan, NO_EDITS), tmp_path / "a.glb", budget=3000)
    data = (tmp_path / "a.glb").read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    document, blob = json.loads(data[20 : 20 + length]), data[28 + length :]
    primitive = document["meshes"][0]["primitives"][0]
    # "kernel" and "colorSpace" are required; values outside the tables need a further extension
    assert document["extensionsUsed"] == ["KHR_gaussian_splatting"] and "extensionsRequired" not in document
    assert primitive["extensions"] == {"KHR_gaussian_splatting": {
        "kernel": "ellipse", "colorSpace": "srgb_rec709_display", "projection": "perspective",
        "sortingMethod": "cameraDistance"}}  # fmt: skip
    assert primitive["mode"] == 0  # "The mode property of the mesh primitive MUST be POINTS (0)"
    assert not {"matrix", "scale", "rotation"} & set(document["nodes"][0])  # decomposable: none
    found = {}
    for name, number in primitive["attributes"].items():
        accessor = document["accessors"][number]
        if name in KERNEL:
            assert (accessor["type"], accessor["componentType"]) == KERNEL[name] and accessor["count"] == count
        else:
            assert name.startswith("_")  # glTF: attributes of an application begin so
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        kind = np.uint8 if accessor["componentType"] == GLTF_BYTE else np.float32
        found[name] = np.frombuffer(blob, kind, count * width, document["bufferViews"][accessor["bufferView"]]["byteOffset"])
        found[name] = found[name].reshape(count, width)
    assert set(KERNEL) <= set(found) and document["accessors"][primitive["attributes"]["COLOR_0"]]["normalized"]
    scale, opacity = found["KHR_gaussian_splatting:SCALE"], found["KHR_gaussian_splatting:OPACITY"]
    # "Scale values are linear and MUST NOT be negative": on a plane of 25 square units splats are 0.01 to 2 units wide
    assert (scale > 0).all() and 0.01 < np.median(scale[:, 0]) < 0.2
    # "unit quaternions in the usual glTF order" x, y, z, w: the third axis of most is across the plane, which is y here
    rotation = found["KHR_gaussian_splatting:ROTATION"]
    assert np.abs(np.linalg.norm(rotation.astype(float), axis=1) - 1).max() < 1e-5
    x, y, z, w = rotation.astype(float).T
    assert np.quantile(np.abs(2 * (y * z - w * x)), 0.2) > 0.9
    assert opacity.min() >= 0 and opacity.max() <= 1  # "Out-of-range values are invalid"
    # "either all coefficients for a given degree and all lower degrees MUST be defined or none"
    degrees = [int(name.split("_")[-3]) for name in found if "SH_DEGREE" in name]
    assert all(degrees.count(degree) == 2 * degree + 1 for degree in range(max(degrees) + 1))
    # the fallback: coefficients times 0.282095 plus 0.5, clamped, decoded from sRGB; alpha SHOULD be the opacity
    srgb = np.clip(0.282095 * found["KHR_gaussian_splatting:SH_DEGREE_0_COEF_0"].astype(float) + 0.5, 0, 1)
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    assert np.abs(found["COLOR_0"] / 255 - np.c_[linear, opacity]).max() <= 0.5 / 255 + 1e-4
