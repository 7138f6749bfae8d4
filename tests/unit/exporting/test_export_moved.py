"""Exports of projects with moved scans, read back with the formats' own libraries."""

from pathlib import Path

import laspy
import numpy as np
import pye57
import pytest
from cloud_files import E57Scan, surface, write_e57, write_las, write_ply

from pointglass.viewer import cli
from pointglass.viewer.common.rigid_transform import Rows, moved_points, rigid, rotation_about
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
