"""A camera path around a point (viewer.work.cameras.around_centre)."""

import numpy as np

from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.work.cameras.around_centre import orbit
from pointglass.viewer.work.cameras.keyframes import cameras_along, path_seconds
from pointglass.viewer.work.document import CameraPath


def test_every_frame_has_the_distance_height_and_picture_place_of_the_first(seed):
    random = np.random.default_rng(seed)
    centre, eye = random.uniform(-1e5, 1e5, 3), random.uniform(2, 9, 3)
    up = np.eye(3)[int(random.integers(3))]
    camera = from_fov(640, 480, 55.0, look_at(centre + eye, centre + random.normal(size=3), up=up))
    path = CameraPath(orbit(camera, centre, up, step=3.0), closed=True)
    frames = cameras_along(path, 97, (640, 480))
    assert path_seconds(path) == 24.0
    radius = np.linalg.norm(eye - (eye @ up) * up)
    (place,), _ = camera.project(centre[None])
    angles = []
    for frame in frames:
        away = frame.position - centre
        assert abs(away @ up - eye @ up) < 1e-3 * radius
        assert abs(np.linalg.norm(away - (away @ up) * up) - radius) < 2e-3 * radius
        (seen,), (depth,) = frame.project(centre[None])
        assert depth > 0 and np.abs(seen - place).max() < 3.0
        flat = away - (away @ up) * up
        angles.append(np.arctan2(np.cross(eye - (eye @ up) * up, flat) @ up, (eye - (eye @ up) * up) @ flat))
    assert np.allclose(np.diff(np.unwrap(angles)), 2 * np.pi / 96, atol=2e-3), "counterclockwise, evenly, once"
