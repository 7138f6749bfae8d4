"""What is selected on the grid is what a plain test says of each point, and what export takes of the files."""

import numpy as np
import pytest
from scipy import ndimage
from window_session import room

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.clip import Box, contains, vector
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.point_sets import PointSet
from pointglass.viewer.work.selecting.connected_region import connected_region
from pointglass.viewer.work.selecting.select_points import (
    beside_plane,
    by_outline,
    combined,
    in_box,
    in_sight,
    inside_outline,
    not_covered,
)
from pointglass.viewer.work.selection import Selection

SCENE = room(points=60_000, offset=(4e5, 5e6, 100.0))
XYZ = unpack(SCENE)[0]
NUMBERS = SCENE.records.numbers(slice(0, SCENE.count)) if SCENE.records is not None else np.zeros(0, int)


def test_only_what_a_picture_shows_is_selected(seed):
    random = np.random.default_rng(seed)
    walls = [np.c_[random.uniform(0, 4, 60_000), np.full(60_000, y), random.uniform(0, 3, 60_000)] for y in (0.0, 2.0)]
    scene = scene_from_arrays(np.concatenate(walls), np.zeros((120_000, 3), np.uint8))
    camera = from_fov(80, 60, 60.0, look_at(np.array((2.0, -3.0, 1.5)), np.array((2.0, 0.0, 1.5))))
    xyz = unpack(scene)[0]
    pixels, away = camera.project(xyz)
    inside = ((pixels >= 0) & (pixels < (80, 60))).all(axis=1)
    column, row = pixels[inside].astype(int).T
    depth = np.full((60, 80), np.inf, np.float32)
    np.minimum.at(depth, (row, column), away[inside].astype(np.float32))
    mask = np.isfinite(depth)
    mask[:, :20] = False  # as the filter leaves pixels in which something nearer is missing
    found = not_covered(scene, camera, np.ones(scene.count, bool), depth, mask)
    kept = inside & (pixels[:, 0] >= 20)
    assert found[kept & (xyz[:, 1] == xyz[:, 1].min())].all()
    behind = kept & (xyz[:, 1] > 1.0)
    over = (pixels[:, 0] > 25) & (pixels[:, 0] < 55) & (pixels[:, 1] > 15) & (pixels[:, 1] < 45)  # in front of it is the wall
    assert not found[behind & over].any() and (behind & over).any() and not found[~kept].any()


def random_outline(random) -> np.ndarray:
    """A lasso, which may cross itself and leave the picture."""
    turns = np.sort(random.uniform(0, 2 * np.pi, random.integers(3, 80)))
    reach = random.uniform(20, 400, len(turns))
    return random.uniform(0, 600, 2) + np.stack([reach * np.cos(turns), reach * np.sin(turns)], axis=1)


def test_an_outline_selects_the_points_whose_pixels_lie_in_it(seed):
    random = np.random.default_rng(seed)
    low, high = SCENE.bounds
    for _ in range(20):
        eye, target = low + random.uniform(-0.5, 1.5, 3) * (high - low), low + random.uniform(0, 1, 3) * (high - low)
        camera = from_fov(640, 400, float(random.uniform(30, 100)), look_at(eye, target))
        corners = random_outline(random)
        pixels, depth = camera.project(XYZ)
        with np.errstate(invalid="ignore"):
            wanted = (depth > 0) & inside_outline(pixels, corners)
        assert np.array_equal(by_outline(SCENE, camera, corners), wanted)


def test_inside_agrees_with_another_library(seed):
    path = pytest.importorskip("matplotlib.path")
    random = np.random.default_rng(seed)
    turns = np.sort(random.uniform(0, 2 * np.pi, 30))  # does not cross itself: the rules of filling agree
    corners = 300 + random.uniform(50, 250, 30)[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    pixels = random.uniform(0, 600, (20_000, 2))
    assert np.array_equal(inside_outline(pixels, corners), path.Path(corners).contains_points(pixels))


def test_boxes_and_planes_select_what_lies_in_them(seed):
    random = np.random.default_rng(seed)
    low, high = SCENE.bounds
    for _ in range(10):
        axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
        box = Box(vector(random.uniform(low, high)), vector(random.uniform(0.5, 4, 3)), tuple(vector(row) for row in axes))
        assert np.array_equal(in_box(SCENE, box), contains([box], XYZ))
        place, normal = random.uniform(low, high), axes[0]
        assert np.array_equal(beside_plane(SCENE, place, normal), (XYZ - place) @ normal >= 0)


def test_new_add_and_subtract_keep_what_they_say_and_hidden_points_stay_out(seed):
    random = np.random.default_rng(seed)
    files = (("#0", SCENE.count),)
    before, hits = random.random(SCENE.count) < 0.3, random.random(SCENE.count) < 0.5
    edits = Edits(selection=PointSet.of(before, files))
    of_point = before[NUMBERS]
    for how, wanted in (("new", hits), ("add", of_point | hits), ("subtract", of_point & ~hits)):
        made = combined(SCENE, edits, hits, how)
        assert np.array_equal(made.points.mask(files)[NUMBERS], wanted) and made.points.count == wanted.sum()
        assert made.bounds is not None
        assert made.bounds == pytest.approx(np.array([XYZ[wanted].min(axis=0), XYZ[wanted].max(axis=0)]), abs=1e-9)
    clip = Box(vector(SCENE.bounds.mean(axis=0)), (2.0, 2.0, 2.0))
    sight = Selection.in_sight(SCENE, Edits(clips=(clip,)))
    assert np.array_equal(in_sight(sight, hits.copy()), hits & contains([clip], XYZ))


def scattered(random, low, high, count) -> np.ndarray:
    return random.uniform(low, high, (count, 3))


def test_what_hangs_together_is_what_touching_cubes_hold(seed):
    random = np.random.default_rng(seed)
    middles = random.uniform(0, 20, (40, 3))
    xyz = np.concatenate([middle + random.normal(0, 0.3, (300, 3)) for middle in middles])
    scene = scene_from_arrays(xyz, np.zeros(xyz.shape, np.uint8))
    places, side = unpack(scene)[0], 0.37
    found = connected_region(Selection.in_sight(scene, Edits()), places[17], side)
    cube = ((places - scene.bounds[0] + 2 * side) / side).astype(int)
    filled = np.zeros(cube.max(axis=0) + 2, bool)
    filled[tuple(cube.T)] = True
    labels = ndimage.label(filled, np.ones((3, 3, 3)))[0][tuple(cube.T)]  # type: ignore[index]
    assert np.array_equal(found, labels == labels[17]) and len(np.unique(labels)) > 1


def room_with_a_pipe(random):
    """A floor, a wall and a pipe in the air, of 20 spacings radius, with 2 mm noise; and the part of each point: 0, 1, 2."""
    noise = 0.002
    floor = scattered(random, (0, 0, 0), (4, 3, 0), 40_000) + random.normal(0, noise, (40_000, 3))
    wall = scattered(random, (0, 3, 0), (4, 3, 2.5), 33_000) + random.normal(0, noise, (33_000, 3))
    turn, along = random.uniform(0, 2 * np.pi, 13_500), random.uniform(0.3, 3.7, 13_500)
    pipe = np.stack([along, 1.5 + 0.45 * np.cos(turn), 1.2 + 0.45 * np.sin(turn)], axis=1)
    pipe += random.normal(0, noise, pipe.shape)
    xyz, part = np.concatenate([floor, wall, pipe]), np.repeat([0, 1, 2], [40_000, 33_000, 13_500])
    scene = scene_from_arrays(xyz, np.zeros(xyz.shape, np.uint8))
    assert scene.records is not None
    return scene, part[scene.records.numbers(slice(0, scene.count))]


def test_a_smooth_surface_ends_at_its_edges(seed):
    """Of twelve rooms the worst had 94 % of the wall, and 0.7 % of what is not its own (the floor along it)."""
    scene, part = room_with_a_pipe(np.random.default_rng(seed))
    sight = Selection.in_sight(scene, Edits())
    for number, place in enumerate(((2.0, 1.0, 0.0), (2.0, 3.0, 1.5), (2.0, 1.5, 1.65))):
        found = connected_region(sight, np.array(place), smooth=True)
        assert found[part == number].mean() > 0.9, number
        assert found[part != number].mean() < 0.015, number


def test_hidden_points_are_no_bridge(seed):
    scene, part = room_with_a_pipe(np.random.default_rng(seed))
    sight = Selection.in_sight(scene, Edits())
    assert connected_region(sight, np.array((2.0, 1.0, 0.0)))[part != 2].mean() > 0.99  # floor and wall touch
    box = Box((2.0, 1.5, 1.5), (0.5, 9.0, 9.0), removes=True)  # cuts the room in two
    half = connected_region(Selection.in_sight(scene, Edits(clips=(box,))), np.array((0.5, 1.0, 0.0)))
    assert not half[unpack(scene)[0][:, 0] > 1.9].any() and half.any()
