"""Pixels of a picture that are read without waiting are those that ``Frame`` reads."""

import time

import numpy as np
import pytest

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.window.viewport.pixel_reader import PixelReader

pytestmark = pytest.mark.gl


@pytest.fixture
def reader(context):
    made = PixelReader(context)
    yield made
    made.release()


@pytest.fixture
def draw(renderer_of):
    rng = np.random.default_rng(4)
    renderer = renderer_of(scene_from_arrays(rng.uniform(-1, 1, (20_000, 3)), rng.integers(0, 256, (20_000, 3), np.uint8)))

    def drawn(width: int, view: str = "filled"):
        camera = from_fov(width, 61, 60.0, look_at((0.0, -4.0, 0.2 * width / 100), (0.0, 0.0, 0.0)))
        return renderer.render(camera, Settings(view=view), (view, "filtered") if view == "filled" else (view,))

    return drawn


def arrived(reader, frame, name):
    """What a reading brings that is asked for again and again, as the window does."""
    end = time.monotonic() + 20
    while (found := reader.read(frame, name)) is None:
        assert time.monotonic() < end
        reader.poll()
    return found


@pytest.mark.parametrize("wait", [True, False])
def test_what_is_read_is_what_the_frame_reads(reader, draw, wait):
    for width in (97, 64, 130):  # rows of no whole words; a smaller and a larger picture in the same buffers
        frame = draw(width)
        usual = {"depth": frame.depth(), "mask": frame.mask(), "filled": frame.image("filled"),
                 "filtered": frame.image("filtered")}
        for name in usual:
            if not wait:
                reader.read(frame, name)  # all of them are under way at the same time
        for name, expected in usual.items():
            found = reader.read(frame, name, wait=True) if wait else arrived(reader, frame, name)
            assert found.dtype == expected.dtype and np.array_equal(found, expected), name
        assert not reader.waiting


def test_without_a_filter_the_mask_is_where_points_are(reader, draw):
    frame = draw(97, "raw")
    assert np.array_equal(reader.read(frame, "mask", wait=True), np.isfinite(frame.depth()))


def test_a_new_picture_is_read_anew_and_one_reading_serves_all(reader, draw):
    first = draw(97)
    depth = reader.read(first, "depth", wait=True)
    assert reader.read(first, "depth") is depth
    reader.read(first, "mask")  # given up by the next picture
    second = draw(96)
    expected = second.depth()
    assert np.array_equal(reader.read(second, "depth", wait=True), expected) and expected.shape != depth.shape
    with pytest.raises(KeyError):
        reader.read(second, "neural")


def test_nobody_waits_for_what_has_not_arrived(reader, draw, monkeypatch):
    frame = draw(97)
    monkeypatch.setattr(reader._ring, "ready", lambda number: False)
    assert reader.read(frame, "depth") is None and reader.waiting
    reader.poll()
    assert reader.read(frame, "depth") is None, "asked for again: still under way"
    assert np.array_equal(reader.read(frame, "depth", wait=True), frame.depth()), "a click has the exact answer at once"
