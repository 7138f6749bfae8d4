"""LAS, PLY and E57 return the points that were written: coordinates, colours, poses, units.  test_formats has the others."""

import numpy as np
import pytest
from cloud_files import E57Scan, surface, write_e57, write_las, write_ply

from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.readers.crs import from_geokeys, from_wkt
from pointglass.viewer.readers.formats import open_source

ORDERS = ("ascii", "binary_little_endian", "binary_big_endian")


def gather(path):
    """All points of a file as its reader yields them: xyz, rgb, intensity, scan numbers, invalid count."""
    chunks = list(open_source(path).chunks())
    joined = [None if getattr(chunks[0], n) is None else np.concatenate([getattr(c, n) for c in chunks])
              for n in ("xyz", "rgb", "intensity")]  # fmt: skip
    return *joined, np.concatenate([np.full(len(c.xyz), c.scan) for c in chunks]), sum(c.invalid for c in chunks)


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_las_coordinates_are_read_bit_for_bit(tmp_path, suffix):
    xyz, rgb = surface(5000, origin=(4_500_000.0, 300_000.0, -20.0))
    intensity = np.arange(5000, dtype=np.uint16)
    path = write_las(tmp_path / f"a.{suffix}", xyz, rgb.astype(np.uint16) << 8, intensity)
    got = gather(path)
    np.testing.assert_array_equal(got[0], xyz)
    np.testing.assert_array_equal(got[1] >> 8, rgb)
    np.testing.assert_array_equal(got[2], intensity)
    assert open_source(path).format == suffix.upper()


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("form", [{}, {"extra": True}, {"faces_first": True}, {"vertex_list": True}])
def test_ply_points_are_read_beside_other_elements_and_properties(tmp_path, order, form):
    xyz, rgb = surface(500)
    got = gather(write_ply(tmp_path / "a.ply", xyz, rgb, order=order, **form))
    np.testing.assert_array_equal(got[0], xyz)
    np.testing.assert_array_equal(got[1], rgb)


@pytest.mark.parametrize("names", [("r", "g", "b"), ("diffuse_red", "diffuse_green", "diffuse_blue")])
def test_ply_colours_are_read_under_their_other_names(tmp_path, names):
    xyz, rgb = surface(50)
    np.testing.assert_array_equal(gather(write_ply(tmp_path / "a.ply", xyz, rgb, names=names))[1], rgb)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("scale", [1.0, 255.0, 65535.0])
def test_ply_float_colours_are_read_by_their_range(tmp_path, order, scale):
    xyz, rgb = surface(300)
    rgb[0] = 255
    path = write_ply(tmp_path / "a.ply", xyz, rgb / 255 * scale, colour="float", kind="float", order=order)
    got = gather(path)
    np.testing.assert_array_equal(got[1], rgb)
    np.testing.assert_array_equal(got[0], xyz)  # multiples of 1/4096 fit float32


def test_ply_with_windows_line_ends(tmp_path):
    xyz, rgb = surface(50)
    got = gather(write_ply(tmp_path / "a.ply", xyz, rgb, order="ascii", newline="\r\n"))
    np.testing.assert_array_equal(got[0], xyz)


def test_e57_scans_are_placed_by_their_poses(tmp_path):
    xyz, rgb = surface(400, origin=(1.0, 1.0, 1.0))
    half = np.sqrt(0.5)  # a quarter turn about z: x -> y, y -> -x
    scans = [
        E57Scan(xyz, rgb, name="north"),
        E57Scan(xyz[:0], rgb[:0], name="nothing"),
        E57Scan(xyz, rgb, quaternion=(half, 0, 0, half), translation=(10, 20, 30), name="south"),
        E57Scan(xyz, rgb, quaternion=(2.0, 0, 0, 2.0), translation=(10, 20, 30), spherical=True),
    ]
    path = write_e57(tmp_path / "a.e57", scans)
    source = open_source(path)
    assert [scan.name for scan in source.scans] == ["north", "nothing", "south", "scan 4"]
    assert [scan.position for scan in source.scans] == [None, None, (10, 20, 30), (10, 20, 30)]
    got, colours, _, number, _ = gather(path)
    turned = np.column_stack([-xyz[:, 1], xyz[:, 0], xyz[:, 2]]) + [10, 20, 30]
    np.testing.assert_array_equal(got[number == 0], xyz)
    np.testing.assert_allclose(got[number == 2], turned, atol=1e-12)
    np.testing.assert_allclose(got[number == 3], turned, atol=1e-12)
    np.testing.assert_array_equal(colours[number == 3], rgb)


@pytest.mark.parametrize("spherical", [False, True])
def test_e57_points_marked_invalid_are_left_out_and_counted(tmp_path, spherical):
    xyz, rgb = surface(300, origin=(1, 1, 1))
    state = np.arange(300) % 3
    path = write_e57(tmp_path / "a.e57", [E57Scan(xyz, rgb, invalid=state, spherical=spherical)])
    got = gather(path)
    np.testing.assert_allclose(got[0], xyz[state == 0], atol=1e-12)
    np.testing.assert_array_equal(got[1], rgb[state == 0])
    assert got[4] == 200
    assert open_scene(path, cache=False).meta.dropped.invalid == 200


def test_e57_colour_of_16_bits_and_intensity_without_limits(tmp_path):
    xyz, rgb = surface(300)
    wide = rgb.astype(np.uint16) * 257
    intensity = np.linspace(-30, 12, 300)
    path = write_e57(tmp_path / "a.e57", [E57Scan(xyz, wide, intensity, colour_full=65535, limits=False)])
    got = gather(path)
    np.testing.assert_array_equal(got[1], wide)
    assert (got[2].min(), got[2].max()) == (0, 65535)
    scene = open_scene(path, cache=False)
    assert scene.meta.colour.bits == 16
    assert sorted(map(tuple, unpack(scene)[1].tolist())) == sorted(map(tuple, rgb.tolist()))


@pytest.mark.parametrize("limits", [True, False])
@pytest.mark.parametrize("largest, full", [(200, 255), (255, 255), (300, 511), (1000, 1023), (4095, 4095), (40_000, 65535)])
def test_e57_colours_end_at_the_next_full_number_of_bits(tmp_path, largest, full, limits):
    """The largest value that occurs is what many writers give as the limit."""
    xyz, rgb = surface(300)
    stored = np.rint(rgb / 255.0 * largest).astype(np.uint16)
    path = write_e57(tmp_path / "a.e57", [E57Scan(xyz, stored, colour_full=largest, limits=limits)])
    expected = stored if full == 255 else np.floor(stored * (65535 / full) + 0.5)
    np.testing.assert_array_equal(gather(path)[1], expected)


def test_the_content_determines_the_format_and_a_wrong_suffix_gives_a_warning(tmp_path):
    xyz, rgb = surface(50)
    path = write_ply(tmp_path / "a.ply", xyz, rgb).rename(tmp_path / "a.las")
    scene = open_scene(path, cache=False)
    assert scene.meta.format == "PLY"
    assert "named .las but holds PLY" in scene.meta.warning_texts[0]


def test_units_come_from_wkt_and_geotiff_keys(tmp_path):
    datum = 'DATUM["D",SPHEROID["GRS",6378137,298.2]]'
    feet = f'PROJCS["Oregon",GEOGCS["NAD83",{datum},UNIT["degree",0.0174]],UNIT["foot",0.3048]]'
    assert from_wkt(feet) == ("Oregon", "foot", 0.3048)
    assert from_wkt(f'COMPD_CS["both",{feet},VERT_CS["h",UNIT["metre",1]]]') == ("Oregon", "foot", 0.3048)
    ellipsoid = 'ELLIPSOID["E",6378137,298,LENGTHUNIT["metre",1]]'
    axes = 'CS[Cartesian,2],LENGTHUNIT["US survey foot",0.3048006]'
    assert from_wkt(f'PROJCRS["UTM",BASEGEOGCRS["W",{ellipsoid}],{axes}]') == ("UTM", "US survey foot", 0.3048006)
    assert from_wkt('GEOGCS["WGS 84",UNIT["degree",0.0174]]') == ("WGS 84", "degree", None)
    assert from_wkt("nonsense") == (None, "unknown", None)
    for number in ("1.0.0", "1e", "+-1", ".", "e5", "1..0"):
        assert from_wkt(f'PROJCS["x",UNIT["metre",{number}]]') == ("x", "unknown", None), number
    assert from_wkt('PROJCS["x",UNIT["km", +1.5E+03 ]]') == ("x", "km", 1500.0)
    assert from_geokeys({1024: 1, 3072: 26910}) == ("EPSG:26910", "metre", 1.0)
    assert from_geokeys({1024: 1, 3076: 9003})[1:] == ("US survey foot", 1200 / 3937)
    assert from_geokeys({1024: 2, 2048: 4326}) == ("EPSG:4326", "degree", None)
    xyz, rgb = surface(50)
    meta = open_scene(write_las(tmp_path / "a.las", xyz, rgb, wkt=feet), cache=False).meta
    assert (meta.units, meta.metres_per_unit, meta.crs) == ("foot", 0.3048, "Oregon")


def test_ply_reader_agrees_with_open3d(tmp_path):
    """An independent reader, and writer, of the same format."""
    o3d = pytest.importorskip("open3d", reason="open3d is a development dependency")
    rng = np.random.default_rng(5)
    xyz, rgb = rng.uniform(-5, 5, (500, 3)), rng.integers(0, 256, (500, 3))
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(xyz))
    cloud.colors = o3d.utility.Vector3dVector(rgb / 255)
    for ascii_form in (True, False):
        path = tmp_path / f"cloud-{ascii_form}.ply"
        assert o3d.io.write_point_cloud(str(path), cloud, write_ascii=ascii_form)
        theirs = np.asarray(o3d.io.read_point_cloud(str(path)).points)
        scene = open_scene([path], cache=False)
        ours, colours, _, _ = unpack(scene)
        order, other = np.lexsort(ours.round(3).T), np.lexsort(theirs.round(3).T)
        assert np.abs(ours[order] - theirs[other]).max() <= scene.step
        assert np.array_equal(colours[order], rgb[other])


def test_different_units_and_unknown_units_give_different_warnings(tmp_path):
    xyz, rgb = surface(500)
    metres, other = (write_e57(tmp_path / f"{name}.e57", [E57Scan(xyz, rgb)]) for name in "ab")
    unknown = write_ply(tmp_path / "c.ply", xyz, rgb)
    feet = write_las(tmp_path / "d.las", xyz, rgb, wkt='PROJCS["Oregon",UNIT["foot",0.3048]]')
    same, half_known, mixed = (
        " ".join(open_scene([metres, file], cache=False).meta.warning_texts) for file in (other, unknown, feet)
    )
    assert "unit" not in same
    assert "not all of the files tell their unit of length" in half_known and "differ" not in half_known
    assert "the files differ in their units of length" in mixed


def test_different_coordinate_systems_of_equal_units_give_a_warning(tmp_path):
    def warned(*names):
        files = [write_las(tmp_path / f"{k}.las", *surface(200, k), wkt=f'PROJCS["{name}",UNIT["metre",1.0]]')
                 for k, name in enumerate(names)]  # fmt: skip
        scene = open_scene(files, cache=False)
        return scene.meta.crs, " ".join(scene.meta.warning_texts)

    crs, said = warned("zone 32", "zone 32")
    assert crs == "zone 32" and "differ" not in said
    crs, said = warned("zone 32", "zone 33")
    assert crs == "mixed" and "the files differ in their coordinate reference system" in said and "unit" not in said
