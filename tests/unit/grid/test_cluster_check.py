"""Files far apart that are opened as one scene give a warning; neighbouring files do not."""

import numpy as np
import pytest
from cloud_files import write_ply

from pointglass.viewer.grid.open_scene import open_scene


def _files(folder, offsets, seed=0):
    rng = np.random.default_rng(seed)
    return [write_ply(folder / f"{n}.ply", rng.uniform(0, 10, (3000, 3)) + offset, rng.integers(0, 256, (3000, 3)))
            for n, offset in enumerate(offsets)]


def _warned(files):
    return [warning for warning in open_scene(files, cache=False).meta.warning_texts if "places" in warning]


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_files_far_apart_give_a_warning_with_names_and_distance(tmp_path, scale, seed):
    offsets = [(0, 0, 0), (250, 0, 0), (12, 0, 0)]
    rng = np.random.default_rng(seed)
    files = [write_ply(tmp_path / f"{n}.ply", scale * (rng.uniform(0, 10, (3000, 3)) + offset), rng.integers(0, 256, (3000, 3)))
             for n, offset in enumerate(offsets)]  # fmt: skip
    (said,) = _warned(files)
    assert "of 2 places, 0.ply lies " in said and " units from 1.ply; open each place by itself" in said
    told = float(said.split("lies ")[1].split(" units")[0].replace(",", ""))
    assert abs(told - 240 * scale) <= 0.05 * 240 * scale


def test_neighbouring_files_in_a_long_row_give_no_warning(tmp_path):
    assert not _warned(_files(tmp_path, [(50.0 * n, 0, 0) for n in range(8)]))


def test_outlier_points_and_files_without_finite_points_give_no_warning(tmp_path):
    files = _files(tmp_path, [(0, 0, 0), (20, 0, 0)])
    far = np.random.default_rng(1).uniform(0, 10, (3000, 3))
    far[7] = 9000.0
    files += [write_ply(tmp_path / "stray.ply", far, np.zeros((3000, 3), int) + 9),
              write_ply(tmp_path / "nan.ply", np.full((9, 3), np.nan), np.zeros((9, 3), int))]  # fmt: skip
    assert not _warned(files)
    assert not _warned(files[:1])
