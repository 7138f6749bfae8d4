"""The first picture of a scan, as a window begins with it: not of a wall of single dots where more was measured elsewhere."""

import numpy as np
import pytest
from window_session import session

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.camera import from_fov
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary
from pointglass.viewer.window.flight.framing import from_outside
from pointglass.viewer.window.flight.start_viewpoint import start_camera, survey
from pointglass.viewer.window.session.loading import Loaded
from pointglass.viewer.work.places.standing_place import FIELD_OF_VIEW


@pytest.fixture
def rng(seed):
    return np.random.default_rng(seed)


def box(rng, count, low, high):
    """Points on the inside of a box."""
    low, high = np.array(low, float), np.array(high, float)
    extent = high - low
    area = np.array([extent[(k + 1) % 3] * extent[(k + 2) % 3] for k in range(3)] * 2)
    side = rng.choice(6, count, p=area / area.sum())
    points = rng.random((count, 3)) * extent + low
    points[np.arange(count), side % 3] = np.where(side < 3, low[side % 3], high[side % 3])
    return points


def scene_of(points, scans=()):
    tiles = np.floor(points / 0.4).astype(int).sum(axis=1) % 2
    rgb = np.repeat((90 + 80 * tiles).astype(np.uint8)[:, None], 3, axis=1)
    return scene_from_arrays(points, rgb, meta=ScanDescription(metres_per_unit=1.0, scans=scans), noise=False)


def corridor(rng):
    return box(rng, 60_000, (0, 0, 0), (20, 1.8, 2.6))


def two_rooms(rng):
    points = np.concatenate([box(rng, 15_000, (0, 0, 0), (6, 6, 3)), box(rng, 60_000, (6.2, 0, 0), (12, 6, 3))])
    door = (np.abs(points[:, 0] - 6.1) < 0.15) & (np.abs(points[:, 1] - 3) < 0.5) & (points[:, 2] < 2.1)
    return points[~door]


def street(rng):
    front = np.stack([rng.uniform(0, 60, 40_000), np.zeros(40_000), rng.uniform(0, 9, 40_000)], axis=1)
    ground = np.stack([rng.uniform(0, 60, 40_000), rng.uniform(0, 10, 40_000), rng.normal(0, 0.01, 40_000)], axis=1)
    return np.concatenate([front, front * (1, 1, 0.8) + (0, 10, 0), ground])


@pytest.mark.parametrize("place", [corridor, two_rooms, street])
@pytest.mark.parametrize("share", [1.0, 0.1])
def test_the_first_picture_is_never_taken_inside_a_wall_or_before_one_at_arms_length(place, share, rng):
    points = place(rng)
    scene = scene_of(points[rng.random(len(points)) < share])
    camera = start_camera(scene, 640, 480)
    pixels, depth = camera.project(points)
    inside = (depth > 0) & (pixels >= 0).all(axis=1) & (pixels < (640, 480)).all(axis=1)
    assert np.median(depth[inside]) > 1.0 and (depth[inside] < 0.5).mean() < 0.2
    assert np.linalg.norm(points - camera.position, axis=1).min() > 0.1
    assert camera.up[2] > 0.6, "upright; from outside it looks down at 0.85 radians at most"


def test_the_first_picture_of_a_room_with_a_dense_and_a_sparse_half_shows_the_dense_half(rng):
    points = box(rng, 500_000, (0, 0, 0), (12, 6, 3))
    points = points[(points[:, 0] > 6) | (rng.random(len(points)) < 0.01)]
    camera = start_camera(scene_of(points), 640, 480)
    pixels, depth = camera.project(points)
    inside = (depth > 0) & (pixels >= 0).all(axis=1) & (pixels < (640, 480)).all(axis=1)
    assert camera.position[0] > 5 and (points[inside, 0] > 6).mean() > 0.95
    assert inside.sum() > 0.2 * len(points)


def test_a_scanner_far_outside_the_points_is_no_place_to_stand(rng):
    scans = (ScanSummary("far", 40_000, (400.0, 300.0, 1.5)),)
    camera = start_camera(scene_of(box(rng, 40_000, (0, 0, 0), (8, 6, 3)), scans), 640, 480)
    assert (camera.position > 0.1).all() and (camera.position < (7.9, 5.9, 2.9)).all()


def test_the_same_scan_begins_with_the_same_viewpoint_in_a_window_of_any_shape(rng):
    points = two_rooms(rng)
    first = start_camera(scene_of(points), 640, 480)
    again = start_camera(scene_of(points), 1280, 480)
    assert np.array_equal(first.camera_to_world, again.camera_to_world)


def test_a_window_begins_with_that_picture(rng):
    points = box(rng, 200_000, (0, 0, 0), (12, 6, 3))
    scene = scene_of(points[(points[:, 0] > 6) | (rng.random(len(points)) < 0.01)])
    made, _ = session()
    made.accept(Loaded(scene, survey(scene)))
    assert np.allclose(made.camera.position, start_camera(scene, 640, 400).position)


def test_a_house_through_whose_windows_a_street_was_scanned_is_framed_without_the_street(rng):
    house, street = box(rng, 6_000, (0, 0, 0), (12, 10, 9)), rng.random((700, 3)) * (90, 240, 25) - (40, 120, 0)
    scene = scene_of(np.concatenate([house, street]))
    camera = from_fov(640, 480, FIELD_OF_VIEW, from_outside(survey(scene), 640 / 480, 1.0).camera_to_world)
    pixels, depth = camera.project(house)
    assert (depth > 0).all() and (pixels >= 0).all() and (pixels < (640, 480)).all(), "all of the house is in the picture"
    assert np.ptp(pixels[:, 0]) > 0.3 * 640, "and is not small in it"
