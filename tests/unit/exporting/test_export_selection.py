"""What is left out of an export: clips, hidden stations, files that are gone.  The records that are kept are whole."""

import shutil

import laspy
import numpy as np
import pytest
from cloud_files import write_las
from e57_files import contents, random_e57
from examples import examples
from las_files import random_las
from untyped import read_las

from pointglass.viewer import cli
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.place import many_files
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.clip import Box, contains
from pointglass.viewer.readers.las.las_source import LasSource
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import write_project


def export(*arguments):
    assert cli.main(["export", "--no-cache", *map(str, arguments)]) == 0


@pytest.mark.parametrize("seed", range(examples(3)))
def test_a_project_s_las_export_holds_the_whole_records_in_sight(tmp_path, seed):
    rng = np.random.default_rng(seed)
    files = [tmp_path / "a.laz", tmp_path / "b.las"]
    random_las(files[0], seed, point_format=int(rng.choice([1, 3, 6, 7, 8])))
    las = read_las(files[0])
    las.points.array["X"] += 5000
    las.write(str(files[1]))
    both = [read_las(file) for file in files]
    xyz = np.asarray(both[0].xyz)
    low, high = np.quantile(xyz, 0.1, axis=0), np.quantile(xyz, 0.8, axis=0)
    keeps = Box(tuple((low + high) / 2), tuple((high - low) / 2))
    project = tmp_path / "work.pointglass"
    write_project(project, Document(tuple(ScanFile(str(file)) for file in files), hidden_stations=(1,), clips=(keeps,)))
    export(project, "--out", tmp_path / "out.laz")
    kept = contains((keeps,), xyz)
    expected, found = both[0].points.array[kept], read_las(tmp_path / "out.laz")
    assert 0 < kept.sum() < len(xyz)
    assert np.array_equal(np.asarray(found.xyz), xyz[kept])
    ids = expected["point_source_id"].copy()
    expected, got = expected.copy(), found.points.array.copy()
    for array in (expected, got):
        array["X"], array["Y"], array["Z"] = 0, 0, 0  # counted from another offset where files are joined
    assert np.array_equal(got["point_source_id"], ids) and expected.tobytes() == got.tobytes()


@pytest.mark.parametrize("seed", range(examples(4)))
def test_a_clip_keeps_whole_records_of_e57_and_the_scans_that_have_any(tmp_path, seed):
    random_e57(tmp_path / "a.e57", seed, scans=3)
    scene = open_scene([tmp_path / "a.e57"], cache=False, match=False)
    numbers = unpack(scene)[3]
    first = unpack(scene)[0][numbers == np.bincount(numbers).argmax()]
    low, high = np.quantile(first, 0.2, axis=0), np.quantile(first, 0.9, axis=0)
    clip = ",".join(f"{value:.6f}" for value in (*low, *high))
    export(tmp_path / "a.e57", "--clip", clip, "--out", tmp_path / "b.e57")
    a, b = contents(tmp_path / "a.e57"), contents(tmp_path / "b.e57")
    scans = sorted(key for key in b if key.startswith("/data3D/") and key.count("/") == 2)
    names = {a[f"{key}/guid"]: key for key in a if key.count("/") == 2 and f"{key}/guid" in a}
    changed = "/points/", "/points", "/pointGroupingSchemes", "/cartesianBounds"
    for scan in scans:
        source = names[b[f"{scan}/guid"]]
        for key in a:
            tail = key.removeprefix(source)
            if key.startswith(f"{source}/") and not tail.startswith(changed):
                assert b[f"{scan}{tail}"] == a[key], key
        whole, part = (rows_of(found, path) for found, path in ((a, source), (b, scan)))
        assert len(part) and set(part) <= set(whole)
    kept = {b[f"{scan}/guid"][1] for scan in scans}
    photographs = {b[key][1] for key in b if key.endswith("associatedData3DGuid")}
    assert photographs <= kept


def rows_of(found, scan):
    """Records as bytes, of the columns of :func:`contents`."""
    count = found[f"{scan}/points"][1]
    columns = [np.frombuffer(value, np.uint8).reshape(count, -1) for key, value in sorted(found.items())
               if key.startswith(f"{scan}/points/") and isinstance(value, bytes)]  # fmt: skip
    return [row.tobytes() for row in np.concatenate(columns, axis=1)]


def test_a_grid_whose_file_is_gone_is_exported_with_its_own_precision_and_says_so(tmp_path, capsys):
    source, grid = tmp_path / "a.las", tmp_path / "grid"
    random_las(source, 5, point_format=7)
    kept = tmp_path / "kept.las"
    assert cli.main(["convert", str(source), "--out", str(grid)]) == 0
    shutil.copy(source, kept)
    export(grid, "--out", tmp_path / "whole.las")
    assert read_las(tmp_path / "whole.las").points.array.tobytes() == read_las(kept).points.array.tobytes()
    capsys.readouterr()
    source.unlink()
    export(grid, "--out", tmp_path / "b.las")
    told = capsys.readouterr().err
    assert "a.las cannot be read" in told and "as the grid has them" in told and told.count("\n") == 1
    assert read_las(tmp_path / "b.las").header.point_count == read_las(kept).header.point_count
    random_las(source, 6, point_format=7)
    export(grid, "--out", tmp_path / "c.las")
    assert "a.las has changed" in capsys.readouterr().err


def test_colours_are_the_file_s_unless_matched_exposures_are_asked_for(tmp_path):
    rng = np.random.default_rng(3)
    xyz = np.round(rng.random((20_000, 3)) * (8, 8, 0.01), 3)
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales = np.full(3, 0.001)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = rng.integers(30, 256, (3, len(xyz))) * 257
    black = rng.random(len(xyz)) < 0.2
    for name in ("red", "green", "blue"):
        las[name][black] = 0
    las.red[rng.random(len(xyz)) < 0.001] = 257  # nearly black: shown as missing colour beside so much black
    las.write(str(tmp_path / "a.laz"))
    scene = open_scene([tmp_path / "a.laz"], cache=False)
    assert scene.matched
    export(tmp_path / "a.laz", "--out", tmp_path / "b.laz")
    assert read_las(tmp_path / "b.laz").points.array.tobytes() == las.points.array.tobytes()
    export(tmp_path / "a.laz", "--exposures", "matched", "--out", tmp_path / "c.laz")
    shown, found = unpack(scene)[1], read_las(tmp_path / "c.laz")
    assert scene.records is not None
    order = np.argsort(scene.records.numbers(slice(None)))
    assert np.array_equal(np.stack([found.red, found.green, found.blue], axis=1), shown[order] * np.uint16(257))
    assert np.array_equal(found.xyz, las.xyz)


def test_files_of_a_place_that_clips_leave_out_are_not_read(tmp_path, seed, monkeypatch):
    monkeypatch.setattr(many_files, "BYTES_AS_ONE", 0)
    rng, files, read = np.random.default_rng(seed), [], []
    for number in range(3):
        xyz = rng.uniform(0, 4, (2_000, 3)) + np.array([10.0 * number, 0.0, 0.0])
        rgb = rng.integers(0, 65536, (2_000, 3), dtype=np.uint16)
        files.append(write_las(tmp_path / f"f{number}.las", xyz, rgb, source=rng.integers(1, 9, 2_000)))
    open_scene(files)
    blocks = LasSource._blocks_of
    monkeypatch.setattr(LasSource, "_blocks_of", lambda self, *given: read.append(self.path.name) or blocks(self, *given))
    assert cli.main(["export", *map(str, files), "--out", str(tmp_path / "part.las"), "--clip", "11,0,0,13,4,4"]) == 0
    assert set(read) == {"f1.las"}
    whole, part = read_las(files[1]), read_las(tmp_path / "part.las")
    kept = (whole.x >= 11) & (whole.x <= 13)
    assert 0 < kept.sum() < len(kept)
    for name in ("x", "y", "z", "red", "green", "blue", "intensity", "point_source_id"):
        np.testing.assert_array_equal(np.asarray(part[name]), np.asarray(whole[name])[kept])
