"""Clips against a point-by-point reference, and the conservative test of cells against the points of those cells."""

import numpy as np
import pytest

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.clip import MOST_CLIPS, Box, Slab, box_around, contains, may_contain, vector
from pointglass.viewer.picture.edits import Edits


def random_rotation(random) -> np.ndarray:
    q, r = np.linalg.qr(random.normal(size=(3, 3)))
    return q * np.sign(np.diag(r))


def random_clips(random, count: int, around: np.ndarray) -> list:
    clips = []
    for _ in range(count):
        centre, removes = vector(around + random.uniform(-1, 1, 3)), bool(random.random() < 0.4)
        if random.random() < 0.5:
            first, second, third = random_rotation(random)
            axes = vector(first), vector(second), vector(third)
            clips.append(Box(centre, vector(random.uniform(0.2, 1.5, 3)), axes, removes))
        else:
            clips.append(Slab(centre, vector(random_rotation(random)[0]), float(random.uniform(0.2, 2.0)), removes))
    return clips


def left_by(clips, point: np.ndarray) -> bool:
    """The rule of the module's docstring, in words of geometry."""
    kept = {"box": [], "slab": []}
    for clip in clips:
        way = point - np.array(clip.centre)
        if isinstance(clip, Box):
            inside = all(abs(way @ np.array(axis)) <= half for axis, half in zip(clip.axes, clip.half, strict=True))
        else:
            inside = abs(way @ np.array(clip.normal)) <= clip.thickness / 2
        if clip.removes and inside:
            return False
        if not clip.removes:
            kept["box" if isinstance(clip, Box) else "slab"].append(inside)
    return all(any(found) for found in kept.values() if found)


def test_clips_combine_as_stated(seed):
    random = np.random.default_rng(seed)
    for _ in range(20):
        around = random.uniform(-1e6, 1e6, 3)
        clips = random_clips(random, int(random.integers(0, 6)), around)
        xyz = around + random.uniform(-2, 2, (200, 3))
        assert contains(clips, xyz).tolist() == [left_by(clips, point) for point in xyz]


def test_no_cell_with_a_point_that_is_left_is_culled(seed):
    random = np.random.default_rng(seed)
    culled = 0
    for _ in range(20):
        clips = random_clips(random, int(random.integers(1, 5)), np.zeros(3))
        centre = random.uniform(-3, 3, (300, 3))
        possible = may_contain(clips, centre, 0.2)
        culled += int((~possible).sum())
        points = centre[:, None] + random.uniform(-0.2, 0.2, (300, 30, 3))
        left = contains(clips, points.reshape(-1, 3)).reshape(300, 30).any(axis=1)
        assert not (left & ~possible).any()
    assert culled > 300


def test_inactive_clips_do_nothing():
    box = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), active=False)
    assert contains([box], np.array([[5.0, 0, 0]])).all()


def test_faces_of_a_box_belong_to_it():
    box = box_around(np.array([1.0, 2, 3]), np.array([2.0, 4, 6]))
    assert contains([box], np.vstack([box.corners, [[1.0, 2, 3], [2, 4, 6]]])).all()
    assert not contains([box], np.array([[0.999, 3, 4], [1.5, 3, 6.001]])).any()


@pytest.mark.parametrize("make, said", [
    (lambda: Box((0, 0, float("nan")), (1, 1, 1)), "centre"),
    (lambda: Box((0, 0, 0), (1, 0, 1)), "half size"),
    (lambda: Box((0, 0, 0), (1, 1, 1), ((1, 0, 0), (1, 0, 0), (0, 0, 1))), "right angles"),
    (lambda: Slab((0, 0, 0), (0, 0, 2), 1.0), "unit vector"),
    (lambda: Slab((0, 0, 0), (0, 0, 1), -1.0), "thickness"),
])
def test_bad_values_are_named(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_too_many_active_clips_are_refused():
    slabs = [Slab((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0)] * (MOST_CLIPS + 1)
    with pytest.raises(InputError, match="turn some off"):
        contains(slabs, np.zeros((1, 3)))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("up", [(0.0, 0.0, 1e155), (0.0, float("nan"), 1.0), (0.0, 0.0, float("inf")), (0.0, 0.0, 1.1)])
def test_an_up_axis_of_another_length_is_refused(up):
    """Without a warning, also where its square overflows."""
    with pytest.raises(InputError, match="unit vector"):
        Edits(up=up)
