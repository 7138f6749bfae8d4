"""The bounding boxes of cells equal those of their points, for any number of threads and any position."""

import numpy as np
import pytest

from pointglass.viewer.grid.building import two_passes as grid
from pointglass.viewer.grid.cell_boxes import SHARES, WHOLE, boxes_of
from pointglass.viewer.grid.open_scene import scene_from_arrays


def plain(scene) -> np.ndarray:
    """The boxes computed from the packed points, cell by cell."""
    words, cells = np.asarray(scene.points), scene.cell_of_points()
    share = np.stack([words[:, 0] & 0xFFFF, words[:, 0] >> 16, words[:, 1] & 0xFFFF], 1) // (65536 // SHARES)
    return np.array([[*share[cells == cell].min(axis=0), *share[cells == cell].max(axis=0)]
                     for cell in range(len(scene.cell_coords))])


@pytest.mark.parametrize("count", [1, 100, 50_000])
@pytest.mark.parametrize("threads", [1, 3])
def test_boxes_are_those_of_the_points(seed, count, threads, monkeypatch):
    monkeypatch.setattr(grid, "processors", lambda: threads)
    rng = np.random.default_rng(seed)
    xyz = rng.normal(size=(count, 3)) * (1, 0.3, 0.002) * 10.0 ** rng.uniform(-3, 3) + 10.0 ** rng.uniform(-3, 6)
    scene = scene_from_arrays(xyz, np.zeros(xyz.shape, np.uint8))
    assert scene.boxes.dtype == np.uint8 and np.array_equal(scene.boxes, plain(scene))


def test_a_grid_built_twice_has_the_boxes_of_its_final_cells(seed):
    """Tight clusters far apart: the first cells are too coarse and others are chosen."""
    rng = np.random.default_rng(seed)
    xyz = rng.normal(size=(4000, 3)) * 1e-4 + rng.integers(0, 3, (4000, 1)) * 1e4
    scene = scene_from_arrays(xyz, np.zeros(xyz.shape, np.uint8))
    assert np.array_equal(scene.boxes, plain(scene))


def test_marks_of_all_threads_are_joined_and_an_unmarked_cell_has_the_whole_box():
    bit = 1
    marks = np.zeros((2, 3), np.int64)
    marks[0, 0] = bit << 3 | bit << (SHARES + 15) | bit << (2 * SHARES)
    marks[1, 0] = bit << 5 | bit << (SHARES + 1) | bit << (2 * SHARES)
    marks[1, 1] = bit << 15 | bit << (SHARES + 15) | bit << (2 * SHARES + 15)
    assert boxes_of(marks).tolist() == [[3, 1, 0, 5, 15, 0], [15] * 6, WHOLE.tolist()]
