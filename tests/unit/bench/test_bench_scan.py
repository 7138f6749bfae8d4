"""What the benches look at, a procedural scan, and from where: eight views with names and a smooth path."""

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest
from bench_run import SIZE, four_rooms

from pointglass.viewer.bench.procedural_scan import PITCH, ProceduralScan, procedural_scene
from pointglass.viewer.common.paths import assets_dir
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.preprocess.scan_description import ScanDescription
from pointglass.viewer.work.cameras.camera_files import read_cameras
from pointglass.viewer.work.places import viewpoints as views


@pytest.fixture(scope="module")
def seed() -> int:
    return int(np.random.SeedSequence().generate_state(1)[0] % 1_000_000)


@pytest.fixture(scope="module")
def small():
    return four_rooms()


def test_scan_has_the_points_asked_for_and_lies_in_its_rooms(seed):
    for points, rooms in ((2, 1), (6, 3), (12_345, 3), (50_001, 7)):
        scan = ProceduralScan(points, rooms, seed)
        chunks = list(scan.chunks())
        xyz = np.concatenate([chunk.xyz for chunk in chunks])
        assert xyz.shape == (points, 3), f"seed {seed}"
        corner = np.array([scan.columns, math.ceil(rooms / scan.columns), 1]) * PITCH
        assert (xyz > -0.02).all() and (xyz < corner + 0.02).all(), f"seed {seed}"


def test_scan_depends_on_seed_alone_and_not_on_how_it_is_cut(seed):
    scan, other = ProceduralScan(20_000, 2, seed), ProceduralScan(20_000, 2, seed + 1)
    xyz, rgb = scan.points(0, 20_000)
    again = ProceduralScan(20_000, 2, seed).points(0, 20_000)
    assert np.array_equal(xyz, again[0]) and np.array_equal(rgb, again[1]), f"seed {seed}"
    assert not np.array_equal(xyz, other.points(0, 20_000)[0])
    cuts = [0, 1, 777, 9_999, 10_000, 10_001, 20_000]
    parts = [scan.points(a, b) for a, b in itertools.pairwise(cuts)]
    assert np.array_equal(np.concatenate([p[0] for p in parts]), xyz), f"seed {seed}"
    assert np.array_equal(np.concatenate([p[1] for p in parts]), rgb), f"seed {seed}"


def test_every_ray_stops_at_the_first_thing_in_its_way(seed):
    """Against a plain walk along each ray in small steps through the same boxes and walls."""
    scan = ProceduralScan(3_000, 1, seed)  # one room: no doors
    xyz, _ = scan.points(0, 3_000)
    eye = np.where(np.arange(3_000)[:, None] < 1_500, scan.station(0), scan.station(1))
    away = xyz - eye
    far = np.linalg.norm(away, axis=1, keepdims=True)
    boxes = scan._boxes[0]
    steps = (np.arange(0.0, 1.0, 0.002) * (far - 0.02) / far)[:, :, None] * away[:, None] + eye[:, None]
    within = np.zeros(len(xyz), bool)
    for box in boxes:
        within |= ((steps > box[:3] + 0.01) & (steps < box[3:] - 0.01)).all(axis=2).any(axis=1)
    assert not within.any(), f"seed {seed}: {within.sum()} rays pass through furniture"
    reached = xyz[:, None]
    on_box = ((reached > boxes[:, :3] - 0.02) & (reached < boxes[:, 3:] + 0.02)).all(axis=2).any(axis=1)
    low, high = np.array([0.1, 0.1, 0.0]), PITCH - (0.1, 0.1, 0.0)
    on_wall = ((np.abs(xyz - low) < 0.02) | (np.abs(xyz - high) < 0.02)).any(axis=1)
    assert (on_box | on_wall).all(), f"seed {seed}: {(~(on_box | on_wall)).sum()} points float"
    assert on_box.any() and on_wall.any()


def test_density_falls_with_distance(seed):
    scan = ProceduralScan(100_000, 1, seed)
    xyz, _ = scan.points(0, 50_000)
    ceiling = xyz[xyz[:, 2] > PITCH[2] - 0.01]
    away = np.linalg.norm(ceiling[:, :2] - scan.station(0)[:2], axis=1)
    near, far = ((away > a) & (away < b) for a, b in ((0.4, 0.8), (1.6, 1.7)))
    assert near.sum() / (0.8**2 - 0.4**2) > 2 * far.sum() / (1.7**2 - 1.6**2), f"seed {seed}"


def test_stations_see_through_doors(seed):
    scan = ProceduralScan(40_000, 2, seed)
    xyz, _ = scan.points(0, 20_000)  # the first room's stations
    share = (xyz[:, 0] > PITCH[0] + 0.1).mean()
    assert 0 < share < 0.2, f"seed {seed}"


def test_written_to_a_folder_it_is_the_same_scene_and_opens_like_any_other(tmp_path, small):
    scan, scene = small
    made = procedural_scene(scan, tmp_path / "grid")
    opened = open_scene(tmp_path / "grid")
    assert made.count == opened.count == scene.count == 60_000
    assert np.array_equal(opened.points, scene.points) and np.array_equal(opened.offsets, scene.offsets)
    assert opened.meta.sources == ("procedural scan, 60,000 points, 4 rooms, seed 3",)


def test_eight_views_with_names_see_points_and_the_corner_sees_most(small):
    scan, scene = small
    made = views.named_views(scene, (320, 240))
    names = [camera.name for camera in made]
    assert len(names) == len(set(names)) == 8 and {"corner", "far", "down", "close", "place-ahead"} <= set(names)
    xyz = unpack(scene)[0]
    held = {camera.name: views.in_picture(camera, xyz) for camera in made}
    assert min(held.values()) > 0, held
    assert held["corner"] > 0.7 * scene.count and held["far"] > 0.98 * scene.count, held
    place = next(camera for camera in made if camera.name == "place-ahead").position
    assert np.allclose(place, scan.station(2 * scan.middle_room)), "a scan with a scanner's position is seen from there"


def test_the_demo_has_the_shipped_views(small):
    """Told by its file: here another scene that says it came from there."""
    scene = replace(small[1], meta=ScanDescription((str((assets_dir() / "demo.laz").absolute()),)))
    shipped = read_cameras(assets_dir() / "demo_cameras.json")
    made = views.named_views(scene, (480, 360))
    assert [camera.name for camera in made] == [camera.name for camera in shipped]
    assert all(np.array_equal(a.position, b.position) and (a.width, a.height) == (480, 360)
               for a, b in zip(made, shipped, strict=True))
    assert_smooth(views.camera_path(scene, SIZE), reach=10.0)


def assert_smooth(path, reach: float) -> None:
    """48 different cameras; no step is much longer than those beside it, none turns by more than 30 degrees."""
    assert len(path) == views.PATH_FRAMES and len({camera.name for camera in path}) == len(path)
    places = np.stack([camera.position for camera in path])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert steps.sum() > 0.02 * reach and steps.max() < 0.15 * reach
    assert np.abs(np.diff(steps)).max() < 0.6 * steps.max()
    ahead = np.stack([camera.forward for camera in path])
    turns = np.degrees(np.arccos(np.clip((ahead[1:] * ahead[:-1]).sum(axis=1), -1, 1)))
    assert turns.max() < 30.0 and np.abs(np.diff(turns)).max() < 15.0


def test_the_path_is_smooth_and_fixed(small):
    _, scene = small
    path = views.camera_path(scene, SIZE)
    assert_smooth(path, reach=float(np.linalg.norm(np.ptp(scene.bounds, axis=0))))
    assert all(np.array_equal(a.camera_to_world, b.camera_to_world)
               for a, b in zip(path, views.camera_path(scene, SIZE), strict=True))
    xyz = unpack(scene)[0]
    assert min(views.in_picture(camera, xyz) for camera in path) > 0


def test_a_thing_in_a_void_is_walked_around():
    from pointglass.viewer.grid.open_scene import scene_from_arrays

    rng = np.random.default_rng(5)
    ball = rng.normal(size=(20_000, 3))
    ball = 0.4 * ball / np.linalg.norm(ball, axis=1, keepdims=True) + (100.0, 200.0, 5.0)
    scene = scene_from_arrays(ball, np.full(ball.shape, 128, np.uint8))
    made = views.named_views(scene, (320, 240))
    assert {"around-ahead", "around-left", "corner"} <= {camera.name for camera in made}
    for camera in [*made, *views.camera_path(scene, SIZE)]:
        assert views.in_picture(camera, ball) > 0, camera.name
    assert_smooth(views.camera_path(scene, SIZE), reach=0.8)


def test_in_picture_counts_what_a_pinhole_shows():
    camera = from_fov(100, 100, 90.0, look_at((0, 0, 0), (0, 1, 0)))
    points = np.array([(0, 1, 0), (0.99, 1, 0), (1.01, 1, 0), (0, -1, 0), (0, 1, 1.01), (0, 5, 4.9)])
    assert views.in_picture(camera, points) == 3
