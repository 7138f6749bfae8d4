"""The start viewpoint: objects entire and upright, terrain from above, rooms from inside."""

import numpy as np
import pytest
from window_session import room

from viewer.grid.open_scene import scene_from_arrays
from viewer.tools.standing_place import enclosure
from viewer.window.start_viewpoint import darkness, start_camera, survey


@pytest.mark.parametrize("aspect", [0.8, 1.6, 2.4])
def test_an_object_is_framed_entire_and_upright_and_terrain_is_seen_from_above(aspect):
    rng = np.random.default_rng()
    turn = rng.normal(size=(30_000, 3))
    statue = turn / np.linalg.norm(turn, axis=1, keepdims=True) * (0.8, 0.9, 2.0) + (4e5, 5e6, 30.0)
    tile = np.stack([rng.uniform(0, 900, 30_000), rng.uniform(0, 500, 30_000), rng.normal(0, 4, 30_000)], axis=1)
    for points, steepest in ((statue, 35.0), (tile, 60.0)):
        scene = scene_from_arrays(points, np.full((len(points), 3), 180, np.uint8), meta={"metres_per_unit": 1.0})
        height = 480
        camera = start_camera(scene, round(aspect * height), height)
        pixels, depth = camera.project(points)
        inside = (depth > 0) & (pixels >= 0).all(axis=1) & (pixels <= (camera.width, camera.height)).all(axis=1)
        assert inside.mean() > 0.97
        assert camera.up[2] > 0.3 and -np.sin(np.radians(steepest)) < camera.forward[2] < -0.1
        spans = np.ptp(pixels[inside], axis=0) / (camera.width, camera.height)
        assert spans.max() > 0.6, "it fills the picture"


def test_a_dark_scan_is_said_to_be_dark():
    for level, dark in ((20, True), (150, False)):
        scene = scene_from_arrays(np.random.default_rng(1).random((5000, 3)), np.full((5000, 3), level, np.uint8))
        assert (darkness(survey(scene)) is not None) is dark


def test_a_room_is_entered_and_a_wall_is_not():
    camera = start_camera(room(), 640, 400)
    assert (camera.position > 0.3).all() and (camera.position < (7.7, 5.7, 2.7)).all()
    rng = np.random.default_rng(3)
    wall = np.stack([rng.uniform(0, 6, 20_000), rng.normal(0, 0.01, 20_000), rng.uniform(0, 3, 20_000)], axis=1)
    scene = scene_from_arrays(wall, np.full((20_000, 3), 200, np.uint8), meta={"metres_per_unit": 1.0})
    seen = survey(scene)
    assert enclosure(seen, np.array([3.0, 1.5, 1.6])) < 0.5
    pixels, depth = start_camera(scene, 640, 400).project(wall)
    assert (depth > 0).all() and np.ptp(pixels, axis=0).min() > 100, "seen from its front"
