"""Projected coverage of cells: against a plain loop, and for surfaces of known coverage."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.projected_coverage import ENOUGH, LEAST, SQUARES, UNKNOWN, projected_coverage
from pointglass.viewer.grid.scene import unpack


def plain(scene) -> np.ndarray:
    """Cell by cell, square by square."""
    out = np.full((len(scene.cell_coords), 3), UNKNOWN)
    for cell in range(len(out)):
        runs = [np.asarray(scene.points[scene.offsets[k * len(out) + cell] : scene.offsets[k * len(out) + cell + 1]])
                for k in range(scene.layers)]
        words = np.concatenate(runs)[:ENOUGH]
        if len(words) < LEAST:
            continue
        q = np.stack([words[:, 0] & 0xFFFF, words[:, 0] >> 16, words[:, 1] & 0xFFFF], 1) // 8192
        for axis in range(3):
            out[cell, axis] = len(np.unique(np.delete(q, axis, 1), axis=0))
    return out


@pytest.mark.parametrize("count", [100, 3000, 200_000])
def test_coverage_equals_a_plain_count(seed, count):
    rng = np.random.default_rng(seed)
    xyz = rng.normal(size=(count, 3)) * (1, 0.3, 0.02) + rng.integers(0, 2, (count, 1)) * (0, 5, 1)
    scene = scene_from_arrays(xyz, rng.integers(0, 256, (count, 3)).astype(np.uint8))
    assert np.array_equal(scene.faces, plain(scene))
    for jobs in (1, 3, 1000):
        with ThreadPoolExecutor(2) as pool:
            assert np.array_equal(projected_coverage(scene.points, scene.offsets, scene.layers, pool, jobs), scene.faces)


def test_a_wall_covers_its_own_face_and_the_others_by_its_edge():
    rng = np.random.default_rng(1)
    xyz = rng.uniform(0, 4, (200_000, 3))
    xyz[:, 1] = 0.1 + rng.normal(0, 1e-4, len(xyz))
    scene = scene_from_arrays(xyz, np.zeros(xyz.shape, np.uint8))
    low, high = scene.bounds + np.array([[0, -9, 0], [0, 9, 0]])
    inner = (scene.cell_min >= low).all(1) & (scene.cell_min + scene.cell_size <= high).all(1)
    faces = scene.faces[inner & (scene.faces[:, 0] != UNKNOWN)]
    assert len(faces) and (faces[:, 1] >= SQUARES - 1).all() and (faces[:, [0, 2]] == 8).all()


def test_the_coverage_of_a_cell_with_few_points_is_unknown():
    xyz = np.random.default_rng(2).uniform(0, 1, (LEAST - 1, 3))
    scene = scene_from_arrays(xyz, np.zeros(xyz.shape, np.uint8))
    assert (scene.faces == UNKNOWN).all() and len(unpack(scene)[0]) == LEAST - 1
