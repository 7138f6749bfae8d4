"""Picking against a brute-force search over all points, without a GPU; spacing and noise against what was put in."""

import numpy as np
import pytest
from cloud_files import write_las

from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.clip import box_around, contains
from pointglass.viewer.work.places.pick import nearest_pixel, pick, surface_around

ROOM = np.array([4.0, 5.0, 3.0])


def room_points(random, count: int, origin, noise: float = 0.0) -> np.ndarray:
    """Evenly spread over the six walls of a room whose lowest corner is at ``origin``."""
    areas = np.array([ROOM[1] * ROOM[2], ROOM[0] * ROOM[2], ROOM[0] * ROOM[1]]).repeat(2)
    wall = random.choice(6, count, p=areas / areas.sum())
    xyz = random.random((count, 3)) * ROOM
    axis = wall // 2
    xyz[np.arange(count), axis] = (wall % 2) * ROOM[axis] + noise * random.normal(size=count)
    return xyz + origin


@pytest.fixture(scope="module")
def room(tmp_path_factory):
    random = np.random.default_rng(7)
    xyz = room_points(random, 60_000, (512_000.0, 5_403_000.0, 300.0))
    path = write_las(tmp_path_factory.mktemp("room") / "room.las", xyz, random.integers(0, 65536, (len(xyz), 3)),
                     random.integers(0, 65536, len(xyz)), scale=1e-4)  # fmt: skip
    return open_scene([path], cache=False)


def random_camera(random, scene, size=(96, 72)):
    low, high = scene.bounds
    place = low + (0.2 + 0.6 * random.random(3)) * (high - low)
    return from_fov(*size, float(random.uniform(40, 80)), look_at(place, place + random.normal(size=3) * (1, 1, 0.3)))


def draw(camera, xyz) -> tuple[np.ndarray, np.ndarray]:
    """Depth (H, W) float32 of all points, and the number of the front one."""
    pixels, z = camera.project(xyz)
    with np.errstate(invalid="ignore"):
        seen = (z > 0) & (pixels >= 0).all(axis=1) & (pixels < (camera.width, camera.height)).all(axis=1)
    depth = np.full((camera.height, camera.width), np.inf, np.float32)
    column, row = np.floor(pixels[seen]).astype(int).T
    np.minimum.at(depth, (row, column), z[seen].astype(np.float32))
    return depth, seen


def test_the_picked_point_is_the_brute_force_nearest(room, seed):
    random = np.random.default_rng(seed)
    xyz, rgb, intensity, scan = unpack(room)
    picked = 0
    for _ in range(12):
        camera = random_camera(random, room)
        depth, _ = draw(camera, xyz)
        measured = np.isfinite(depth) & (random.random(depth.shape) < 0.5)
        pixels, z = camera.project(xyz)
        for _ in range(8):
            at = float(random.uniform(-3, 99)), float(random.uniform(-3, 75))
            found = pick(room, camera, measured, depth, at, radius=5.0)
            rows, columns = np.nonzero(measured)
            away = np.hypot(columns + 0.5 - at[0], rows + 0.5 - at[1])
            if len(away) == 0 or away.min() > 5.0:
                assert found is None
                continue
            assert found is not None
            picked += 1
            column, row = found.pixel
            assert measured[row, column]
            assert np.hypot(column + 0.5 - at[0], row + 0.5 - at[1]) == pytest.approx(away.min())
            front = depth[row, column]
            with np.errstate(invalid="ignore"):
                inside = (np.abs(pixels - (column + 0.5, row + 0.5)) <= 0.5).all(axis=1)
            inside &= (z > 0) & (z >= front * 0.999999) & (z <= max(front * 1.01, front + room.spacing))
            candidates = np.flatnonzero(inside)
            nearest = candidates[np.linalg.norm(pixels[candidates] - at, axis=1).argmin()]
            best = np.linalg.norm(pixels[nearest] - at)
            assert np.linalg.norm(pixels[found.index] - at) <= best + 1e-6  # one on the pixel's very edge may be nearer
            assert found.position == tuple(xyz[found.index]) and found.rgb == tuple(rgb[found.index])
            assert (found.intensity, found.scan) == (intensity[found.index], scan[found.index])
            assert found.distance == pytest.approx(np.linalg.norm(xyz[found.index] - camera.position))
    assert picked > 30


def test_filled_and_background_pixels_are_never_picked(room, seed):
    camera = random_camera(np.random.default_rng(seed), room)
    depth, _ = draw(camera, unpack(room)[0])
    assert pick(room, camera, np.zeros(depth.shape, bool), depth, (40.0, 30.0)) is None
    everywhere = np.ones(depth.shape, bool)
    assert pick(room, camera, everywhere, np.full_like(depth, np.inf), (40.0, 30.0)) is None


def test_a_part_of_the_picture_picks_the_same(room, seed):
    random = np.random.default_rng(seed)
    camera = random_camera(random, room)
    depth, _ = draw(camera, unpack(room)[0])
    measured = np.isfinite(depth)
    for _ in range(10):
        at = float(random.uniform(20, 70)), float(random.uniform(20, 50))
        left, top = int(at[0]) - 10, int(at[1]) - 10
        part = np.s_[top : top + 21, left : left + 21]
        whole = pick(room, camera, measured, depth, at)
        assert pick(room, camera, measured[part], depth[part], at, corner=(left, top)) == whole


def test_points_that_are_clipped_away_are_not_picked(room):
    low, high = room.bounds
    middle = (low + high) / 2
    camera = from_fov(96, 72, 60.0, look_at(middle, middle + (1, 0, 0)))
    xyz = unpack(room)[0]
    box = box_around(low, np.array([middle[0], high[1], high[2]]))
    depth, _ = draw(camera, xyz)
    assert pick(room, camera, np.isfinite(depth), depth, (48, 36), kept=lambda p, *_: contains([box], p)) is None
    assert pick(room, camera, np.isfinite(depth), depth, (48, 36)) is not None


def test_ties_go_to_the_nearer_surface():
    measured = np.ones((4, 4), bool)
    depth = np.full((4, 4), 5.0, np.float32)
    depth[1, 2] = 3.0
    assert nearest_pixel(measured, depth, (2.0, 2.0)) == (2, 1)


def test_spacing_and_noise_are_those_of_the_surface(tmp_path, seed):
    random = np.random.default_rng(seed)
    for noise, count in ((0.0, 60_000), (0.004, 60_000), (0.01, 15_000)):
        xyz = room_points(random, count, (0.0, 0.0, 0.0), noise)
        scene = open_scene([write_las(tmp_path / f"{noise}-{count}.las", xyz, scale=1e-5)], cache=False)
        area = 2 * (ROOM[0] * ROOM[1] + ROOM[1] * ROOM[2] + ROOM[0] * ROOM[2])
        middles = [(0.0, 2.5, 1.5), (4.0, 2.0, 1.2), (2.0, 2.5, 0.0), (2.2, 5.0, 1.4), (1.8, 0.0, 1.6), (2.0, 3.0, 3.0)]
        around = [surface_around(scene, middle) for middle in middles]
        assert np.mean([s.spacing for s in around]) == pytest.approx(np.sqrt(area / count), rel=0.2)
        assert np.mean([s.noise for s in around]) == pytest.approx(noise, rel=0.3, abs=1e-4)
        for surface, axis in zip(around, (0, 0, 2, 1, 1, 2)):
            assert abs(surface.normal[axis]) > 0.9


def test_a_place_without_points_has_no_spacing(room):
    surface = surface_around(room, room.bounds[1] + 1000.0)
    assert surface.count == 0 and np.isnan(surface.spacing)


def test_distances_and_areas_in_a_room_of_known_size(room, seed):
    """Corners are snapped to as a person would, by pointing at them; the room's edges are known."""
    from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
    from pointglass.viewer.work.measuring.values import evaluate

    random = np.random.default_rng(seed)
    low, high = np.array([512_000.0, 5_403_000.0, 300.0]), np.array([512_000.0, 5_403_000.0, 300.0]) + ROOM
    xyz = unpack(room)[0]

    def snapped(target) -> MeasuredPoint:
        place = (low + high) / 2 + random.uniform(-0.5, 0.5, 3)
        camera = from_fov(640, 480, 50.0, look_at(place, target))
        depth, _ = draw(camera, xyz)
        found = pick(room, camera, np.isfinite(depth), depth, (320.0, 240.0), radius=30.0)
        assert found is not None
        surface = surface_around(room, found.position)
        return MeasuredPoint(found.position, surface.spacing, surface.noise, found.station)

    def wall(axis: int, side: int) -> MeasuredPoint:
        """The middle of a wall."""
        target = (low + high) / 2
        target[axis] = (low, high)[side][axis]
        return snapped(target)

    for axis in range(3):
        result = evaluate(Measurement("distance", (wall(axis, 0), wall(axis, 1))))
        assert abs(result.value - ROOM[axis]) < room.spacing
        assert abs(result.value - ROOM[axis]) < result.uncertainty
    inset = 0.25  # of a rectangle drawn on the floor: its corners are snapped to floor points
    corners = [np.array([x, y, low[2]]) for x, y in ((low[0] + inset, low[1] + inset), (high[0] - inset, low[1] + inset),
               (high[0] - inset, high[1] - inset), (low[0] + inset, high[1] - inset))]  # fmt: skip
    result = evaluate(Measurement("area", tuple(snapped(corner) for corner in corners)))
    sides = ROOM[0] - 2 * inset, ROOM[1] - 2 * inset  # a corner lies at most one spacing off, by where the person stands
    assert result.value == pytest.approx(sides[0] * sides[1], abs=sum(sides) * room.spacing)
    assert result.residual < 1e-3
