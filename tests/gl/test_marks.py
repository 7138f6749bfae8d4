"""Selected, hidden and reclassified points in the rasterisers, against scenes from which the same was done in NumPy."""

from dataclasses import replace

import numpy as np
import pytest
from clouds import camera_in, room
from test_edits import pictures, without

from pointglass.viewer.grid.records.point_marks import file_keys, marks_of
from pointglass.viewer.grid.scene import attributes_of, unpack
from pointglass.viewer.picture.colour_modes import category_colours
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.look import Look
from pointglass.viewer.picture.point_sets import LEFT_OUT, MOST_LEVELS, PointLevels, PointSet
from pointglass.viewer.picture.regions import ClassChange, Region
from pointglass.viewer.preprocess.point_attributes import AttributeLayout
from pointglass.viewer.render.raster import points
from pointglass.viewer.render.raster.edit_block import tinted
from pointglass.viewer.work.selection import Selection

RASTERS = ("compute", "points", "cpu")


def with_classes(scene, random):
    """The scene with a class of 1 to 6 for each point."""
    words = np.array(scene.points)
    words[:, 1] = (words[:, 1] & 0xFFFFFF) | random.integers(1, 7, len(words), dtype=np.uint32) << 24
    layout = AttributeLayout(dict.fromkeys(range(1, 7), 1))
    return replace(scene, points=words, checksums=None, meta=replace(scene.meta, attributes=layout))


def with_colours(scene, rgb: np.ndarray):
    words = np.array(scene.points)
    red, green, blue = rgb.astype(np.uint32).T
    words[:, 2] = (words[:, 2] & 0xFF000000) | red | green << 8 | blue << 16
    return replace(scene, points=words, checksums=None)


def random_set(scene, random, share: float) -> tuple[PointSet, np.ndarray]:
    """A set of runs of records, and (N,) bool: which points of the grid it holds."""
    count = sum(records for _, records in file_keys(scene))
    mask = np.repeat(random.random(count // 50 + 1) < share, 50)[:count] ^ (random.random(count) < 0.01)
    return PointSet.of(mask, file_keys(scene)), mask[scene.records.numbers(slice(0, scene.count))]


@pytest.mark.parametrize("raster", RASTERS)
def test_marks_hide_tint_and_reclassify_exactly_their_points(context, raster, seed, monkeypatch):
    monkeypatch.setattr(points, "SOFTWARE_PAGE", 1 << 18)  # several pages
    random = np.random.default_rng(seed)
    scene = with_classes(room(seed, 60_000), random)
    (hidden, gone), (changed, to_nine), (selection, chosen) = (random_set(scene, random, share) for share in (0.2, 0.3, 0.3))
    edits = Edits(regions=(Region("a", hidden, shown=False), Region("b", changed)), selection=selection,
                  reclassified=(ClassChange(9, changed),), hidden_classes=(3, 5))
    classes = np.where(to_nine, 9, attributes_of(scene).classification)
    dropped = gone | np.isin(classes, (3, 5))
    camera = camera_in(scene, seed, (120, 90))
    rgb = unpack(scene)[1]
    for look, colours in ((Look(), rgb), (Look("class"), category_colours("class")[classes])):
        wanted = with_colours(scene, np.where(chosen[:, None], tinted(colours), colours))
        found = pictures(context, scene, camera, raster, replace(edits, look=look))
        assert all(np.array_equal(a, b) for a, b in
                   zip(pictures(context, without(wanted, dropped), camera, raster), found, strict=True))  # fmt: skip
    assert not np.array_equal(found[0], pictures(context, scene, camera, raster, Edits(look=look))[0])


@pytest.mark.parametrize("raster", RASTERS)
def test_levels_colour_and_leave_out_exactly_their_points_beside_other_marks(context, raster, seed):
    """A comparison in the window: levels of points, with a selection, hidden regions and hidden classes."""
    random = np.random.default_rng(seed)
    scene = with_classes(room(seed, 60_000), random)
    (hidden, gone), (changed, to_nine), (selection, chosen) = (random_set(scene, random, share) for share in (0.2, 0.3, 0.3))
    edits = Edits(regions=(Region("a", hidden, shown=False),), selection=selection, reclassified=(ClassChange(9, changed),),
                  hidden_classes=(3, 9))
    levels = random.integers(0, MOST_LEVELS, scene.count).astype(np.uint8)
    levels[random.random(scene.count) < 0.2] = LEFT_OUT
    classes = np.where(to_nine, 9, attributes_of(scene).classification)
    dropped = gone | np.isin(classes, (3, 9)) | (levels == LEFT_OUT)
    camera, rgb = camera_in(scene, seed, (120, 90)), unpack(scene)[1]
    table = random.integers(0, 256, (MOST_LEVELS, 3)).astype(np.uint8)
    for shown, colours in ((table, table[np.minimum(levels, MOST_LEVELS - 1)]), (None, rgb)):
        wanted = with_colours(scene, np.where(chosen[:, None], tinted(colours), colours))
        changes = PointLevels(levels, shown)
        found = pictures(context, scene, camera, raster, replace(edits, changes=changes))
        assert all(np.array_equal(a, b) for a, b in
                   zip(pictures(context, without(wanted, dropped), camera, raster), found, strict=True))  # fmt: skip
        sight = Selection.in_sight(scene, replace(edits, changes=changes))
        xyz, _, _, station = unpack(scene)
        assert np.array_equal(sight.keeps(xyz, station, slice(0, scene.count)), ~dropped), "picks take what is drawn"


def test_marks_follow_their_points_through_a_pool_that_does_not_hold_the_scene(context, seed):
    from pointglass.viewer.picture.settings import Memory, Settings
    from pointglass.viewer.render.renderer import Renderer

    random = np.random.default_rng(seed)
    scene = room(seed, 2_500_000)
    selection, chosen = random_set(scene, random, 0.4)
    camera, rgb = camera_in(scene, seed, (160, 120)), unpack(scene)[1]
    wanted = with_colours(scene, np.where(chosen[:, None], tinted(rgb), rgb))
    expected = pictures(context, wanted, camera, "compute", views=("raw",))[0]
    for raster in RASTERS:
        renderer = Renderer(context, scene, memory=Memory(gpu=16 * 65536 * 12))
        try:
            frame = renderer.render(camera, Settings(view="raw", raster=raster), edits=Edits(selection=selection))
            assert not renderer.pages.residency.holds_all
            assert np.array_equal(frame.image("raw"), expected)
        finally:
            renderer.release()


def test_marks_are_made_once_for_the_same_sets(context, seed):
    scene = room(seed, 20_000)
    selection, chosen = random_set(scene, np.random.default_rng(seed), 0.3)
    marks = marks_of(scene, Edits(selection=selection))
    assert marks is marks_of(scene, Edits(selection=selection, hidden_classes=(2,)))
    assert marks is not None and np.array_equal(marks.of_point == 1, chosen)
