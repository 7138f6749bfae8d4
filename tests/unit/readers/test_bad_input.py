"""Errors of files are one line with the name and the remedy; unusual colours are read with a warning."""

import os
import struct
import sys

import numpy as np
import pytest
from cloud_files import SCANS, E57Scan, edited_e57, surface, write_e57, write_las, write_ply

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.readers.ply.ply_source import PlySource
from pointglass.viewer.work.project import SUFFIX


@pytest.fixture(autouse=True)
def store(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))


def refused(path, *parts):
    """Opens the file and checks the one line that refuses it."""
    with pytest.raises(InputError) as error:
        open_scene(path)
    line = str(error.value)
    assert "\n" not in line and str(path) in line and len(line) < 400
    for part in parts:
        assert part in line, line
    left = list((path.parent / "cache").glob("*")) if (path.parent / "cache").exists() else []
    assert left == [], "something partial was left in the cache"


def test_missing_empty_and_foreign_files(tmp_path):
    refused(tmp_path / "none.laz", "no such file")
    refused(tmp_path, "not one made by convert")
    for name, data, part in (
        ("empty.ply", b"", "empty"),
        ("noise.laz", bytes(range(200)), "does not begin like one"),
        ("scan.zip", b"PK\x03\x04rest", "zip"),
        ("scan.pcd", b"# .PCD v0.7", "truncated in its header"),
        ("what.dat", b"1 2 3\n", "not a scan format known here"),
        ("work" + SUFFIX, b'{\n "pointglass_project": 1}', "a project, which only the window"),
    ):
        path = tmp_path / name
        path.write_bytes(data)
        refused(path, part)


@pytest.mark.parametrize("suffix", ["las", "laz"])
@pytest.mark.parametrize("share", [0.001, 0.05, 0.5, 0.9, 0.999])
def test_truncated_las_says_how_many_points_could_be_read(tmp_path, suffix, share):
    xyz, rgb = surface(20_000)
    path = write_las(tmp_path / f"a.{suffix}", xyz, rgb)
    path.write_bytes(path.read_bytes()[: max(10, int(share * path.stat().st_size))])
    refused(path, "truncated" if share < 0.01 or suffix == "las" else "a.laz")


@pytest.mark.parametrize("where", [94, 96, 100, 105, 131, 24])
def test_bogus_las_headers_are_refused_or_harmless(tmp_path, where):
    xyz, rgb = surface(2000)
    path = write_las(tmp_path / "a.laz", xyz, rgb)
    data = bytearray(path.read_bytes())
    data[where : where + 2] = b"\xff\xff"
    path.write_bytes(data)
    try:
        open_scene(path, cache=False)
    except InputError as error:
        assert "\n" not in str(error)


def test_a_las_header_that_promises_too_many_points_is_refused(tmp_path):
    for suffix in ("las", "laz"):
        path = write_las(tmp_path / f"a.{suffix}", *surface(2000))
        data = bytearray(path.read_bytes())
        struct.pack_into("<I", data, 107, 4_000_000_000)
        path.write_bytes(data)
        refused(path, "of 4,000,000,000 points could be read")


def test_las_records_behind_the_points_end_with_the_file(tmp_path):
    """laspy would create as many empty records as the header states, up to 2**32."""
    import laspy

    header = laspy.LasHeader(point_format=7, version="1.4")
    las = laspy.LasData(header)
    las.x, las.y, las.z = surface(100)[0].T
    las.write(str(path := tmp_path / "a.las"))
    data = bytearray(path.read_bytes())
    for place, number in ((len(data), 100_000), (2**63, 1), (0, 2**32 - 1)):
        struct.pack_into("<QI", data, 235, place, number)
        path.write_bytes(data)
        with pytest.raises(InputError, match=r"a\.las: truncated: the last of its .* extended records ends beyond"):
            open_source(path)


@pytest.mark.parametrize("kind", ["las", "ascii", "binary_little_endian", "binary_big_endian", "vertex_list"])
def test_points_beyond_the_count_of_the_header_give_a_warning(tmp_path, kind):
    xyz, rgb = surface(500)
    if kind == "las":
        path = write_las(tmp_path / "a.las", xyz, rgb)
        data = bytearray(path.read_bytes())
        struct.pack_into("<I", data, 107, 400)
    else:
        form = {"vertex_list": True} if kind == "vertex_list" else {"order": kind}
        path = write_ply(tmp_path / "a.ply", xyz, rgb, **form)
        data = path.read_bytes().replace(b"vertex 500", b"vertex 400")
    assert not any("more follow" in text for text in open_scene(path, cache=False).meta.warning_texts)
    path.write_bytes(data)
    scene = open_scene(path, cache=False)
    told = [text for text in scene.meta.warning_texts if "its header counts 400 points, but more follow" in text]
    assert scene.count == 400 and len(told) == 1


def test_invalid_colours_and_positions_are_read_without_numpy_warnings(tmp_path, recwarn):
    """NumPy would print warnings about casts."""
    head = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {axis}\n" for axis in "xyz")
    head += "".join(f"property uchar {name}\n" for name in ("red", "green", "blue")) + "property uchar intensity\nend_header\n"
    (tmp_path / "a.ply").write_text(head + "0 0 0 inf -5 300 nan\n0 0 1 255 0 7 1e99\n0 1 0 nan 2 3 -1\n")
    chunk = next(open_source(tmp_path / "a.ply").chunks())
    assert chunk.rgb is not None and chunk.intensity is not None
    assert chunk.rgb.tolist() == [[255, 0, 255], [255, 0, 7], [0, 2, 3]] and chunk.intensity[0] == chunk.intensity[2] == 0
    xyz = np.zeros((3, 3), "<f4")
    xyz.view("<u4")[1, 1] = 0x7F800001  # a signalling NaN
    write_ply(tmp_path / "b.ply", xyz, kind="float")
    (tmp_path / "b.ply").write_bytes((tmp_path / "b.ply").read_bytes()[: -xyz.nbytes] + xyz.tobytes())
    assert np.isnan(next(open_source(tmp_path / "b.ply").chunks()).xyz[1, 1])
    assert [str(warning.message) for warning in recwarn] == []


def test_points_beyond_valid_positions_are_left_out_without_numpy_warnings(tmp_path, recwarn):
    xyz, rgb = surface(4000)
    xyz[[5, 2500]] = [[1.7e308, 0, 0], [-1.7e308, 1e300, 1e25]]
    halves = enumerate((slice(2000), slice(2000, None)))
    scans = [E57Scan(xyz[half], rgb[half], None, (1, 0, 0, 0), (i, 0, 0)) for i, half in halves]
    scene = open_scene(write_e57(tmp_path / "a.e57", scans), cache=False)
    assert scene.count == 3998 and scene.meta.dropped.stray == 2
    assert [str(warning.message) for warning in recwarn] == []


def test_las_without_points(tmp_path):
    path = write_las(tmp_path / "a.las", *surface(10))
    data = bytearray(path.read_bytes())
    struct.pack_into("<I", data, 107, 0)
    path.write_bytes(data)
    refused(path, "no points")


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("form", [{}, {"vertex_list": True}, {"faces_first": True}])
def test_truncated_ply_says_how_many_points_could_be_read(tmp_path, order, form):
    path = write_ply(tmp_path / "a.ply", *surface(1000), order=order, **form)
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    refused(path)
    path.write_bytes(data[: data.rindex(b"end_header") + 11])
    refused(path, "0 of 1,000 points could be read")
    path.write_bytes(data[:60])
    refused(path, "truncated in its header")


def test_ply_files_without_usable_vertices_are_refused(tmp_path):
    path = tmp_path / "a.ply"
    xyz = "property float x\nproperty float y\nproperty float z\n"
    big, many = "format binary_big_endian 1.0\n", "\xff" * 40
    for head, part in (
        ("format ascii 1.0\nelement face 1\nproperty list uchar int v\nend_header\n", "without vertices"),
        ("format ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n", "without z"),
        (
            f"format ascii 1.0\nelement vertex 0\n{xyz}end_header\n",
            "no points",
        ),
        ("format packed 1.0\nend_header\n", "line 2 not understood"),
        (f"format ascii 1.0\nelement vertex \u00b2\n{xyz}end_header\n1 2 3\n", "line 3 not understood"),
        ("format ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n", "line 4 not understood"),
        (f"format ascii 1.0\nelement vertex 1\n{xyz}end_header\n1 b 3\n", "vertex 1 is not 3 numbers"),
        (f"format ascii 1.0\nelement vertex 1\nproperty list float int v\n{xyz}end_header\n", "line 4 not understood"),
        (f"{big}element face {'9' * 18}\nproperty double a\nelement vertex 1\n{xyz}end_header\n1 2 3", "0 of 1 points"),
        (f"{big}element face 1\nproperty list ulong double v\nelement vertex 1\n{xyz}end_header\n{many}", "in element face"),
        (f"{big}element vertex 1\n{xyz}property list ulong double v\nend_header\n{'0' * 12}{many}", "0 of 1 points"),
        (f"format ascii 1.0\nelement vertex 2\n{xyz}end_header\n1 2 3\n4 5", "1 of 2 points could be read"),
    ):
        path.write_bytes(b"ply\n" + head.encode("latin-1"))
        refused(path, part)


def test_truncated_and_corrupted_e57(tmp_path):
    path = write_e57(tmp_path / "a.e57", [E57Scan(*surface(20_000))])
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])
    refused(path, "truncated or damaged: its header states another length")
    middle = bytearray(data)
    middle[len(data) // 2] ^= 0xFF
    path.write_bytes(middle)
    refused(path, "checksum")
    path.write_bytes(data[:30])
    refused(path)


def test_e57_without_points(tmp_path):
    xyz, rgb = surface(10)
    refused(write_e57(tmp_path / "a.e57", []), "no scans")
    refused(write_e57(tmp_path / "b.e57", [E57Scan(xyz[:0]), E57Scan(xyz[:0])]), "no points (2 empty scans)")
    refused(
        write_e57(tmp_path / "c.e57", [E57Scan(xyz, rgb, invalid=np.full(10, 2))]), "none of its 10 points is valid"
    )


def test_e57_points_without_a_prototype_are_refused(tmp_path):
    """libe57 would end the process, so the XML is checked first."""
    path = write_e57(tmp_path / "a.e57", [E57Scan(*surface(100))])
    edited_e57(path, (rb"<prototype.*</prototype>", b""))
    with pytest.raises(InputError, match=r"a\.e57: damaged: points without a prototype") as error:
        open_source(path)
    assert "\n" not in str(error.value)


def test_an_e57_whose_xml_only_libe57_reads_is_refused(tmp_path):
    """libe57's parser reads some malformed XML that Python's refuses; its counts and fields could not be checked first."""
    path = write_e57(tmp_path / "a.e57", [E57Scan(*surface(100))])
    edited_e57(path, (rb'version="1.0"', b'version="1.#QNAN"'), (rb'recordCount="100"', b'recordCount="-1"'))
    with pytest.raises(InputError, match=r"a\.e57: damaged: its description is not well-formed XML") as error:
        open_source(path)
    assert "\n" not in str(error.value)


TEXT, NUMBER = b' type="String"><![CDATA[what]]></', b' type="Integer">5</'


@pytest.mark.parametrize(("old", "new", "said"), [
    (rb"<name .*?name>", b"<name" + NUMBER + b"name>", None), (rb"<w .*?</w>", b'<w type="Float">-1e308</w>', None),
    (rb"<w .*?</w>", b"<w" + TEXT + b"w>", None), (rb"<pose .*?</pose>", b"<pose" + NUMBER + b"pose>", None),
    (rb"<rotation .*?</rotation>", b"<rotation" + TEXT + b"rotation>", None),
    (rb"<intensityMaximum [^>]*>(1</intensityMaximum>)?", b"<intensityMaximum" + TEXT + b"intensityMaximum>", None),
    (rb"<intensityLimits .*?</intensityLimits>", b"<intensityLimits" + NUMBER + b"intensityLimits>", None),
    (rb"<colorRed [^>]*>(</colorRed>)?", b"<colorRed" + TEXT + b"colorRed>", None),
    (rb"<data3D .*</data3D>", b"<data3D" + NUMBER + b"data3D>", "no scans"),
    (rb"<vectorChild .*</data3D>", b"<vectorChild" + NUMBER + b"vectorChild></data3D>", "data3D[0] is not a Structure"),
    (rb"<points .*</points>", b"<points" + NUMBER + b"points>", "data3D[0]/points is not a CompressedVector"),
])  # fmt: skip
def test_e57_nodes_of_an_unexpected_type_are_ignored_or_refused(tmp_path, old, new, said):
    xyz, rgb = surface(100)
    path = write_e57(tmp_path / "a.e57", [E57Scan(xyz, rgb, np.linspace(0, 1, 100), (1, 0, 0, 0), (0, 0, 0), name="one")])
    edited_e57(path, (old, new))
    if said:
        refused(path, said)
    else:
        with np.errstate(all="raise"):
            assert open_scene(path, cache=False).count == 100


def test_e57_with_packets_of_unknown_type_is_refused(tmp_path):
    """The message of libe57 quotes the byte, which is not valid text."""
    path = edited_e57(write_e57(tmp_path / "a.e57", [E57Scan(*surface(100))]), byte=(80, 0xA0))
    refused(path, "damaged")


@pytest.mark.skipif(sys.platform in ("win32", "darwin"), reason="names are text there")
def test_scans_whose_file_names_are_not_valid_text_are_read(tmp_path):
    path = write_e57(tmp_path / "a.e57", [E57Scan(*surface(100))])
    path = path.rename(os.fsdecode(os.fsencode(tmp_path) + b"/a\xff\xfe.e57"))
    assert open_scene(path, cache=False).count == 100


@pytest.mark.parametrize("name", ["bad-crc.e57", "empty.e57", "ZeroPoints.e57"])
def test_known_bad_e57_files_are_refused_in_one_line(name):
    if not (SCANS / "e57" / name).exists():
        pytest.skip(f"{SCANS / 'e57' / name} is not on this machine")
    with pytest.raises(InputError) as error:
        open_scene(SCANS / "e57" / name)
    assert "\n" not in str(error.value) and name in str(error.value)


def colours_of(scene):
    return sorted(map(tuple, unpack(scene)[1].tolist()))


def test_colour_depth_is_decided_over_the_whole_file(tmp_path):
    xyz, rgb = surface(1000)
    want = sorted(map(tuple, rgb.tolist()))
    narrow = open_scene(write_las(tmp_path / "a.las", xyz, rgb))
    assert colours_of(narrow) == want and narrow.meta.colour.bits == 8
    assert "8-bit colour in 16-bit fields" in narrow.meta.warning_texts[0]
    wide = open_scene(write_las(tmp_path / "b.las", xyz, rgb.astype(np.uint16) << 8))
    assert colours_of(wide) == want and wide.meta.colour.bits == 16 and wide.meta.warning_texts == []
    mixed = open_scene([tmp_path / "a.las", tmp_path / "b.las"])  # each file by itself
    assert colours_of(mixed) == sorted(want + want)
    late = np.zeros((1000, 3), np.uint16) + 3  # dark nearly to the end: still 16-bit
    late[-1] = 65535
    assert max(colours_of(open_scene(write_las(tmp_path / "c.las", xyz, late)))) == (255, 255, 255)


def test_scans_without_colour_show_intensity_or_else_height(tmp_path):
    xyz, _ = surface(5000)
    levels = np.linspace(1000, 3000, 5000).astype(np.uint16)
    black = np.zeros((5000, 3), np.uint16)
    grey = open_scene(write_las(tmp_path / "a.las", xyz, black, levels))
    assert grey.meta.colour.source == "intensity" and "no colour" in grey.meta.warning_texts[0]
    _, colours, stored, _ = unpack(grey)
    assert (colours[:, 0] == colours[:, 2]).all() and colours.min() == 0 and colours.max() == 255
    assert set(stored) == set(levels)
    ramp = open_scene(write_ply(tmp_path / "a.ply", xyz))
    assert ramp.meta.colour.source == "height" and "shown by height" in ramp.meta.warning_texts[0]
    back, colours, _, _ = unpack(ramp)
    low, high = back[:, 2].argmin(), back[:, 2].argmax()
    assert colours[low].tolist() == [68, 1, 84] and colours[high].tolist() == [253, 231, 37]


def test_a_scan_without_colour_among_coloured_ones(tmp_path):
    xyz, rgb = surface(500)
    scans = [E57Scan(xyz, rgb), E57Scan(xyz, intensity=np.linspace(0, 1, 500))]
    scene = open_scene(write_e57(tmp_path / "a.e57", scans))
    assert scene.meta.colour.source == "rgb" and "1 of 2 scans" in scene.meta.warning_texts[0]
    _, colours, _, number = unpack(scene)
    assert sorted(map(tuple, colours[number == 0].tolist())) == sorted(map(tuple, rgb.tolist()))
    assert len(np.unique(colours[number == 1, 0])) > 200


def test_float32_coordinates_too_large_for_their_precision_give_a_warning(tmp_path):
    xyz, rgb = surface(5000, origin=(4_500_000.0, 300_000.0, 0.0))
    scene = open_scene(write_ply(tmp_path / "a.ply", xyz, rgb, kind="float"))
    assert any("too few digits" in warning for warning in scene.meta.warning_texts)
    assert open_scene(write_ply(tmp_path / "b.ply", xyz, rgb)).meta.warning_texts == []


REAL = {
    "e57/ColourRepresentation.e57": (153, "rgb", 16), "e57/ColouredCubeDouble.e57": (7680, "rgb", 8),
    "e57/ColouredCubeFloat.e57": (7680, "rgb", 8), "e57/bunnyInt32.e57": (30_571, "height", 8),
}  # fmt: skip


@pytest.mark.parametrize("name", REAL)
def test_real_e57_files_open_with_their_counts_and_colours(name):
    """Large scans: tests/gl/test_real_scans.py."""
    if not (SCANS / name).exists():
        pytest.skip(f"{SCANS / name} is not on this machine")
    count, colour, bits = REAL[name]
    scene = open_scene(SCANS / name)
    assert scene.count == count
    assert (scene.meta.colour.source, scene.meta.colour.bits) == (colour, bits)
    assert scene.step <= scene.spacing / 4
    xyz = unpack(scene)[0]
    assert (xyz >= scene.bounds[0] - scene.step).all() and (xyz <= scene.bounds[1] + scene.step).all()


@pytest.mark.parametrize("kind", ["las", "laz", "ply", "e57"])
def test_a_file_truncated_while_it_is_read_is_refused(tmp_path, monkeypatch, kind):
    """Truncated by another program between two chunks: one line, and no bus error."""
    for module in ("las.las_source.CHUNK", "ply.ply_source.CHUNK", "e57.e57_source.BLOCK"):
        monkeypatch.setattr(f"pointglass.viewer.readers.{module}", 20_000)
    xyz, rgb = surface(100_000)
    path = tmp_path / f"scan.{kind}"
    if kind == "ply":
        write_ply(path, xyz, rgb)
    elif kind == "e57":
        write_e57(path, [E57Scan(xyz, rgb)])
    else:
        write_las(path, xyz, rgb)
    chunks = open_source(path).chunks()
    assert len(next(chunks).xyz) == 20_000
    os.truncate(path, 2_000)
    with pytest.raises(InputError, match=r"again") as error:
        list(chunks)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_a_disk_error_while_reading_names_the_scan_in_one_line(tmp_path, monkeypatch):
    path = write_ply(tmp_path / "a.ply", *surface(300))
    columns = PlySource._columns

    def failing(self):
        yield from columns(self)
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(PlySource, "_columns", failing)
    with pytest.raises(InputError, match=r"a\.ply: cannot be read: Input/output error$"):
        open_scene(path, cache=False)


def test_a_full_disk_is_reported_before_points_are_placed(monkeypatch):
    """A page of a memory map that cannot be allocated is a bus error, which cannot be caught."""
    from collections import namedtuple

    from pointglass.viewer.grid import build_scene as build
    from pointglass.viewer.grid import scratch_folder as scratch

    monkeypatch.setattr(build, "_IN_MEMORY", 10)
    assert build.in_memory("points", (1000, 3), np.uint32).shape == (1000, 3)
    monkeypatch.setattr(scratch.shutil, "disk_usage", lambda _: namedtuple("Usage", "free")(1000))
    with pytest.raises(InputError, match=r"no room for .* GB of points \(no space left.*set TMPDIR"):
        build.in_memory("points", (1000, 3), np.uint32)


def test_an_error_without_text_is_called_damage():
    from pointglass.viewer.readers.e57.e57_nodes import first_line

    assert first_line(RuntimeError()) == "damaged: its content is not readable"
    assert first_line(RuntimeError("bad CRC\nmore")) == "bad CRC"
