"""``pointglass export``: what is written is what was measured and in sight, and is read back as it was."""

from dataclasses import replace

import numpy as np
import pytest
from untyped import read_las

from pointglass.viewer import cli
from pointglass.viewer.commands.exporting.command import export
from pointglass.viewer.commands.exporting.targets import TARGETS
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene, scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.clip import Box, contains
from pointglass.viewer.preprocess.scan_description import ScanSummary
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import write_project
from pointglass.viewer.work.selection import Selection, clips_of, parse_box


def cloud(seed, count=30_000, origin=(0.0, 0.0, 0.0), size=12.0, scans=2):
    rng = np.random.default_rng(seed)
    flat = rng.uniform(0, size, (count, 2))
    xyz = np.column_stack([flat, np.sin(flat[:, 0])]) + origin
    # levels from 40: the darkest are taken for missing colour where they are frequent
    return (xyz, rng.integers(40, 256, (count, 3), dtype=np.uint8), rng.integers(0, 65536, count).astype(np.uint16),
            rng.integers(0, scans, count).astype(np.uint8))


def random_scene(seed, **options):
    xyz, rgb, intensity, scan = cloud(seed, **options)
    return scene_from_arrays(xyz, rgb, intensity=intensity, scan=scan)


def rows(scene, keep=None):
    """Every point's coordinates and attributes, in one order."""
    xyz, rgb, intensity, _ = unpack(scene)
    table = np.column_stack([xyz, rgb, intensity])
    table = table if keep is None else table[keep]
    return table[np.lexsort(table.T)]


@pytest.mark.parametrize("suffix", TARGETS)
@pytest.mark.parametrize(("seed", "origin", "size"), [(1, (0, 0, 0), 12.0), (2, (636_000.0, 5_848_000.0, 400.0), 900.0)])
def test_an_export_opened_again_holds_exactly_the_points(tmp_path, suffix, seed, origin, size):
    scene = random_scene(seed, origin=origin, size=size)
    out = tmp_path / f"all{suffix}"
    assert export(Selection(scene), out) == scene.count
    again = open_scene([out], cache=False, match=False)
    a, b = rows(scene), rows(again)
    assert a.shape == b.shape
    # both grids round to their own steps; the file itself keeps the grid's numbers (below)
    assert np.abs(a[:, :3] - b[:, :3]).max() <= again.step
    assert np.array_equal(a[:, 3:6], b[:, 3:6])
    if suffix != ".e57":  # the reader scales an E57's intensity by its own limits
        assert np.array_equal(a[:, 6], b[:, 6])
    assert list(tmp_path.iterdir()) == [out]


def test_las_keeps_coordinates_as_decimals_and_tells_the_stations_apart(tmp_path):

    xyz, rgb, intensity, station = cloud(3)
    xyz = np.round(xyz, 4)
    export(Selection(scene_from_arrays(xyz, rgb, intensity=intensity, scan=station)), tmp_path / "a.laz")
    las = read_las(tmp_path / "a.laz")
    assert las.header.scales.tolist() == [1e-4] * 3
    assert np.array_equal(np.round(las.xyz, 4), xyz)
    assert np.array_equal(np.column_stack([las.red, las.green, las.blue]), rgb * np.uint16(257))
    assert np.array_equal(las.intensity, intensity) and np.array_equal(las.point_source_id, station.astype(int) + 1)


def test_a_clip_leaves_the_points_inside_any_of_its_boxes(tmp_path):
    scene = random_scene(4)
    clips = clips_of(["1,1,-2,4,5,2", "6.5,0,-2,7,12,2"])
    out = tmp_path / "part.ply"
    count = export(Selection(scene, clips), out)
    keep = contains(clips, unpack(scene)[0])
    assert 0 < count == keep.sum() < scene.count
    again = open_scene([out], cache=False, match=False)
    a, b = rows(scene, keep), rows(again)
    assert a.shape == b.shape and np.array_equal(np.sort(a[:, 6]), np.sort(b[:, 6]))
    assert np.abs(a[:, :3] - b[:, :3]).max() <= again.step


def test_e57_keeps_each_station_and_where_it_stood(tmp_path):
    scene = random_scene(5, scans=3)
    scans = tuple(ScanSummary(f"tripod {i}", 0, (2.0 * i, 1.0, 0.5)) for i in range(3))
    scene = replace(scene, meta=replace(scene.meta, scans=scans))
    export(Selection(scene), tmp_path / "a.e57")
    again = open_scene([tmp_path / "a.e57"], cache=False, match=False)
    assert np.allclose(again.station_places, [(2.0 * i, 1.0, 0.5) for i in range(3)])
    assert [scan.name for scan in again.meta.scans] == ["tripod 0", "tripod 1", "tripod 2"]
    assert np.array_equal(np.bincount(unpack(again)[3]), np.bincount(unpack(scene)[3]))


@pytest.mark.parametrize("text", ["1,2,3", "a,b,c,d,e,f", "1,1,1,0,2,2", "0,0,0,1,1,inf"])
def test_a_box_that_is_none_is_refused(text):
    with pytest.raises(InputError, match="--clip"):
        parse_box(text)


def test_nothing_is_left_where_nothing_can_be_written(tmp_path, capsys, monkeypatch):
    scene = random_scene(6)
    with pytest.raises(InputError, match="leave no point"):
        export(Selection(scene, clips_of(["100,100,100,101,101,101"])), tmp_path / "a.laz")

    def full(*_arguments, **_options):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pointglass.viewer.commands.exporting.formats.las_writer._Plan.fill", full)
    with pytest.raises(InputError, match="No space left"):
        export(Selection(scene), tmp_path / "a.laz")
    assert list(tmp_path.iterdir()) == []
    assert cli.main(["export", str(tmp_path / "none.laz"), "--out", str(tmp_path / "a.xyz")]) == 2
    assert "ending in" in capsys.readouterr().err


def test_a_scan_is_not_written_over_itself(tmp_path):
    scene = random_scene(7)
    export(Selection(scene), tmp_path / "a.ply")
    again = open_scene([tmp_path / "a.ply"], cache=False)
    with pytest.raises(InputError, match="is the scan itself"):
        export(Selection(again), tmp_path / "a.ply")


@pytest.mark.parametrize("seed", [21, 22])
def test_a_project_is_exported_as_it_is_seen(tmp_path, seed):
    """Its clips, hidden stations and ``--clip``: the file holds exactly the points in sight, with their attributes."""
    sources = [tmp_path / "one.laz", tmp_path / "two.laz", tmp_path / "three.laz"]
    clouds = [cloud(seed + 10 * number, count=8_000, scans=1) for number in range(3)]
    for (points, rgb, intensity, _), source in zip(clouds, sources, strict=True):
        export(Selection(scene_from_arrays(np.round(points, 4), rgb, intensity=intensity)), source)
    keeps = Box((5.0, 6.0, 0.0), (3.5, 4.0, 2.0))
    removes = Box((5.0, 6.0, 0.0), (1.0, 1.0, 2.0), removes=True)
    project, hidden = tmp_path / "work.pointglass", (1,)
    scans = (*(ScanFile(str(source)) for source in sources[:2]), ScanFile(str(sources[2]), visible=False))
    write_project(project, Document(scans, hidden_stations=hidden, clips=(keeps, removes)))
    out = tmp_path / "seen.ply"
    assert cli.main(["export", str(project), "--out", str(out), "--no-cache", "--exposures", "as-scanned",
                     "--clip", "0,0,-9,9,7,9"]) == 0
    table = np.concatenate([np.column_stack([np.round(points, 4), rgb, intensity]) for points, rgb, intensity, _ in clouds[:2]])
    xyz, station = table[:, :3], np.repeat([0, 1], 8_000)
    keep = (np.abs(xyz - keeps.centre) <= keeps.half).all(1) & ~(np.abs(xyz - removes.centre) <= removes.half).all(1)
    keep &= ((xyz >= (0, 0, -9)) & (xyz <= (9, 7, 9))).all(1) & ~np.isin(station, hidden)
    import plyfile

    rows_ = plyfile.PlyData.read(str(out))["vertex"].data
    found = np.column_stack([rows_[name] for name in ("x", "y", "z", "red", "green", "blue", "intensity")])
    assert 0 < keep.sum() < (station == 0).sum() < len(table)
    found[:, :3] = np.round(found[:, :3], 4)
    assert np.array_equal(found, table[keep])  # in file order


def test_a_project_beside_a_scan_is_refused(tmp_path, capsys):
    assert cli.main(["export", str(tmp_path / "a.pointglass"), str(tmp_path / "b.las"), "--out", str(tmp_path / "c.laz")]) == 2
    assert "opened by itself" in capsys.readouterr().err
