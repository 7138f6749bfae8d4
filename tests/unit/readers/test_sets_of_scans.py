"""Several files as one scene, folders, addresses, grids of heights: what can be opened is, and the rest is named."""

import shutil

import numpy as np
import pytest
from cloud_files import surface, write_e57, write_las
from format_files import some, write_ept, write_potree1, write_potree2

from pointglass.viewer.cli import main
from pointglass.viewer.commands.heldout.evaluate_scan import is_scan
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.readers.formats import entry_of, name_of, open_source


def tile(path, at: float = 0.0):
    xyz, rgb = surface(700)[:2]
    return write_las(path, xyz + (at, 0, 0), rgb)


def empty_las(path):
    import laspy

    laspy.LasData(laspy.LasHeader(point_format=2, version="1.2")).write(str(path))
    return path


def text(path, words):
    path.write_text(words)
    return path


BROKEN = {
    "empty.laz": empty_las,
    "nothing.las": lambda path: text(path, ""),
    "letter.txt": lambda path: text(path, "To whom it may concern\n"),
    "late.xyz": lambda path: text(path, "1 2 3\n" * 300_000 + "4 5\n" + "1 2 3\n" * 9),  # found while the points are read
    "missing.laz": lambda path: path,
}


@pytest.mark.parametrize("name", BROKEN)
@pytest.mark.parametrize("cache", [True, False])
def test_a_file_of_a_set_that_cannot_be_opened_is_left_out_and_named(tmp_path, name, cache, capsys, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    files = [tile(tmp_path / "a.laz"), BROKEN[name](tmp_path / name), tile(tmp_path / "b.laz", 3.0)]
    scene = open_scene(files, cache=cache)
    named = [line for line in scene.meta.warning_texts if line.startswith("left out: ") and name in line]
    assert scene.count == 1400 and len(named) == 1 and "\n" not in named[0]
    assert main(["info", *map(str, files)]) == 0
    assert name in capsys.readouterr().err  # also of commands that print no warnings of the scan
    again = open_scene(files, cache=cache)
    assert again.meta.warning_texts == scene.meta.warning_texts


def test_where_no_file_of_a_set_can_be_opened_one_line_says_so(tmp_path, capsys):
    files = [empty_las(tmp_path / "a.laz"), text(tmp_path / "b.xyz", "words\n")]
    assert main(["info", "--no-cache", *map(str, files)]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1 and "none of the 2 files" in line and "a.laz" in line


def test_a_folder_of_tiles_is_one_scan(tmp_path, capsys):
    folder = tmp_path / "tiles"
    folder.mkdir()
    tile(folder / "1.laz")
    tile(folder / "2.laz", 3.0)
    empty_las(folder / "3.laz")
    text(folder / "readme.txt", "Tiles of a flight\n")
    assert main(["info", "--no-cache", str(folder)]) == 0
    said = capsys.readouterr()
    assert "points   1,400" in said.out and "3.laz" in said.err and "readme" not in said.err
    shutil.rmtree(folder)
    folder.mkdir()
    assert main(["info", "--no-cache", str(folder)]) == 2
    assert "is a folder, but not" in capsys.readouterr().err


@pytest.mark.parametrize(("write", "usual", "other"), [
    (write_potree1, "cloud.js", "church.js"), (write_potree1, "cloud.js", "pointcloud.json"),
    (write_potree2, "metadata.json", "church.json"), (write_ept, "ept.json", "church.json"),
])  # fmt: skip
def test_the_file_that_describes_a_folder_may_have_another_name(tmp_path, write, usual, other):
    folder = tmp_path / "church"
    write(folder, some(300))
    count = open_scene(folder, cache=False).count
    (folder / usual).rename(folder / other)
    text(folder / "viewer.js", "var scene = {};\n")
    assert entry_of(folder) == folder / other and name_of(folder / other) == "church"
    assert open_scene(folder, cache=False).count == open_scene(folder / other, cache=False).count == count == 300


def test_evaluate_takes_potree_and_ept_folders_for_scans(tmp_path):
    write_potree2(tmp_path / "potree", some(100))
    write_ept(tmp_path / "ept", some(100), data="binary")
    (tmp_path / "room").mkdir()
    text(tmp_path / "room" / "scene.json", "{}")
    assert is_scan(tmp_path / "potree") and is_scan(tmp_path / "ept") and not is_scan(tmp_path / "room")


@pytest.mark.parametrize("address", [
    "gs://bucket/a/ept.json", "az://container/a.e57", "ftp://host/a.las",
    "/vsis3/bucket/a.laz", "/vsicurl/https://host.org/a.laz", "file:///data/a.laz",
])  # fmt: skip
@pytest.mark.parametrize("command", [["info"], [], ["convert", "--out", "{}/out"], ["export", "--out", "{}/o.las"],
                                     ["render", "--cameras", "{}/c.json", "--out", "{}/out"], ["evaluate"]])  # fmt: skip
def test_addresses_that_are_not_read_are_not_called_missing_files(tmp_path, capsys, address, command):
    assert main([part.format(tmp_path) for part in command] + [address]) == 2
    line = capsys.readouterr().err
    assert address.split("?")[0] in line.replace("/vsicurl/https:/host", "/vsicurl/https://host") and line.count("\n") == 1
    assert "address" in line or "give the path" in line
    assert not (tmp_path / "out").exists() and not list(tmp_path.iterdir())


def test_addresses_are_refused_as_camera_files_and_in_python(tmp_path, capsys):
    scan = tile(tmp_path / "a.laz")
    assert main(["render", str(scan), "--cameras", "https://host/c.json", "--out", str(tmp_path / "o")]) == 2
    assert "https://host/c.json: is an address" in capsys.readouterr().err
    with pytest.raises(InputError, match=r"gs://host/a\.laz: is an address"):
        open_scene("gs://host/a.laz")


GRID = "ncols 4\nnrows 3\nxllcorner 500000\nyllcorner 5800000\ncellsize 2\nNODATA_value -9999\n"
HEIGHTS = ["1 2 3 4", "5 6 -9999 8", "9 10 11 12.5"]


GRIDS = [
    GRID,
    GRID.upper(),
    GRID.replace("xllcorner 500000", "xllcenter 500001").replace("yllcorner 5800000", "yllcenter 5800001"),
    GRID.replace("cellsize 2", "dx 2\ndy 2"),
    GRID.replace("NODATA_value -9999\n", ""),
    "\ufeff" + GRID.replace(" ", "\t").replace("\n", "\r\n"),
    "nrows 3\nncols 4\n" + GRID.split("\n", 2)[2],
]


@pytest.mark.parametrize("header", GRIDS)
@pytest.mark.parametrize("between", ["\n", " ", "\r\n"])
@pytest.mark.parametrize("name", ["a.asc", "a.txt", "a.xyz"])
def test_esri_grids_are_read_as_heights_at_the_centres_of_cells(tmp_path, header, between, name):
    path = tmp_path / name
    path.write_bytes((header + between.join(HEIGHTS)).encode())
    source = open_source(path)
    chunks = list(source.chunks())
    xyz = np.concatenate([chunk.xyz for chunk in chunks])
    assert source.format == "ESRI grid" and len(xyz) == 11 and sum(chunk.invalid for chunk in chunks) == 1
    assert xyz[0].tolist() == [500001, 5800005, 1] and xyz[-1].tolist() == [500007, 5800001, 12.5]
    assert bool(source.warnings) == (name != "a.asc")


def test_grids_with_commas_or_a_projection_file_are_read_and_bad_ones_refused(tmp_path):
    path = text(tmp_path / "a.asc", GRID + "\n".join(HEIGHTS).replace(".", ","))
    text(tmp_path / "a.prj", 'PROJCS["ETRS89 / UTM zone 32N",UNIT["metre",1]]')
    source = open_source(path)
    assert [chunk.xyz[-1, 2] for chunk in source.chunks()][-1] == 12.5
    assert source.metres_per_unit == 1.0 and "UTM" in (source.crs or "")
    for bad, why in ((GRID + "1 2 3", "truncated"), (GRID.replace("cellsize 2", "") + HEIGHTS[0] * 9, "cells|no usable dx"),
                     (GRID + "\n".join(HEIGHTS).replace("6", "six"), "'six'"), (GRID.replace("4", "0") + "1 2", "no points"),
                     ("DSAA\n3 3\n0 1\n0 1\n0 1\n1 2 3\n", "Surfer")):  # fmt: skip
        with pytest.raises(InputError, match=why):
            list(open_source(text(path, bad)).chunks())


@pytest.mark.parametrize("row", ["{0} {1} {2}", "{0} {1} {2} -1320", "{0} {1} {2} 9 8 7", "{0} {1} {2} 200 9 8 7",
                                 "{0},{1},{2},9,8,7", "{0} {1} {2} 0.5 0.5 9 8 7 1"])  # fmt: skip
def test_pts_without_a_count_is_read_with_a_warning(tmp_path, row):
    path = tmp_path / "a.pts"
    lines = [row.format(i, 2 * i, i % 7) for i in range(300)]
    text(path, "\n".join(lines) + "\n")
    columns = "x,y,z,-,-,r,g,b,-" if row.count(" ") == 8 else None
    source = open_source(path, columns)
    chunk = next(iter(source.chunks()))
    assert source.format == "PTS" and "no line with the number" in source.warnings[0]
    assert len(chunk.xyz) == 300 and chunk.xyz[9].tolist() == [9, 18, 2]
    if "9" in row:
        assert chunk.rgb is not None and chunk.rgb[5].tolist() == [9, 8, 7]
    text(path, f"{len(lines)}\n" + "\n".join(lines) + "\n")
    if "," not in row:
        assert len(next(iter(open_source(path, columns).chunks())).xyz) == 300


def test_the_e57_of_a_set_is_still_read_with_all_of_its_scans(tmp_path):
    from cloud_files import E57Scan

    xyz, rgb = surface(300)[:2]
    e57 = write_e57(tmp_path / "a.e57", [E57Scan(xyz, rgb), E57Scan(xyz, rgb)])
    scene = open_scene([e57, empty_las(tmp_path / "b.las")], cache=False)
    assert scene.count == 600 and len(scene.meta.scans) == 2


def test_the_window_names_the_files_that_the_scene_left_out(tmp_path):
    from pointglass.viewer.window.session.loading import open_each

    files = [tile(tmp_path / "a.laz"), empty_las(tmp_path / "b.las"), tile(tmp_path / "c.laz", 3.0)]
    scene, opened, problems = open_each(files, lambda paths: open_scene(paths, cache=False))
    assert scene.count == 1400 and opened == [files[0], files[2]]
    assert len(problems) == 1 and files[1].name in str(problems[0]) and "holds no points" in str(problems[0])
