"""Scans that a project has moved: every way to read their points gives the moved coordinates, exactly and in float64."""

import json
from pathlib import Path

import numpy as np
import pytest
from cloud_files import E57Scan, surface, write_e57, write_las, write_ply
from documents import random_motion
from format_files import some, write_pcd

from pointglass.viewer.cli import main
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.rigid_transform import Rows, moved_points, rigid, rotation_about, turned_directions
from pointglass.viewer.grid.cache import folder_of
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.preview import preview_scene
from pointglass.viewer.grid.records.file_records import FileRecords
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.readers.moved_source import MovedSource, move_of
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import moves_of, read_project, write_project

COUNT = 3000


def motion(random) -> Rows:
    while (found := random_motion(random)) is None:
        pass
    return found


def written(folder: Path, kind: str, seed: int) -> Path:
    xyz, rgb = surface(COUNT, seed)
    if kind == "e57":
        half = len(xyz) // 2
        pose = {"quaternion": (np.sqrt(0.5), 0, 0, np.sqrt(0.5)), "translation": (5.0, 6.0, 7.0)}
        scans = [E57Scan(xyz=xyz[:half], rgb=rgb[:half], **pose), E57Scan(xyz=xyz[half:], rgb=rgb[half:])]
        return write_e57(folder / "a.e57", scans)
    if kind == "ply":
        return write_ply(folder / "a.ply", xyz, rgb)
    if kind == "pcd":
        return write_pcd(folder / "a.pcd", some(COUNT, seed), "binary")
    if kind == "xyz":
        np.savetxt(folder / "a.xyz", np.column_stack([xyz, rgb]), fmt="%.6f %.6f %.6f %d %d %d")
        return folder / "a.xyz"
    return write_las(folder / f"a.{kind}", xyz, rgb)


@pytest.mark.parametrize("kind", ["las", "laz", "e57", "ply", "pcd", "xyz"])
def test_every_way_to_read_a_moved_scan_moves_its_points(tmp_path, seed, kind):
    random = np.random.default_rng(seed)
    transform = motion(random)
    path = written(tmp_path, kind, seed)
    own, moved = open_source(path), MovedSource(open_source(path), transform)
    plain = np.concatenate([chunk.xyz for chunk in own.chunks()])
    expected = moved_points(transform, plain)
    for found in ([chunk.xyz for chunk in moved.chunks()], [records.xyz for records in moved.record_chunks()],
                  [records.xyz for records in moved.column_chunks("xyz")]):
        assert np.array_equal(np.concatenate(found), expected)
    numbers = np.unique(random.integers(0, len(plain), 40))
    assert np.array_equal(moved.records(numbers).xyz, expected[numbers]) and len(own.records(numbers).xyz) == len(numbers)
    assert moved.has_quick_records == own.has_quick_records
    for before, after in zip(own.scans, moved.scans, strict=True):
        assert (before.position is None) == (after.position is None) and before.name == after.name
        if before.position is not None:
            assert after.position == pytest.approx(moved_points(transform, np.array([before.position]))[0])
    sampled = moved.sample(500, 50)
    if sampled is not None:
        places = {tuple(row) for row in expected.tolist()}
        assert all(tuple(row) in places for chunk in sampled for row in chunk.xyz.tolist())


def test_the_grid_its_records_and_the_preview_have_the_moved_coordinates(tmp_path, seed):
    random = np.random.default_rng(seed)
    transform = rigid(rotation_about(random.normal(size=3), random.uniform(-180, 180)), random.uniform(-1e5, 1e5, 3))
    xyz, rgb = surface(COUNT, seed)
    still = write_ply(tmp_path / "still.ply", xyz + 50.0, rgb)
    pose = {"quaternion": (1, 0, 0, 0), "translation": (0.5, 0.0, 1.0)}
    away = write_e57(tmp_path / "away.e57", [E57Scan(xyz=xyz - (0.5, 0.0, 1.0), rgb=rgb, **pose)])
    moves = moves_of((ScanFile(str(still)), ScanFile(str(away), transform=transform)))
    expected = np.concatenate([xyz + 50.0, moved_points(transform, xyz)])
    for cache in (True, True, False):  # built, then read from the cache, then in memory
        scene = open_scene([still, away], moves=moves, cache=cache)
        values = FileRecords(scene).of(slice(None))
        assert values.exact
        order = np.lexsort(values.xyz.T), np.lexsort(expected.T)
        np.testing.assert_allclose(values.xyz[order[0]], expected[order[1]], rtol=0, atol=1e-7)
        np.testing.assert_allclose(scene.bounds, [expected.min(axis=0), expected.max(axis=0)], atol=1e-6)
        assert scene.meta.scans[1].position == pytest.approx(moved_points(transform, np.array([[0.5, 0.0, 1.0]]))[0])
    coarse = preview_scene([still, away], moves=moves, least_bytes=0)
    assert coarse is not None
    np.testing.assert_allclose(coarse.bounds, [expected.min(axis=0), expected.max(axis=0)], atol=0.05)


def test_each_alignment_has_a_cache_of_its_own_and_scans_that_stay_keep_theirs(tmp_path, seed):
    random = np.random.default_rng(seed)
    paths = [write_ply(tmp_path / f"{name}.ply", *surface(50)) for name in "ab"]
    plain = folder_of(paths)
    assert folder_of(paths, moves={}) == plain and folder_of(paths, moves={str(tmp_path / "c.ply"): motion(random)}) == plain
    found = {plain, *(folder_of(paths, moves={str(path.resolve()): motion(random)}) for path in paths for _ in range(3))}
    assert len(found) == 7


def test_a_folder_of_scans_is_moved_as_one(tmp_path, seed):
    transform = motion(np.random.default_rng(seed))
    (tmp_path / "tiles").mkdir()
    tile = write_las(tmp_path / "tiles" / "a.las", *surface(50))
    moves = moves_of([ScanFile(str(tmp_path / "tiles"), transform=transform)])
    assert move_of(tile, moves) == transform
    assert move_of(write_las(tmp_path / "b.las", *surface(50)), moves) is None


def test_normals_turn_with_the_scan(tmp_path, seed):
    random = np.random.default_rng(seed)
    transform, normals = motion(random), random.normal(size=(100, 3)).astype(np.float32)
    names = [*((name, "<f8") for name in "xyz"), *((name, "<f4") for name in ("nx", "ny", "nz")),
             *((name, "u1") for name in ("red", "green", "blue"))]
    table = np.zeros(100, names)
    for axis, name in enumerate(("nx", "ny", "nz")):
        table[name], table["xyz"[axis]] = normals[:, axis], random.normal(size=100)
    words = {"<f8": "double", "<f4": "float", "u1": "uchar"}
    head = "".join(f"property {words[kind]} {name}\n" for name, kind in names)
    path = tmp_path / "n.ply"
    path.write_bytes(f"ply\nformat binary_little_endian 1.0\nelement vertex 100\n{head}end_header\n".encode() + table.tobytes())
    source = MovedSource(open_source(path), transform)
    expected = turned_directions(transform, normals)
    for records in (next(source.record_chunks()), next(source.column_chunks("ny")), source.records(np.arange(100))):
        for axis, name in enumerate(("nx", "ny", "nz")):
            if name in records.columns:
                assert records.columns[name].dtype == np.float32
                np.testing.assert_allclose(records.columns[name], expected[:, axis], atol=1e-6)
        assert "ny" in records.columns


def test_float32_near_its_own_zero_is_not_called_coarse_at_map_coordinates(tmp_path):
    path = write_pcd(tmp_path / "a.pcd", some(COUNT, origin=(0.0, 0.0, 0.0)), "binary", real="f4")
    assert open_source(path).precision == 2.0**-24
    far = rigid(np.eye(3), np.array([500_000.0, 5_400_000.0, 300.0]))
    scene = open_scene(path, moves={str(path.resolve()): far}, cache=False)
    assert not [text for text in scene.meta.warning_texts if "too few digits" in text]


def test_a_grid_made_by_convert_is_not_moved(tmp_path, seed):
    scan = write_las(tmp_path / "a.las", *surface(COUNT))
    assert main(["convert", str(scan), "--out", str(tmp_path / "grid")]) == 0
    with pytest.raises(InputError, match="made by convert cannot be moved"):
        open_scene(tmp_path / "grid", moves={str((tmp_path / "grid").resolve()): motion(np.random.default_rng(seed))})


def test_a_project_keeps_transformations_and_info_shows_the_moved_bounds(tmp_path, capsys):
    xyz, rgb = surface(COUNT)
    scan, project = write_las(tmp_path / "a.las", xyz, rgb), tmp_path / "p.pointglass"
    transform = rigid(rotation_about(np.array([0.0, 0, 1]), 90.0), np.array([100.0, 200.0, 5.0]))
    document = Document((ScanFile(str(scan), transform=transform),))
    write_project(project, document)
    assert read_project(project) == document
    assert main(["info", "--json", str(project)]) == 0
    facts = json.loads(capsys.readouterr().out)
    expected = moved_points(transform, xyz)
    np.testing.assert_allclose([facts["bounds"]["min"], facts["bounds"]["max"]], [expected.min(axis=0), expected.max(axis=0)],
                               atol=1e-3)
    assert facts["moves"] == [[list(row) for row in transform]]
    assert main(["info", str(project)]) == 0
    middle = np.mean([expected.min(axis=0), expected.max(axis=0)], axis=0)  # the shift is that of the scene's middle
    before = np.array([[0.0, 1, 0], [-1, 0, 0], [0, 0, 1]]) @ (middle - [100.0, 200.0, 5.0])
    (line,) = [line for line in capsys.readouterr().out.splitlines() if line.startswith("moved")]
    assert line.startswith("moved    a.las: turned 90.0000 degrees, shifted by ")
    assert line.endswith(" at the middle, by the project")
    stated = [float(value) for value in line.split(" by ", 1)[1].split(" at the middle")[0].split(", ")]
    np.testing.assert_allclose(stated, middle - before, atol=2e-3)


def test_a_project_without_moved_scans_is_written_as_before_and_a_crooked_matrix_is_refused(tmp_path):
    project = tmp_path / "p.pointglass"
    write_project(project, Document((ScanFile(str(tmp_path / "a.las")),)))
    assert "transform" not in project.read_text()
    data = json.loads(project.read_text())
    for wrong in ([[2, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]], [[1, 0, 0], [0, 1, 0]], "x",
                  [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]):  # fmt: skip
        data["document"]["scans"][0]["transform"] = wrong
        project.write_text(json.dumps(data))
        with pytest.raises(InputError, match="transform"):
            read_project(project)
