"""Clips, hidden stations and colours by attribute in the rasterisers, against scenes from which the same was done in NumPy."""

from dataclasses import replace

import numpy as np
import pytest
from clouds import camera_in, room

from pointglass.viewer.grid.marked_points import MarkedPoints
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.clip import Box, Slab, contains, normals, vector
from pointglass.viewer.picture.colour_modes import category_colours, levels, ramp_colours
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.look import Look
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.preprocess.scan_description import ColourSummary
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.raster.edit_block import dimmed, ends_of
from pointglass.viewer.render.renderer import Renderer

VIEWS = ("raw", "filtered")


def of_two_stations(scene, seed: int):
    """The scene with random intensities, and points of stations 0 and 37."""
    random = np.random.default_rng(seed)
    points = np.array(scene.points)
    points[:, 1] = (points[:, 1] & 0xFFFF) | (random.integers(0, 65536, len(points), dtype=np.uint32) << 16)
    points[:, 2] = (points[:, 2] & 0xFFFFFF) | (random.choice(np.array([0, 37], np.uint32), len(points)) << 24)
    return replace(scene, points=points, checksums=None)


def without(scene, dropped: np.ndarray):
    """The scene without some of its points, in the same grid."""
    before = np.concatenate([[0], np.cumsum(~dropped)])
    points = np.ascontiguousarray(np.asarray(scene.points)[~dropped])
    return replace(scene, points=points, offsets=before[scene.offsets], count=len(points), checksums=None)


def random_clips(random, scene) -> tuple:
    low, high = scene.bounds
    axes = np.linalg.qr(random.normal(size=(3, 3)))[0]
    rows = tuple(vector(row) for row in axes)
    place = vector(random.uniform(low, high))
    return (Box(vector((low + high) / 2), vector((high - low) * random.uniform(0.3, 0.6)), rows),
            Slab(place, rows[1], float(random.uniform(0.5, 4.0)), removes=bool(random.random() < 0.5)))


def near_a_face(clips, xyz) -> np.ndarray:
    """Where float32 may decide otherwise."""
    near = np.zeros(len(xyz), bool)
    for clip in clips:
        near |= (np.abs(np.abs((xyz - np.array(clip.centre)) @ normals(clip).T) - 1.0) < 1e-4).any(axis=1)
    return near


def pictures(context, scene, camera, raster, edits=None, views=VIEWS) -> list[np.ndarray]:
    renderer = Renderer(context, scene)
    try:
        frame = renderer.render(camera, Settings(view="raw", raster=raster), views=views, edits=edits)
        return [frame.image(view).copy() for view in views] + [frame.depth().copy()]
    finally:
        renderer.release()


@pytest.mark.parametrize("raster", ["compute", "points", "cpu"])
def test_clipped_points_and_hidden_stations_are_not_drawn(context, raster, seed):
    random = np.random.default_rng(seed)
    shown = 0
    for number in range(3):
        scene = of_two_stations(room(seed + number, 30_000, origin=(4e5, 5e6, 100.0)), seed)
        clips = random_clips(random, scene)
        scene = without(scene, near_a_face(clips, unpack(scene)[0]))
        hidden = frozenset({37} if number else ())
        xyz, _, _, station = unpack(scene)
        dropped = ~contains(clips, xyz) | np.isin(station, list(hidden))
        low, high = scene.bounds
        camera = from_fov(120, 90, 90.0, look_at(low + 0.05 * (high - low), (low + high) / 2))  # sees most of the room
        wanted = pictures(context, without(scene, dropped), camera, raster)
        found = pictures(context, scene, camera, raster, Edits(clips=clips, hidden_stations=tuple(hidden)))
        assert all(np.array_equal(a, b) for a, b in zip(wanted, found, strict=True))
        shown += int(np.isfinite(found[-1]).sum())
        assert not np.array_equal(found[-1], pictures(context, scene, camera, raster)[-1])
    assert shown > 0


@pytest.mark.parametrize("raster", ["compute", "points", "cpu"])
@pytest.mark.parametrize("colour_by", ["intensity", "height", "station", "distance"])
def test_points_have_the_colour_of_their_attribute(context, raster, colour_by, seed):
    scene = of_two_stations(room(seed, 30_000), seed)
    camera = camera_in(scene, seed, (120, 90))
    up = (0.0, 0.6, 0.8)
    edits = Edits(look=Look(colour_by, "turbo"), up=up)
    xyz, _, intensity, station = unpack(scene)
    values = {"intensity": intensity, "height": xyz @ up, "station": station,
              "distance": np.linalg.norm(xyz - camera.position, axis=1)}[colour_by]  # fmt: skip
    if colour_by == "station":
        colours = category_colours("station")[values]
    else:
        colours = ramp_colours("turbo")[levels(values, *ends_of(edits, scene, camera))]
    points = np.array(scene.points)
    red, green, blue = colours.astype(np.uint32).T
    points[:, 2] = (points[:, 2] & 0xFF000000) | red | green << 8 | blue << 16
    wanted = pictures(context, replace(scene, points=points), camera, raster)
    found = pictures(context, scene, camera, raster, edits)
    assert np.array_equal(wanted[-1], found[-1])
    for a, b in zip(wanted[:2], found[:2], strict=True):
        changed = (a != b).any(axis=-1)
        assert changed.mean() < 0.005  # float32 rounds to another of 256 levels at the border between two
        assert np.abs(a.astype(int) - b)[changed].max(initial=0) <= 16


def test_a_black_attribute_is_a_colour_where_black_points_have_none(context, seed):
    scene = of_two_stations(room(seed, 20_000), seed)
    scene = replace(scene, meta=replace(scene.meta, colour=ColourSummary("rgb", 8, "", 1.0)))
    low_end = Edits(look=Look("intensity", "grey", 70_000.0, 80_000.0))  # every point at the ramp's black end
    image = pictures(context, scene, camera_in(scene, seed, (60, 50)), "compute", low_end)[0]
    assert (image[..., 3] > 0).any() and (image[..., :3] == 0).all()


def test_without_edits_no_program_knows_of_them(context, seed, monkeypatch):
    asked = []
    compute = Programs.compute
    monkeypatch.setattr(Programs, "compute", lambda self, name, **d: (asked.append((name, d)), compute(self, name, **d))[1])
    scene = room(seed, 10_000)
    camera = camera_in(scene, seed, (50, 40))
    plain = pictures(context, scene, camera, "compute")
    empty = pictures(context, scene, camera, "compute", Edits(clips=(Box((0, 0, 0), (1, 1, 1), active=False),)))
    assert all(np.array_equal(a, b) for a, b in zip(plain, empty, strict=True))
    assert asked and not any("EDITED" in defines for _, defines in asked)
    pictures(context, scene, camera, "compute", Edits(hidden_stations=(3,)))
    assert any("EDITED" in defines for _, defines in asked)


def test_filled_pictures_keep_rgb_and_fill_nothing_where_clips_cut(context, seed):
    scene = room(seed, 40_000)
    low, high = scene.bounds
    middle = (low + high) / 2
    camera = from_fov(100, 80, 60.0, look_at(middle, middle + (1.0, 0.2, 0.0)))
    colours = Edits(look=Look("intensity"))
    plain, recoloured = (pictures(context, scene, camera, "compute", edits, views=("filled",)) for edits in (None, colours))
    assert np.array_equal(plain[0], recoloured[0])
    behind = Box(vector(middle - (2.0, 0.0, 0.0)), (1.9, 9.0, 9.0))  # all that the camera looks at is cut away
    cut = pictures(context, scene, camera, "compute", Edits(clips=(behind,)), views=("filled",))
    assert (plain[0][..., 3] > 0).mean() > 0.9 and (cut[0][..., 3] == 0).all()


@pytest.mark.parametrize("colour_by", ["class", "intensity"])
@pytest.mark.parametrize("raster", ["points", "compute", "cpu"])
def test_a_classified_scan_is_coloured_by_what_its_file_says(context, tmp_path, colour_by, raster):
    import laspy

    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.grid.scene import attributes_of

    random = np.random.default_rng(8)
    xyz, rgb, _, _ = unpack(room(8, 20_000))
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales = np.full(3, 1e-4)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = (rgb.astype(np.uint16) * 257).T
    las.classification = random.choice([2, 6, 17], len(xyz))
    las.intensity = random.integers(100, 60_000, len(xyz))
    las.write(str(tmp_path / "a.las"))
    scene = open_scene([tmp_path / "a.las"], cache=False)
    held = attributes_of(scene)
    assert held.classification is not None and held.intensity is not None
    look = Look(colour_by=colour_by, low=0.0, high=60_000.0)
    if colour_by == "class":
        expected = category_colours("class")[held.classification]
    else:
        expected = ramp_colours("viridis")[levels(held.intensity, 0.0, 60_000.0)]
    camera = camera_in(scene, 4, (160, 120))
    shown = pictures(context, scene, camera, raster, Edits(look=look))[0]
    words = np.array(scene.points)
    recoloured = expected.astype(np.uint32)
    words[:, 2] = (words[:, 2] & 0xFF000000) | recoloured[:, 0] | recoloured[:, 1] << 8 | recoloured[:, 2] << 16
    assert (shown == pictures(context, replace(scene, points=words, checksums=None), camera, raster)[0]).mean() > 0.9999


@pytest.mark.parametrize("raster", ["compute", "points", "cpu"])
def test_hidden_ghosts_are_not_drawn_and_dimmed_ones_are_grey(context, raster, seed):
    scene = of_two_stations(room(seed, 30_000), seed)
    random = np.random.default_rng(seed)
    numbers = np.flatnonzero(random.random(scene.count) < 0.4)
    marked = replace(scene, marked=MarkedPoints(numbers, 200))
    camera = camera_in(scene, seed, (120, 90))
    gone = np.zeros(scene.count, bool)
    gone[numbers] = True
    wanted = pictures(context, without(scene, gone), camera, raster)
    found = pictures(context, marked, camera, raster, Edits(ghosts="hidden"))
    assert all(np.array_equal(a, b) for a, b in zip(wanted, found, strict=True))
    points = np.array(scene.points)
    red, green, blue = dimmed(unpack(scene, numbers)[1]).astype(np.uint32).T
    points[numbers, 2] = (points[numbers, 2] & 0xFF000000) | red | green << 8 | blue << 16
    wanted = pictures(context, replace(scene, points=points), camera, raster)
    found = pictures(context, marked, camera, raster, Edits(ghosts="dimmed"))
    assert all(np.array_equal(a, b) for a, b in zip(wanted, found, strict=True))
    assert not np.array_equal(found[0], pictures(context, scene, camera, raster)[0])
    plain = pictures(context, scene, camera, raster)
    assert all(np.array_equal(a, b) for a, b in zip(plain, pictures(context, scene, camera, raster, Edits(ghosts="hidden"))))
