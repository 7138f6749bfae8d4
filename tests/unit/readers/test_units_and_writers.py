"""Files of writers that depart from their format, and units: what is in the file is read, and what is odd is said."""

import struct

import numpy as np
import pytest
from cloud_files import E57Scan, surface, write_e57, write_las
from format_files import some, write_pcd

from pointglass.viewer import cli
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.readers.crs import height_unit, height_unit_of_geokeys
from pointglass.viewer.readers.e57.e57_length import crc32c, length_warning
from pointglass.viewer.readers.formats import open_source

FEET_WKT1 = ('COMPD_CS["x",PROJCS["UTM 17N",GEOGCS["NAD83",DATUM["d",SPHEROID["GRS",6378137,298.25]],UNIT["degree",0.01745]],'
             'UNIT["metre",1]],VERT_CS["NAVD88 height (ftUS)",VERT_DATUM["d",2005],UNIT["US survey foot",0.304800609601219]]]')
FEET_WKT2 = ('COMPOUNDCRS["x",PROJCRS["UTM 17N",BASEGEOGCRS["NAD83",DATUM["d",ELLIPSOID["GRS",6378137,298.25,'
             'LENGTHUNIT["metre",1]]]],CS[Cartesian,2],LENGTHUNIT["metre",1]],VERTCRS["h",VDATUM["d"],CS[vertical,1],AXIS["h",up],'
             'LENGTHUNIT["foot",0.3048]]]')  # fmt: skip


def las14(path, count=900):
    """LAS 1.4 with the count in the field of 32 bits only."""
    import laspy

    xyz, rgb = surface(count)[:2]
    header = laspy.LasHeader(point_format=3, version="1.4")
    header.scales, header.offsets = np.full(3, 1 / 4096), np.zeros(3)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = rgb.T.astype(np.uint16) * 257
    las.write(str(path))
    data = bytearray(path.read_bytes())
    struct.pack_into("<I", data, 107, count)
    struct.pack_into("<Q", data, 247, 0)
    path.write_bytes(data)
    return path, xyz


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_las_that_counts_its_points_in_the_old_field_only_is_read_whole(tmp_path, suffix):
    path, xyz = las14(tmp_path / f"a.{suffix}")
    source = open_source(path)
    assert source.count == 900 and source.warnings == []
    np.testing.assert_array_equal(np.concatenate([chunk.xyz for chunk in source.chunks()]), xyz)
    np.testing.assert_array_equal(source.records(np.array([3, 899])).xyz, xyz[[3, 899]])
    sample = source.sample(10_000, 100)
    assert sample is not None and sum(len(chunk.xyz) for chunk in sample) == 900


@pytest.mark.parametrize("suffix", ["las", "laz"])
def test_las_1_5_is_read(tmp_path, suffix):
    import laspy

    xyz = surface(300)[0]
    header = laspy.LasHeader(point_format=7, version="1.5")
    header.scales = np.full(3, 1 / 4096)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.write(str(path := tmp_path / f"a.{suffix}"))
    source = open_source(path)
    np.testing.assert_array_equal(np.concatenate([chunk.xyz for chunk in source.chunks()]), xyz)


@pytest.mark.parametrize("wkt", [FEET_WKT1, FEET_WKT2])
def test_heights_in_feet_beside_metres_are_said(tmp_path, wkt):
    xyz, rgb = surface(200)[:2]
    source = open_source(write_las(tmp_path / "a.las", xyz, rgb, wkt=wkt))
    assert source.units == "metre" and "heights are in " in source.warnings[0] and "foot" in source.warnings[0]
    metres = wkt.replace("0.304800609601219", "1").replace("0.3048]", "1]")
    assert open_source(write_las(tmp_path / "b.las", xyz, rgb, wkt=metres)).warnings == []


def test_height_units_of_codes_and_geokeys():
    assert height_unit("EPSG:26917+6360") == pytest.approx(("US survey foot", 1200 / 3937))
    assert height_unit("EPSG:25832") is None and height_unit("") is None and height_unit("a name") is None
    assert height_unit_of_geokeys({4099: 9003}) == ("US survey foot", 1200 / 3937)
    assert height_unit_of_geokeys({4096: 6360}) == pytest.approx(("US survey foot", 1200 / 3937))
    assert height_unit_of_geokeys({3072: 26917}) is None


def test_geokeys_with_heights_in_feet_do_not_change_the_unit_of_the_plan(tmp_path):
    import laspy

    xyz, rgb = surface(100)[:2]
    path = write_las(tmp_path / "a.las", xyz, rgb)
    las = laspy.read(path)
    keys = [(1024, 0, 1, 1), (3072, 0, 1, 26917), (4099, 0, 1, 9003)]
    data = struct.pack("<4H", 1, 1, 0, len(keys)) + b"".join(struct.pack("<4H", *key) for key in keys)
    las.header.vlrs.append(laspy.VLR("LASF_Projection", 34735, "", data))
    las.write(str(path))
    source = open_source(path)
    assert source.crs == "EPSG:26917" and source.metres_per_unit == 1.0 and "US survey foot" in source.warnings[0]


def degrees(count=500, at=(-75.16, 39.95), side=0.001, tall=30.0):
    random = np.random.default_rng(2)
    return np.c_[at[0] + random.random(count) * side, at[1] + random.random(count) * side, random.random(count) * tall]


@pytest.mark.parametrize("xyz", [degrees(), degrees(at=(8.5, 47.4), side=0.0005, tall=3.0),
                                 degrees(at=(151.2, -33.8), side=0.1)])  # fmt: skip
def test_degrees_are_recognised_by_their_numbers_in_every_format(tmp_path, xyz):
    rgb = np.full((len(xyz), 3), 90, np.uint8)
    paths = [write_las(tmp_path / "a.las", xyz, rgb, scale=1e-7), tmp_path / "a.xyz", tmp_path / "a.csv"]
    np.savetxt(paths[1], xyz, fmt="%.9f")
    np.savetxt(paths[2], xyz, fmt="%.9f", delimiter=",", header="lon,lat,height", comments="")
    for path in paths:
        scene = open_scene(path, cache=False)
        said = [text for text in scene.meta.warning_texts if "degrees" in text]
        assert len(said) == 1 and "reproject it to metres" in said[0], path
        low, high = xyz.min(axis=0), xyz.max(axis=0)  # coordinates stay those of the file
        np.testing.assert_allclose(scene.bounds, [low, high], atol=2e-7)


@pytest.mark.parametrize("xyz", [
    surface(300)[0], surface(300)[0] + (100.0, 50.0, 0.0), surface(300)[0] * (1, 1, 60) + (12.0, 47.0, 0.0),
    np.c_[np.random.default_rng(0).random((300, 2)) * 0.1, np.linspace(0, 9, 300)] + (10.0, 3.0, 0.0),  # a pole
])  # fmt: skip
def test_scans_in_metres_are_not_taken_for_degrees(tmp_path, xyz):
    scene = open_scene(write_las(tmp_path / "a.las", xyz, np.full((len(xyz), 3), 90)), cache=False)
    assert not any("degree" in text for text in scene.meta.warning_texts)


def test_the_checksum_of_pages_is_castagnolis():
    assert crc32c(b"123456789") == 0xE3069283


def e57(tmp_path, **scan):
    xyz, rgb = surface(3000)[:2]
    return write_e57(tmp_path / "a.e57", [E57Scan(xyz + 1, rgb, **scan)]), xyz + 1


@pytest.mark.parametrize("change", [-1, -3, 1, 700, 5000])
def test_an_e57_with_bytes_too_few_or_too_many_at_its_end_is_read_with_a_warning(tmp_path, change):
    path, xyz = e57(tmp_path)
    data = path.read_bytes()
    path.write_bytes(data[:change] if change < 0 else data + b"\x55" * change)
    source = open_source(path)
    np.testing.assert_array_equal(np.concatenate([chunk.xyz for chunk in source.chunks()]), xyz)
    assert f"has {len(data) + change:,} bytes" in source.warnings[0] and path.stat().st_size == len(data) + change
    sample = source.sample(10_000, 100)
    assert sample is None or sum(len(chunk.xyz) for chunk in sample) == len(xyz)


@pytest.mark.parametrize("change", [-1, 1, 512, -1024, 4096])
def test_an_e57_whose_header_states_a_wrong_length_is_read_with_a_warning(tmp_path, change):
    path, xyz = e57(tmp_path)
    data = bytearray(path.read_bytes())
    struct.pack_into("<Q", data, 16, len(data) + change)
    data[1020:1024] = struct.pack(">I", crc32c(bytes(data[:1020])))
    path.write_bytes(data)
    if change % 1024:
        assert sum(len(chunk.xyz) for chunk in open_source(path).chunks()) == len(xyz)
    else:  # as of a file that is cut, or to which another was appended
        with pytest.raises(InputError, match=r"a\.e57"):
            list(open_source(path).chunks())


def test_an_e57_that_lost_points_is_refused(tmp_path):
    path, _ = e57(tmp_path)
    whole = path.read_bytes()
    assert length_warning(path) is None
    for share in (0.3, 0.7, 0.98):
        path.write_bytes(whole[: int(len(whole) * share)])
        with pytest.raises(InputError, match=r"a\.e57"):
            list(open_source(path).chunks())


@pytest.mark.parametrize("posed", [True, False])
@pytest.mark.parametrize("spherical", [True, False])
def test_points_at_the_scanner_itself_are_left_out_where_no_state_is_stored(tmp_path, posed, spherical):
    xyz, rgb = surface(2000)[:2]
    xyz[::4] = 0
    scan = E57Scan(xyz, rgb, spherical=spherical, translation=(100.0, 200.0, 5.0) if posed else None)
    source = open_source(write_e57(tmp_path / "a.e57", [scan]))
    chunks, records = list(source.chunks()), list(source.record_chunks())
    assert sum(len(chunk.xyz) for chunk in chunks) == 1500 and sum(chunk.invalid for chunk in chunks) == 500
    assert "directions without a return" in source.warnings[0]
    np.testing.assert_array_equal(np.concatenate([part.xyz for part in records]), np.concatenate([c.xyz for c in chunks]))


def test_a_single_point_at_the_origin_and_those_of_a_state_field_are_kept(tmp_path):
    xyz, rgb = surface(500)[:2]
    xyz[7] = 0
    source = open_source(write_e57(tmp_path / "a.e57", [E57Scan(xyz, rgb)]))
    assert sum(len(chunk.xyz) for chunk in source.chunks()) == 500 and source.warnings == []
    xyz[::5] = 0
    source = open_source(write_e57(tmp_path / "b.e57", [E57Scan(xyz, rgb, invalid=np.zeros(500, int))]))
    assert sum(len(chunk.xyz) for chunk in source.chunks()) == 500


@pytest.mark.parametrize("factor", [1.0, 1e-6])  # beyond the limits, and in a small part of them
def test_intensity_limits_that_the_values_contradict_are_not_used(tmp_path, factor):
    """write_e57 states 0 and 1 as limits."""
    xyz, _ = surface(2048)
    source = open_source(write_e57(tmp_path / "a.e57", [E57Scan(xyz, None, intensity=np.arange(2048) * factor)]))
    found = next(iter(source.chunks())).intensity
    assert found is not None and len(np.unique(found)) == 2048
    sample = source.sample(10_000, 100)
    assert sample is not None
    assert sum(len(np.unique(chunk.intensity)) for chunk in sample if chunk.intensity is not None) == 2048


@pytest.mark.parametrize("word", ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND", "NULL", "1.5D+400"])
def test_ascii_ply_with_other_spellings_of_nan(tmp_path, word):
    path = tmp_path / "a.ply"
    rows = [f"{i} {2 * i} 1 9 8 7" for i in range(300)]
    rows[10] = f"{word} {word} {word} 0 0 0"
    head = "".join(f"property {kind} {name}\n" for kind, names in (("float", "xyz"), ("uchar", ("red", "green", "blue")))
                   for name in names)  # fmt: skip
    path.write_text(f"ply\nformat ascii 1.0\nelement vertex 300\n{head}end_header\n" + "\n".join(rows) + "\n")
    scene = open_scene(path, cache=False)
    assert scene.count == 299 and scene.meta.dropped.nan == 1
    path.write_text(path.read_text().replace(word, "wall"))
    with pytest.raises(InputError, match="vertex 11 is not 6 numbers"):
        open_scene(path, cache=False)


def odd_ply(path, kind, order, count=200):
    """Colours of 4 bytes; 7 points have a channel beyond 16 bits."""
    xyz, rgb = surface(count)
    values = rgb.astype(np.int64) * 257
    values[3:8, 1], values[20, 0], values[21, 2] = 70_000, 65_536, -5 if kind == "int" else 4_000_000_000
    rows = [*(("x", "double", xyz[:, 0]), ("y", "double", xyz[:, 1]), ("z", "double", xyz[:, 2])),
            *((name, kind, values[:, at]) for at, name in enumerate(("red", "green", "blue")))]  # fmt: skip
    head = [f"format {order} 1.0", f"element vertex {count}", *(f"property {of} {name}" for name, of, _ in rows), "end_header"]
    types = {"double": "<f8", "int": "<i4", "uint": "<u4"}
    table = np.rec.fromarrays([column.astype(types[of]) for _, of, column in rows])
    body = table.tobytes() if order != "ascii" else "".join(" ".join(map(repr, row)) + "\n" for row in table.tolist()).encode()
    path.write_bytes("\n".join(["ply", *head, ""]).encode() + body)
    return path


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize("kind", ["int", "uint"])
def test_colours_beyond_16_bits_are_counted_in_a_warning_and_at_export(tmp_path, capsys, order, kind):
    path = odd_ply(tmp_path / "a.ply", kind, order)
    said = "a.ply: 7 points have a colour channel below 0 or above 65,535, such as 65536; it is clipped"
    assert [text for text in open_scene(path, cache=False).meta.warning_texts if "colour" in text] == [said]
    assert cli.main(["export", "--no-cache", str(path), "--out", str(tmp_path / "b.las")]) == 0
    assert said in "".join(capsys.readouterr())


def test_colours_of_text_beyond_16_bits_are_counted_in_a_warning(tmp_path):
    xyz, rgb = surface(200)
    values = rgb * 257.0
    values[5:9, 1] = 70_000
    np.savetxt(tmp_path / "a.csv", np.c_[xyz, values], fmt="%.6f", delimiter=",", header="x,y,z,r,g,b", comments="")
    warned = open_scene(tmp_path / "a.csv", cache=False).meta.warning_texts
    assert any("4 points have a colour channel" in text for text in warned)


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
def test_fields_of_a_pcd_with_several_values_are_named_as_left_out(tmp_path, capsys, data):
    path = write_pcd(tmp_path / "a.pcd", some(100), data, pad=True)
    said = "a.pcd: 1 field of several values a point, histogram (3 values), is left out"
    assert said in open_scene(path, cache=False).meta.warning_texts
    assert cli.main(["export", "--no-cache", str(path), "--out", str(tmp_path / "b.las")]) == 0
    assert said in "".join(capsys.readouterr())
    assert open_source(write_pcd(tmp_path / "c.pcd", some(100), data)).warnings == []
