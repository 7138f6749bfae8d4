"""Measurements over a saved picture (viewer.work.pictures.measured_picture): where they lie, at every size."""

import numpy as np
import pytest

from pointglass.viewer.picture.camera import Camera, look_at
from pointglass.viewer.picture.clip import vector
from pointglass.viewer.picture.drawn_lines import clipped, in_front, label_places, leader
from pointglass.viewer.work.measuring.measurement import MeasuredPoint, Measurement
from pointglass.viewer.work.notes.annotation import Annotation
from pointglass.viewer.work.pictures.drawn_over import with_shapes
from pointglass.viewer.work.pictures.measured_picture import with_measurements
from pointglass.viewer.work.pictures.noted_picture import mark_areas

ACCENT = np.array([92, 196, 192])


def camera(random, width: int = 320, height: int = 240) -> Camera:
    eye = random.uniform(-1e5, 1e5, 3)
    return Camera(width, height, 250.0, 250.0, width / 2, height / 2, look_at(eye, eye + random.normal(size=3)))


def between(camera: Camera, first, second, depth: float = 5.0, name: str = "Distance") -> Measurement:
    """A distance between the places seen in two pixels."""
    places = camera.unproject(np.array([first, second], float), np.full(2, depth))
    return Measurement("distance", tuple(MeasuredPoint(vector(place)) for place in places), name)


def accented(picture: np.ndarray) -> np.ndarray:
    return np.abs(picture[..., :3].astype(int) - ACCENT).max(axis=2) < 40


@pytest.mark.parametrize("channels", [3, 4])
def test_a_line_and_its_label_are_where_the_points_are_seen_and_the_rest_is_as_it_was(seed, channels):
    random = np.random.default_rng(seed)
    view = camera(random, 960, 720)
    picture = random.integers(0, 60, (720, 960, channels), np.uint8)
    kept = picture.copy()
    first, second = (180.0, float(random.uniform(400, 600))), (800.0, float(random.uniform(400, 600)))
    made = with_measurements(picture, view, [between(view, first, second)], "m")
    assert np.array_equal(picture, kept) and made.shape == picture.shape and made.dtype == np.uint8
    seen = accented(made)
    found = 0
    for share in (0.1, 0.3, 0.5, 0.7, 0.9):
        x, y = np.array(first) + share * (np.array(second) - first)
        found += seen[int(y) - 1 : int(y) + 2, int(x) - 1 : int(x) + 2].any()
    assert found >= 3, "the label may lie over a part"
    rows, columns = np.nonzero((made != picture).any(axis=2))
    assert columns.min() > 170 and columns.max() < 810 and rows.min() > 340 and rows.max() < 640
    assert (made[..., :3].min(axis=2) > 180).sum() > 20, "the value is written"
    if channels == 4:
        assert made[seen][:, 3].min() > 200


def test_a_larger_picture_shows_the_same(seed):
    random = np.random.default_rng(seed)
    view = camera(random, 960, 720)
    measurements = [between(view, (120, 180), (840, 600)), between(view, (900, 120), (60, 540), 3.0, "Distance 2")]
    small = with_measurements(np.zeros((720, 960, 3), np.uint8), view, measurements, "m")
    large = with_measurements(np.zeros((2880, 3840, 3), np.uint8), view.resized(3840, 2880), measurements, "m")
    shrunk = large.reshape(720, 4, 960, 4, 3).mean(axis=(1, 3))
    lines = accented(small)
    assert lines.sum() > 100 and (shrunk[lines].max(axis=1) > 60).mean() > 0.9


def test_what_is_behind_the_camera_draws_nothing_and_a_line_through_it_is_cut(seed):
    random = np.random.default_rng(seed)
    view = camera(random)
    black = np.zeros((240, 320, 3), np.uint8)
    behind = view.position - 3 * view.forward
    away = Measurement("distance", tuple(MeasuredPoint(vector(behind + step)) for step in random.normal(size=(2, 3)) * 0.1))
    assert np.array_equal(with_measurements(black, view, [away], "m"), black)
    front = view.unproject(np.array([[160.0, 120.0]]), np.array([5.0]))[0]
    through = Measurement("distance", (MeasuredPoint(vector(front)), MeasuredPoint(vector(behind + 0.5 * view.right))))
    assert accented(with_measurements(black, view, [through], "m")).any()
    assert with_measurements(black, view, [], "m") is black


def test_a_part_of_a_line_is_that_which_a_plain_sampling_finds(seed):
    random = np.random.default_rng(seed)
    view = camera(random)
    shown = 0
    for _ in range(200):
        a, b = view.position + random.normal(size=(2, 3)) * 4
        places, depths = view.project(a + np.linspace(0, 1, 2001)[:, None] * (b - a))
        inside = (depths > 0) & (places >= 0).all(axis=1) & (places <= (320, 240)).all(axis=1)
        pixels = in_front(view, a, b)
        part = None if pixels is None else clipped(pixels[0], pixels[1], (0.0, 0.0, 320.0, 240.0), 0.0)
        if part is None:
            assert inside.sum() <= 1  # a corner that is just touched
        elif inside.sum() > 1:
            found = places[inside]
            ends = np.array([found[0], found[-1]])
            steps = np.linalg.norm(np.diff(found, axis=0), axis=1).max() + np.linalg.norm(found[-1] - found[-2]) + 2.0
            assert np.abs(np.sort(ends, axis=0) - np.sort(np.array(part), axis=0)).max() < 4 * steps
            shown += 1
    assert shown > 10


def test_a_label_without_a_line_is_nearest_to_its_own_mark(seed):
    random = np.random.default_rng(seed)
    lines = 0
    for _ in range(20):
        places, ends = random.uniform(100, 220, (6, 2)), random.uniform(100, 220, (4, 2))
        area = (0.0, 0.0, 640.0, 400.0)
        found = label_places(places, np.ones(6), [(60.0, 20.0)] * 6, 10.0, area, 4.0, (), (1.0, 2.5), ends.tolist())
        for number, at in found.items():
            end = leader(places[number], at, (60.0, 20.0), 10.0, [*places, *ends])
            lines += end is not None
            low = np.array(at)
            away = [np.hypot(*np.maximum(np.maximum(low - place, place - low - (60.0, 20.0)), 0)) for place in [*places, *ends]]
            assert end is not None or away[number] < min(away) + 1.5, "marks within a pixel count as one"
    assert lines > 5


def test_a_crowd_of_labels_of_measurements_and_notes_lies_apart(seed):
    """Each of a dozen at one place has its own room, most of them farther off, with a line to their place."""
    random = np.random.default_rng(seed)
    view, taken = camera(random, 960, 720), []
    black = np.zeros((720, 960, 3), np.uint8)
    at = list(view.unproject(random.uniform(-3, 3, (6, 2)) + (480.0, 360.0), np.full(6, 5.0)))
    for group in range(2):
        with_shapes(black, view, lambda *_: None, at, [f"group {group}, number {number}" for number in range(6)], taken)
    assert len(taken) == 12
    for number, (x, y, width, height) in enumerate(taken):
        assert x >= 0 and y >= 0 and x + width <= 960 and y + height <= 720
        for a, b, w, h in taken[:number]:
            assert x + width <= a or a + w <= x or y + height <= b or b + h <= y


def test_labels_of_measurements_leave_the_marks_of_notes_free(seed):
    """Over a saved picture: the notes are drawn last, and their marks covered labels."""
    random = np.random.default_rng(seed)
    view = camera(random, 960, 720)
    measurements = [between(view, *random.uniform([200, 200], [760, 520], (2, 2))) for _ in range(3)]
    at = [np.mean([point.position for point in measurement.points], axis=0) for measurement in measurements]
    corner = view.project(at)[0] + (25.0, -20.0)  # where a label goes first
    notes = [Annotation("", vector(place)) for place in view.unproject(corner, np.full(3, 5.0))]
    taken = mark_areas(view, notes)
    assert np.allclose(np.array(taken)[:, :2] + np.array(taken)[:, 2:] / 2, corner, atol=1e-3)
    with_measurements(np.zeros((720, 960, 3), np.uint8), view, measurements, "m", taken)
    assert len(taken) == 6
    for number, (x, y, width, height) in enumerate(taken[3:], 3):
        for a, b, w, h in taken[:number]:
            assert x + width <= a or a + w <= x or y + height <= b or b + h <= y


def test_no_label_lies_over_another_or_outside_and_the_nearest_comes_first(seed):
    random = np.random.default_rng(seed)
    for _ in range(20):
        count = int(random.integers(1, 40))
        places, depths = random.uniform(-50, 450, (count, 2)), random.uniform(-1, 9, count)
        sizes = random.uniform(10, 80, (count, 2))
        found = label_places(places, depths, sizes.tolist(), 8.0, (0.0, 0.0, 400.0, 300.0), 4.0)
        plates = np.array([[*at, *(np.array(at) + sizes[number])] for number, at in found.items()])
        for i, first in enumerate(plates):
            assert (first >= 4 - 1e-9).all() and (first[[0, 2]] <= 396 + 1e-9).all() and (first[[1, 3]] <= 296 + 1e-9).all()
            for other in plates[:i]:
                assert (first[2:] <= other[:2] + 1e-9).any() or (other[2:] <= first[:2] + 1e-9).any()
        inside = (depths > 0) & (places >= 0).all(axis=1) & (places <= (400, 300)).all(axis=1)
        assert set(found) <= set(np.flatnonzero(inside).tolist())
        if inside.any():
            assert int(np.flatnonzero(inside)[depths[inside].argmin()]) in found
