"""A photograph of a floor of equal tiles: its place is told from those that look alike, or it is called ambiguous, where all
matches lead to a tile beside."""

import numpy as np
import pytest

from pointglass.viewer.picture.camera import Camera, from_fov, look_at
from pointglass.viewer.work.photo_poses import pose_search
from pointglass.viewer.work.photo_poses.pose_search import FoundPose, NotFound
from pointglass.viewer.work.photo_poses.pose_solver import SolvedPose
from pointglass.viewer.work.photo_poses.reference_views import view_of

TILE, TEXELS = 3.0, 256
"""Metres of a tile, and texels along its side."""


class Floor:
    """Equal tiles in the plane z = 0, under a light that varies a little across the floor."""

    def __init__(self, rng: np.random.Generator):
        waves = np.hypot(np.fft.fftfreq(TEXELS)[:, None], np.fft.fftfreq(TEXELS)[None])
        noise = np.fft.fft2(rng.normal(size=(2, TEXELS, TEXELS)))
        texture = sum(np.fft.ifft2(each * np.exp(-2 * (np.pi * size * waves) ** 2)).real * size
                      for each, size in zip(noise, (2.0, 4.0)))  # fmt: skip
        self.texture = texture / texture.std()

    def colour(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(...) levels, 0..255."""
        from scipy.ndimage import map_coordinates

        tile = map_coordinates(self.texture, np.stack([y, x]) / TILE * TEXELS, order=1, mode="grid-wrap")
        return np.clip(128 + 30 * (tile + 0.3 * (np.sin(0.5 * x) + np.sin(0.4 * y))), 0, 255)

    def draw(self, camera: Camera) -> tuple[np.ndarray, np.ndarray]:
        column, row = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
        ahead = np.stack([(column - camera.cx) / camera.fx, (camera.cy - row) / camera.fy, -np.ones_like(column)], -1)
        ray = ahead @ camera.camera_to_world[:3, :3].T
        depth = -camera.camera_to_world[2, 3] / ray[..., 2]
        x, y = (camera.camera_to_world[k, 3] + depth * ray[..., k] for k in (0, 1))
        shown = np.repeat(self.colour(x, y)[..., None], 4, axis=2).round().astype(np.uint8)
        return shown, depth.astype(np.float32)

    def explained(self, picture: np.ndarray, camera: Camera) -> float:
        """As of Judge, of points where the photograph's middle looks."""
        spot = np.random.default_rng(0).uniform(0.1, 0.9, (3000, 2)) * (camera.width, camera.height)
        column, row = spot.astype(int).T
        ray = np.stack([(column + 0.5 - camera.cx) / camera.fx, (camera.cy - row - 0.5) / camera.fy, -np.ones(3000)], 1)
        ray = ray @ camera.camera_to_world[:3, :3].T
        at = camera.camera_to_world[:3, 3] - ray * (camera.camera_to_world[2, 3] / ray[:, 2])[:, None]
        points = self.colour(at[:, 0], at[:, 1])
        return 1 - float(((picture[row, column, 0] - points) ** 2).mean() / points.var())


def above(x: float, y: float, height: float) -> np.ndarray:
    """(4, 4) of a camera that looks steeply down at a place of the floor."""
    return look_at(np.array([x - 0.4 * height, y, height]), np.array([x, y, 0.0]), np.array([0.0, 0.0, 1.0]))


@pytest.mark.parametrize(("strict", "placed"), [(1.0, False), (60.0, True)])
def test_a_tile_beside_is_not_taken_for_the_place_of_a_photograph(seed, monkeypatch, strict, placed):
    """strict: by how much what the photograph does not explain counts."""
    pytest.importorskip("cv2")
    rng = np.random.default_rng(seed)
    floor = Floor(rng)
    views = [view_of(floor.draw, from_fov(640, 640, 70.0, pose), np.zeros(3), 800)
             for pose in (above(3.0, 3.0, 5.0), above(6.0, 4.0, 5.0))]  # fmt: skip
    x, y = TILE * 1.5 + rng.uniform(-0.2, 0.2, 2)
    truth = Camera(640, 480, 450.0, 450.0, 320.0, 240.0, above(x, y, 2.0), "tile")
    picture = floor.draw(truth)[0][..., :3]
    rotation = np.diag([1.0, -1.0, -1.0]) @ truth.camera_to_world[:3, :3].T
    beside = SolvedPose(rotation, -rotation @ (truth.position - (TILE, TILE, 0)), 450.0, np.arange(8), 1.0)
    monkeypatch.setattr(pose_search, "_first_poses", lambda *_: iter([beside]))
    monkeypatch.setattr(pose_search, "FEATURES", 1000)  # less time
    found = pose_search.find_pose(floor.draw, lambda camera: 1 - strict * (1 - floor.explained(picture, camera)), views,
                                  np.zeros(3), picture, (640, 480), "tile", 450.0)  # fmt: skip
    if placed:
        assert isinstance(found, FoundPose) and np.linalg.norm(found.camera.position - truth.position) < 0.02
    else:
        assert isinstance(found, NotFound) and "ambiguous" in found.why
