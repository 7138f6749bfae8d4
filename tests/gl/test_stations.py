"""View-dependent blending: the OpenGL frame against its reference implementation in torch, and against itself."""

import numpy as np
import pytest
from clouds import camera_in, scanned
from reference import reference_frame
from test_frame import ALL, assert_agrees

from pointglass.model.reference.projection import MAX_AVERAGED
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.settings import FILTERS, Settings
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary

pytestmark = pytest.mark.gl


@pytest.mark.parametrize("scale, unknown", [(1e-3, ()), (1.0, (1,)), (1e3, ()), (1e6, (1,))])
def test_weighted_frame_agrees_with_the_reference(renderer_of, scale, unknown, seed):
    scene = scanned(seed, scale, unknown=unknown)
    renderer = renderer_of(scene)
    for number, lod in enumerate((None, 1.0)):
        camera, settings = camera_in(scene, seed + number), Settings(lod=lod)
        frame = renderer.render(camera, settings, views=ALL)
        assert frame.facts.stations == "weighed"
        assert_agrees(frame, reference_frame(scene, camera, settings))


def test_scan_numbers_beyond_those_that_are_listed_are_unknown(renderer_of, seed):
    """The 256th scan and all later ones share a number that stands for none of them."""
    scene = scanned(seed)
    scene.points[::3, 2] |= np.uint32(0xFF000000)
    scene.points[1::7, 2] |= np.uint32(0x50000000)
    renderer = renderer_of(scene)
    for kind in ("compute", "points"):
        camera, settings = camera_in(scene, seed), Settings(raster=kind)
        assert_agrees(renderer.render(camera, settings, views=ALL), reference_frame(scene, camera, settings))


@pytest.mark.parametrize("preset, size", [*((preset, (97, 61)) for preset in FILTERS), ("auto", (4, 4)), ("auto", (256, 131))])
def test_every_filter_and_odd_sizes_agree_with_the_reference(renderer_of, preset, size, seed):
    scene = scanned(seed, places=5)
    camera, settings = camera_in(scene, seed, size), Settings(filter=preset)
    assert_agrees(renderer_of(scene).render(camera, settings, views=ALL), reference_frame(scene, camera, settings))


def test_one_renderer_draws_every_size_as_another_would(renderer_of, seed):
    scene = scanned(seed)
    one = renderer_of(scene)
    for size in ((97, 61), (160, 131), (40, 30), (97, 61)):
        camera = camera_in(scene, seed, size)
        frames = [renderer.render(camera, Settings(), views=ALL) for renderer in (one, renderer_of(scene))]
        assert all(frames[0].image(view).tobytes() == frames[1].image(view).tobytes() for view in ALL)


def test_both_rasterisers_give_the_same_picture(renderer_of, agree, seed):
    scene = scanned(seed)
    renderer, weights_matter = renderer_of(scene), []
    for number in range(3):
        camera, images = camera_in(scene, seed + number), []
        for kind, stations in zip(("compute", "points", "points", "compute", "compute"),
                                  ("auto", "auto", "equal", "equal", "auto"), strict=True):
            frame = renderer.render(camera, Settings(raster=kind, stations=stations), views=ALL)
            images.append({v: frame.image(v).copy() for v in ALL})
        assert agree(images[1], images[0]) and agree(images[2], images[3])
        assert all(np.array_equal(images[0][v], images[4][v]) for v in ALL)
        weights_matter.append(not np.array_equal(images[0]["raw"], images[2]["raw"]))
    assert any(weights_matter)  # a random camera may look past everything


def test_pages_and_bands_change_no_pixel(context, renderer_of, monkeypatch, seed):
    scene = scanned(seed)
    camera, settings = camera_in(scene, seed), Settings(raster="compute")
    whole = [renderer_of(scene).render(camera, settings, views=ALL).image(v) for v in ALL]
    from pointglass.viewer.render.raster import raster_shader

    monkeypatch.setattr(raster_shader, "_CARRY_BYTES", 1 << 16)  # a band is a few rows
    renderer = renderer_of(scene)
    assert np.array_equal(whole, [renderer.render(camera, settings, views=ALL).image(v) for v in ALL])
    assert renderer._passes.rasterisers["compute"].band_rows < camera.height


def test_a_colour_comes_from_the_station_that_stood_where_the_eye_is(renderer_of):
    """Two stations photographed one wall, red from the left and blue from the right; each eye sees what was seen from there."""
    rng = np.random.default_rng(4)
    wall = np.stack([rng.uniform(-2, 2, 60_000), np.zeros(60_000), rng.uniform(-1.5, 1.5, 60_000)], 1)
    scan = rng.integers(0, 2, len(wall)).astype(np.uint8)
    rgb = np.where(scan[:, None] == 0, [220, 20, 20], [20, 20, 220]).astype(np.uint8)
    places = np.array([(-3.0, -3.0, 0.0), (3.0, -3.0, 0.0)])
    scans = tuple(ScanSummary(str(k), int((scan == k).sum()), tuple(place)) for k, place in enumerate(places.tolist()))
    renderer = renderer_of(scene_from_arrays(wall, rgb, scan=scan, meta=ScanDescription(scans=scans)))
    from pointglass.viewer.picture.camera import from_fov, look_at

    for number, place in enumerate(places):
        camera = from_fov(160, 120, 40, look_at(place, np.zeros(3)))
        shown, equal = (
            renderer.render(camera, Settings(stations=way), views=("filled",)).image("filled")[40:80, 60:100, :3].mean((0, 1))
            for way in ("auto", "equal")
        )
        mine, other = (0, 2) if number == 0 else (2, 0)
        assert shown[mine] > 200 and shown[other] < 90
        assert abs(equal[0] - equal[2]) < 30


@pytest.mark.parametrize("kind", ["compute", "points", "cpu"])
def test_heavy_sums_are_carried(renderer_of, kind):
    """A hundred thousand white points of the heaviest weight in one pixel keep their mean."""
    count = 100_000
    xyz = np.zeros((2 * count, 3)) + [0.0, 5.0, 0.0]
    xyz[count:, 0] = 1.0
    rgb = np.full((2 * count, 3), 255, np.uint8)
    rgb[count:] = (10, 128, 255)
    scan = (np.arange(2 * count) % 2).astype(np.uint8)
    scans = tuple(ScanSummary(str(k), count, (0.5 * k, 0.0, 0.0)) for k in range(2))
    scene = scene_from_arrays(xyz, rgb, scan=scan, meta=ScanDescription(scans=scans))
    from pointglass.viewer.picture.camera import Camera

    pose = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
    camera = Camera(5, 3, 5.0, 5.0, 2.5, 1.5, pose)
    renderer = renderer_of(scene)
    for _ in range(2):
        raw = renderer.render(camera, Settings(raster=kind), views=("raw",)).image("raw")
        assert raw[1, 2].tolist() == [255, 255, 255, 255] and raw[1, 3].tolist() == [10, 128, 255, 255]
        assert renderer._passes.rasterisers[kind].weight is not None
        weight = np.frombuffer(renderer._passes.rasterisers[kind].weight.read(alignment=1), np.uint8).reshape(3, 5)
        assert weight[1, 2] == MAX_AVERAGED and weight[0, 0] == 0
