"""Exports of projects with moved scans, read back with the formats' own libraries."""

from pathlib import Path

import laspy
import numpy as np
import pye57
import pytest
from cloud_files import E57Scan, surface, write_e57, write_las, write_ply
from e57_photo_files import AWAY, pinhole, room_points, write_photos
from las_files import random_las

from pointglass.viewer import cli
from pointglass.viewer.common.rigid_transform import Rows, moved_points, rigid, rotation_about
from pointglass.viewer.readers.e57.e57_photographs import posed_photographs
from pointglass.viewer.readers.formats import open_source
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import write_project

COUNT = 2000


def motion(random, reach: float = 1000.0) -> Rows:
    return rigid(rotation_about(random.normal(size=3), random.uniform(-180, 180)), random.uniform(-reach, reach, 3))


def project(folder: Path, *scans: tuple[Path, Rows | None]) -> Path:
    path = folder / "p.pointglass"
    write_project(path, Document(tuple(ScanFile(str(file), transform=transform) for file, transform in scans)))
    return path


def export(source: Path, out: Path, *more: str) -> None:
    assert cli.main(["export", "--no-cache", str(source), "--out", str(out), *more]) == 0


def points_of(path: Path) -> np.ndarray:
    """(n, 3) by laspy, pye57 or, of PLY, the reader here."""
    if path.suffix in (".las", ".laz"):
        return np.asarray(laspy.read(path).xyz)
    if path.suffix == ".e57":
        file = pye57.E57(str(path))
        found = [file.read_scan(number, ignore_missing_fields=True) for number in range(file.scan_count)]
        file.close()
        return np.concatenate([np.column_stack([scan[f"cartesian{axis}"] for axis in "XYZ"]) for scan in found])
    return np.concatenate([chunk.xyz for chunk in open_source(path).chunks()])


@pytest.mark.parametrize("to", ["las", "laz", "e57", "ply"])
@pytest.mark.parametrize("kind", ["las", "e57", "ply"])
def test_every_format_gets_the_moved_coordinates(tmp_path, seed, kind, to):
    random = np.random.default_rng(seed)
    (xyz, rgb), transform = surface(COUNT, seed), motion(random)
    pose = {"quaternion": (np.sqrt(0.5), 0, 0, np.sqrt(0.5)), "translation": (5.0, 6.0, 7.0)}
    scan = {"las": lambda: write_las(tmp_path / "a.las", xyz, rgb), "ply": lambda: write_ply(tmp_path / "a.ply", xyz, rgb),
            "e57": lambda: write_e57(tmp_path / "a.e57", [E57Scan(xyz=xyz, rgb=rgb, **pose)])}[kind]()
    expected = moved_points(transform, points_of(scan))
    export(project(tmp_path, (scan, transform)), tmp_path / f"out.{to}")
    np.testing.assert_allclose(points_of(tmp_path / f"out.{to}"), expected, rtol=0, atol=2e-4)


@pytest.mark.parametrize("to", ["las", "laz"])
def test_las_keeps_whole_records_besides_their_places(tmp_path, seed, to, capsys):
    """Every dimension and record of the file; the scale stays, the offset changes where 32 bits would not reach."""
    random = np.random.default_rng(seed)
    scan = tmp_path / "a.las"
    random_las(scan, seed, point_format=int(random.choice([3, 6, 7, 8])))
    before, far = laspy.read(scan), random.random() < 0.5
    reach = 2e3 if not far else 5e7
    middle = before.xyz.mean(axis=0)
    rotation = rotation_about(random.normal(size=3), random.uniform(-180, 180))
    transform = rigid(rotation, random.uniform(-reach, reach, 3) - rotation @ middle)
    export(project(tmp_path, (scan, transform)), tmp_path / f"out.{to}")
    after = laspy.read(tmp_path / f"out.{to}")
    scale = before.header.scales.min()
    assert (after.header.scales == scale).all()
    np.testing.assert_allclose(after.xyz, moved_points(transform, before.xyz), rtol=0, atol=0.5001 * scale + 1e-8)
    np.testing.assert_allclose(after.header.mins, after.xyz.min(axis=0), atol=1e-7)
    for name in before.point_format.dimension_names:
        if name not in "XYZ":
            assert np.array_equal(after[name], before[name]), name
    assert "rounded to" in capsys.readouterr().err


def test_a_moved_las_and_one_that_stays_become_one_exactly_where_it_stays(tmp_path, seed):
    random = np.random.default_rng(seed)
    (xyz, rgb), transform = surface(COUNT, seed), motion(random)
    still, away = write_las(tmp_path / "a.las", xyz + 100.0, rgb), write_las(tmp_path / "b.las", xyz, rgb)
    export(project(tmp_path, (still, None), (away, transform)), tmp_path / "out.laz")
    found = points_of(tmp_path / "out.laz")
    assert np.array_equal(found[:COUNT], xyz + 100.0)
    np.testing.assert_allclose(found[COUNT:], moved_points(transform, xyz), rtol=0, atol=0.51 / 4096)


def test_e57_poses_are_multiplied_and_records_stay(tmp_path, seed, capsys):
    random = np.random.default_rng(seed)
    (xyz, rgb), transform = surface(COUNT, seed), motion(random)
    pose = {"quaternion": (0.5, 0.5, -0.5, 0.5), "translation": (5.0, 6.0, 7.0)}
    scan = write_e57(tmp_path / "a.e57", [E57Scan(xyz=xyz, rgb=rgb, **pose), E57Scan(xyz=xyz, rgb=rgb, spherical=True)])
    export(project(tmp_path, (scan, transform)), tmp_path / "out.e57")
    before, after = pye57.E57(str(scan)), pye57.E57(str(tmp_path / "out.e57"))
    for number in range(2):
        raw = [file.read_scan_raw(number) for file in (before, after)]
        assert all(np.array_equal(raw[0][name], raw[1][name]) for name in raw[0])
    place = after.get_header(0)
    np.testing.assert_allclose(place.translation, moved_points(transform, np.array([[5.0, 6.0, 7.0]]))[0], atol=1e-9)
    before.close()
    after.close()
    np.testing.assert_allclose(points_of(tmp_path / "out.e57"), moved_points(transform, points_of(scan)), atol=1e-8)
    assert "1 scan without a scanner position got a pose" in capsys.readouterr().err


def test_photographs_of_a_moved_e57_stand_at_their_new_places(tmp_path, seed):
    transform = motion(np.random.default_rng(seed))
    scan = write_photos(tmp_path / "a.e57", [pinhole(AWAY, 0.3)], *room_points(COUNT))
    export(project(tmp_path, (scan, transform)), tmp_path / "out.e57")
    (before,), _ = posed_photographs(scan)
    (after,), _ = posed_photographs(tmp_path / "out.e57")
    np.testing.assert_allclose(after.camera_to_world, np.array(transform) @ before.camera_to_world, atol=1e-9)


@pytest.mark.parametrize("kind", ["las", "e57"])
def test_clips_are_at_the_places_of_the_document(tmp_path, seed, kind):
    random = np.random.default_rng(seed)
    (xyz, rgb), transform = surface(COUNT, seed), motion(random)
    scan = (write_las(tmp_path / "a.las", xyz, rgb) if kind == "las"
            else write_e57(tmp_path / "a.e57", [E57Scan(xyz=xyz, rgb=rgb)]))  # fmt: skip
    moved = moved_points(transform, xyz)
    low, high = moved[0] - 1.0, moved[0] + 1.0
    box = f"--clip={','.join(map(repr, [*low.tolist(), *high.tolist()]))}"
    export(project(tmp_path, (scan, transform)), tmp_path / f"out.{kind}", box)
    inside = (moved <= high).all(axis=1) & (moved >= low).all(axis=1)
    assert len(points_of(tmp_path / f"out.{kind}")) == inside.sum() > 0
