"""Directions that a scan closes: the compiled loop against NumPy, and what a picture's directions have in common."""

import numpy as np
import pytest

from viewer.camera import from_fov, look_at
from viewer.cloud import scene_from_arrays
from viewer.render import void
from viewer.render.void import SIDE, Surroundings, cell_of, closed_in_view


def closed_plainly(points: np.ndarray, position: np.ndarray) -> np.ndarray:
    ray = points - position
    scanned = np.zeros(6 * SIDE * SIDE, bool)
    scanned[cell_of(ray[np.abs(ray).max(axis=1) > 0])] = True
    hits = scanned[void._walks()].any(axis=2).sum(axis=1)
    return (hits >= void._NEEDED).reshape(6 * SIDE, SIDE)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_the_compiled_loop_closes_what_numpy_does(seed, scale):
    rng = np.random.default_rng(seed)
    surroundings = Surroundings(scene_from_arrays(rng.normal(size=(500, 3)) * scale, np.zeros((500, 3), np.uint8)))
    for count in (0, 1, 30, 3000):
        points = rng.normal(size=(count, 3)) * scale * rng.uniform(0.1, 3, (count, 1))
        points[: count // 3] = np.round(points[: count // 3] / scale) * scale  # on axes, diagonals, and in the eye itself
        points[: count // 10] = 0.0
        surroundings._points = points
        for position in (np.zeros(3), rng.normal(size=3) * scale):
            assert np.array_equal(surroundings.closed(position), closed_plainly(points, position)), (count, position)


def test_all_rays_of_a_picture_have_in_common_what_is_said(seed):
    """Random pictures of 1 to 170 degrees, off centre, of maps that are closed here and open there."""
    rng = np.random.default_rng(seed)
    said = []
    for _ in range(300):
        camera = from_fov(int(rng.integers(4, 60)), int(rng.integers(4, 60)), float(rng.uniform(1, 170)),
                          look_at(np.zeros(3), rng.normal(size=3)))  # fmt: skip
        middle = rng.normal(size=3)
        near = void._centres() @ (middle / np.linalg.norm(middle)) > rng.uniform(-1, 1)
        closed = (near ^ bool(rng.integers(2))).astype(np.int8).reshape(6 * SIDE, SIDE)
        i, j = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
        view = np.stack([(i - camera.cx) / camera.fx, (j - camera.cy) / camera.fy, np.ones_like(i)], -1).reshape(-1, 3)
        seen = closed.ravel()[cell_of(view @ camera.view_rotation)]
        said.append(closed_in_view(closed, camera))
        assert said[-1] is None or (seen == said[-1]).all()
    assert {None, False, True} == set(said) and sum(one is None for one in said) < 250
