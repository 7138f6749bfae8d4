"""Classes and intensities survive the grid: exactly where 16 bits suffice, within half a step where they are quantised."""

import json

import laspy
import numpy as np
import pytest

from pointglass.viewer.commands.info import facts, format_text, scene_of
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.grid.scene import attributes_of, packed, scan_numbers, unpack
from pointglass.viewer.preprocess.point_attributes import AttributeCounts, AttributeLayout
from pointglass.viewer.readers.source import Chunk

COUNT = 5_000


@pytest.fixture
def rng(seed):
    return np.random.default_rng(seed)


def las_file(path, rng, classes, intensity):
    """Points whose red and green channels hold their running number, so that they are found again in the grid."""
    las = laspy.LasData(laspy.LasHeader(point_format=7, version="1.4"))
    las.header.scales = (1e-3,) * 3
    las.xyz = rng.uniform(0, 10, (COUNT, 3))
    number = np.arange(COUNT)
    las.red, las.green = (number % 251 * 257).astype("u2"), (number // 251 * 257).astype("u2")
    las.blue = np.full(COUNT, 65535, "u2")
    las.classification, las.intensity = classes, intensity
    las.write(path)
    return path


def numbers(rgb):
    return rgb[:, 0].astype(int) + 251 * rgb[:, 1].astype(int)


@pytest.mark.parametrize("widest", [1, 200, 255, 256, 3_000, 65_535])
def test_classes_and_intensities_of_a_las_file_are_kept(tmp_path, rng, widest):
    classes = rng.integers(0, 256, COUNT).astype(np.uint8)
    low = int(rng.integers(0, 65_536 - widest))
    intensity = (low + rng.integers(0, widest + 1, COUNT)).astype(np.uint16)
    scene = open_scene([las_file(tmp_path / "a.las", rng, classes, intensity)], cache=False, match=False)
    order = numbers(unpack(scene)[1])
    found = attributes_of(scene)
    assert np.array_equal(found.classification, classes[order])
    off = np.abs(found.intensity.astype(int) - intensity[order])
    assert off.max() <= max(widest / 255, 1) / 2 + 0.5 and (widest > 255 or off.max() == 0)
    assert np.array_equal(found.intensity, unpack(scene)[2]) and np.array_equal(found.station, scan_numbers(packed(scene)))
    assert scene.attributes.classes == {
        int(code): int(count) for code, count in zip(*np.unique(classes, return_counts=True), strict=True)}
    assert scene.attributes.low == intensity.min()


@pytest.mark.parametrize("code", [0, 1])
def test_unclassified_scans_keep_intensities_exactly(tmp_path, rng, code):
    intensity = rng.integers(0, 65_536, COUNT).astype(np.uint16)
    scene = open_scene([las_file(tmp_path / "a.las", rng, np.full(COUNT, code, np.uint8), intensity)], cache=False, match=False)
    found = attributes_of(scene, slice(100, 900))
    assert found.classification is None
    assert np.array_equal(found.intensity, intensity[numbers(unpack(scene)[1])][100:900])


def test_points_of_files_without_classification_are_class_0(tmp_path, rng):
    """Of several files one has classes, the other has not even the field."""
    one = las_file(tmp_path / "a.las", rng, np.full(COUNT, 6, np.uint8), rng.integers(0, 9, COUNT).astype(np.uint16))
    other = tmp_path / "b.xyz"
    np.savetxt(other, rng.uniform(0, 10, (300, 3)), fmt="%.3f")
    scene = open_scene([one, other], cache=False, match=False)
    found = attributes_of(scene)
    assert found.classification is not None
    assert np.array_equal(found.classification, np.where(found.station == 0, 6, 0))
    assert scene.attributes.classes == {0: 300, 6: COUNT}


def test_the_cache_keeps_attributes_and_info_shows_them(tmp_path, rng, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    classes = np.where(np.arange(COUNT) < 1234, 2, 6).astype(np.uint8)
    file = las_file(tmp_path / "a.las", rng, classes, rng.integers(7, 40_000, COUNT).astype(np.uint16))
    fresh, cached = open_scene([file]), open_scene([file])
    for one, other in zip(vars(attributes_of(fresh)).values(), vars(attributes_of(cached)).values(), strict=True):
        assert np.array_equal(one, other)
    scene = scene_of([file])
    assert facts(scene)["attributes"]["class"] == {"2": 1234, "6": COUNT - 1234}
    assert "2: 1,234 points, 6: 3,766 points" in format_text(scene) and "intensity" in format_text(scene)


def test_reading_back_what_was_packed_is_within_half_a_step(rng):
    for _ in range(50):
        low, high = sorted(rng.integers(0, 65_536, 2).tolist())
        layout = AttributeLayout({0: 1, 9: 1}, low, high)
        assert AttributeLayout.from_json(json.loads(json.dumps(layout.to_json())), "attributes") == layout
        intensity, classes = rng.integers(low, high + 1, 500).astype(np.uint16), rng.integers(0, 256, 500).astype(np.uint8)
        bits = layout.pack(classes, intensity, 500)
        assert np.array_equal(layout.class_of(bits), classes)
        assert np.abs(layout.intensity_of(bits).astype(float) - intensity).max() <= layout.step / 2 + 0.5
        assert np.abs(layout.intensity_of(layout.pack(None, np.array([low, high], np.uint16), 2)) - [low, high]).max() == 0


def test_counting_can_be_reset():
    counts = AttributeCounts()
    chunk = Chunk(np.zeros((3, 3)), None, np.array([4, 5, 6], np.uint16), classification=np.array([2, 2, 9], np.uint8))
    for _ in range(2):
        counts.reset()
        counts.add(0, 0, chunk)
    assert counts.layout() == AttributeLayout({2: 2, 9: 1}, 4, 6)


@pytest.mark.parametrize("wrong", [[], {"class": 3}, {"class": {"300": 1}}, {"class": {"x": 1}}, {"intensity": {"low": 5}},
                                   {"intensity": {"low": 9, "high": 3}}])
def test_invalid_descriptions_of_attributes_are_refused(wrong):
    with pytest.raises(InputError, match=r"^attributes"):
        AttributeLayout.from_json(wrong, "attributes")
