"""A panorama stitched from renders against single views: each direction shows what a camera that looks there shows."""

import numpy as np
from clouds import room

from pointglass.viewer.commands.film.equirectangular import Panorama
from pointglass.viewer.commands.film.frames import FrameMaker
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.renderer import Renderer

WIDTH = 512


def smooth_room(seed):
    """The room with colours that change slowly, so that resampling is no error."""
    from dataclasses import replace

    from pointglass.viewer.grid.scene import unpack

    scene = room(seed, 400_000)
    xyz = unpack(scene)[0]
    low, high = scene.bounds
    rgb = (60 + 140 * (0.5 + 0.5 * np.sin(2.5 * (xyz - low) / (high - low).max()))).astype(np.uint32)
    points = np.array(scene.points)
    points[:, 2] = (points[:, 2] & 0xFF000000) | rgb[:, 0] | rgb[:, 1] << 8 | rgb[:, 2] << 16
    return replace(scene, points=points, checksums=None, noise=None)


def test_a_panorama_equals_single_views_in_every_direction(context, seed):
    scene = smooth_room(seed)
    rng = np.random.default_rng(seed)
    low, high = scene.bounds
    place = low + (high - low) * rng.uniform(0.35, 0.65, 3)
    settings, size = Settings(view="filled"), (WIDTH, WIDTH // 2)
    renderer = Renderer(context, scene)
    try:
        start = from_fov(64, 64, 60.0, look_at(place, place + np.array([1.0, 0.3, 0.0])))
        panorama = FrameMaker(renderer, settings, size, panorama=True).picture(start).astype(int)
        rays = Panorama(*size).rays(start)
        errors, wrong = [], []
        for _ in range(8):
            ahead = rng.normal(size=3) * (1, 1, 0.7)
            camera = from_fov(200, 200, 60.0, look_at(place, place + ahead))
            shot = FrameMaker(renderer, settings, (200, 200)).picture(camera).astype(int)
            pixels, depth = camera.project(place + rays.reshape(-1, 3))
            inside = (depth > 0) & (np.abs(pixels - 100) < 95).all(axis=1)
            column, row = pixels[inside].astype(int).T
            assert inside.sum() > 1000
            wrong.append(np.abs(panorama[:, ::-1].reshape(-1, 3)[inside] - shot[row, column]).max(axis=1))
            errors.append(np.abs(panorama.reshape(-1, 3)[inside] - shot[row, column]).max(axis=1))
    finally:
        renderer.release()
    error = np.concatenate(errors)
    assert np.percentile(error, 95) <= 8 and error.mean() < 2.5
    assert np.concatenate(wrong).mean() > 4 * error.mean(), "mirrored, it is another picture"
