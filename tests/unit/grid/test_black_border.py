"""Points at a photograph's black border are detected; other dark points keep their colour."""

import numpy as np
import pytest
from cloud_files import write_las, write_ply
from scipy.spatial.transform import Rotation

from pointglass.viewer.commands.info import format_text
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.preprocess import black_border
from pointglass.viewer.preprocess.black_border import DARK, black_border_share


def floor(seed: int, hole: float = 0.6, count: int = 60_000) -> tuple[np.ndarray, np.ndarray]:
    """xyz (n, 3) and rgb (n, 3) of a bright floor of 4 x 4 around a round hole, its points a little rough."""
    random = np.random.default_rng(seed)
    xyz = np.column_stack([random.uniform(-2, 2, (count, 2)), random.normal(0, 0.001, count)])
    xyz = xyz[np.hypot(xyz[:, 0], xyz[:, 1]) > hole]
    return xyz, random.integers(90, 200, (len(xyz), 3), dtype=np.uint8)


def ring(seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The floor with a black border around its hole, and which points belong to the border."""
    xyz, rgb = floor(seed)
    rim = np.hypot(xyz[:, 0], xyz[:, 1]) < 0.615
    rgb[rim] = np.random.default_rng(seed).integers(1, DARK, (int(rim.sum()), 3))
    return xyz, rgb, rim


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e4])
def test_a_black_border_around_a_hole_is_detected_at_any_scale_and_orientation(scale):
    for seed in range(4):
        xyz, rgb, rim = ring(seed)
        turn = Rotation.from_euler("xyz", np.random.default_rng(seed).uniform(0, 360, 3), degrees=True)
        assert black_border_share(scale * (turn.apply(xyz) + [30.0, -7.0, 2.0]), rgb) == rim.mean() > 0.0


def test_other_dark_points_keep_their_colour():
    random = np.random.default_rng(3)
    xyz, rgb = floor(3)
    shadow = rgb.copy()
    shadow[np.hypot(xyz[:, 0] - 1.2, xyz[:, 1]) < 0.15] //= 40
    assert (shadow.max(axis=1) < DARK).sum() > 100 and black_border_share(xyz, shadow) == 0.0, "the bright floor surrounds it"

    cable = np.column_stack([random.uniform(-2, 2, 400), random.normal(1, 0.003, 400), random.normal(0.08, 0.003, 400)])
    both = np.concatenate([xyz, cable]), np.concatenate([rgb, random.integers(0, DARK, (400, 3), dtype=np.uint8)])
    assert black_border_share(*both) == 0.0, "a cable stands off the wall"

    dim = (rgb // 5).astype(np.uint8)
    dim[np.hypot(xyz[:, 0], xyz[:, 1]) < 0.615] = 3
    assert black_border_share(xyz, dim) == 0.0, "where all is dim, so is the edge"

    wide = rgb.copy()
    wide[np.hypot(xyz[:, 0], xyz[:, 1]) < 0.75] = 3
    assert black_border_share(xyz, wide) == 0.0, "a rim is thin"
    assert black_border_share(xyz, rgb) == 0.0 and black_border_share(xyz[:50], rgb[:50]) == 0.0


def test_only_the_file_with_a_black_border_loses_those_colours(tmp_path):
    xyz, rgb, rim = ring(7)
    other, dark = floor(8)
    dark[np.hypot(other[:, 0] - 1.2, other[:, 1]) < 0.15] = 5
    blind = write_las(tmp_path / "blind.laz", xyz, rgb.astype(np.uint16) * 257)
    files = [blind, write_ply(tmp_path / "dark.ply", other + [9.0, 0, 0], dark)]
    scene = open_scene(files, cache=False)
    points, colours, _, _ = unpack(scene)
    lost = ~colours.any(axis=1)
    assert scene.unlit and lost.sum() == rim.sum() and (points[lost, 0] < 3).all()
    said = f"blind.laz: {100 * rim.mean():.1g}% of the points have the colour of a photograph's black border"
    assert said in format_text(scene)
    assert "dark.ply" not in "".join(scene.meta.warning_texts)
    plain = open_scene(files, cache=False, match=False)
    assert not plain.unlit and unpack(plain)[1].any(axis=1).all(), "as scanned means as scanned"


def test_neighbours_are_searched_among_few_points_and_are_those_of_all(seed):
    """Where the surroundings hold too few points, or points too far away, all are searched."""
    from scipy.spatial import KDTree

    random = np.random.default_rng(seed)
    xyz, _ = floor(1)
    apart = np.concatenate([xyz, [[40.0, 40.0, 0.0]]])  # its neighbours lie beyond the cells around it
    for points, places in ((xyz, xyz[:3] + 0.001), (xyz, xyz[random.integers(len(xyz), size=900)]), (apart, apart[-1:]),
                           (np.tile(xyz[:1], (200, 1)), xyz[:1])):  # fmt: skip
        expected, _ = KDTree(points).query(places, 128)
        distances, near = black_border._neighbours(points, places)
        np.testing.assert_array_equal(distances, expected)
        np.testing.assert_array_equal(np.linalg.norm(points[near] - places[:, None], axis=2).round(12), expected.round(12))
