"""Rasteriser and depth filter of compiled loops against the shaders, to the byte, and what only they have: threads, mapped
buffers."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from clouds import before_slats, camera_in, room, scanned, slats
from test_edits import of_two_stations, random_clips

from pointglass.model.common.atomics import atomic_add, atomic_max
from pointglass.model.common.jit import compiled
from pointglass.model.common.process import processors
from pointglass.viewer.picture.colour_modes import COLOUR_BY
from pointglass.viewer.picture.edits import Edits
from pointglass.viewer.picture.look import Look
from pointglass.viewer.picture.settings import SOFT_Z, Settings
from pointglass.viewer.preprocess.scan_description import ColourSummary
from pointglass.viewer.render.device.context import describe_device
from pointglass.viewer.render.raster import raster_cpu
from pointglass.viewer.render.raster.raster_cpu import mapped

pytestmark = pytest.mark.gl
VIEWS = ("raw", "filled")


@pytest.fixture(autouse=True)
def software(context):
    if not describe_device(context).software:
        pytest.skip("bytes are promised in software OpenGL only")


def made_by(renderer, kind, camera, settings=None, edits=None, views=VIEWS) -> list[bytes]:
    settings = replace(settings or Settings(), raster=kind)
    frame = renderer.render(camera, settings, views=views, edits=edits)
    assert frame.stats["raster"] == kind
    weight = renderer._passes.rasterisers[kind].weight.read()
    return [*(frame.image(view).tobytes() for view in views), frame.depth().tobytes(), weight]


def assert_same(renderer, camera, settings=None, edits=None, views=VIEWS):
    cpu, shader = (made_by(renderer, kind, camera, settings, edits, views) for kind in ("cpu", "compute"))
    assert cpu == shader
    return cpu


@compiled(nogil=True)
def _count(counter, most, calls, value):
    for _ in range(calls):
        atomic_add(counter, 1, np.uint64(3))
        atomic_max(most, 0, value)


def test_atomic_operations_lose_nothing_between_threads():
    counter, most, calls = np.zeros(3, np.uint64), np.zeros(1, np.uint32), 200_000
    with ThreadPoolExecutor(8) as pool:
        list(pool.map(lambda value: _count(counter, most, calls, np.uint32(value)), (5, 1 << 31, 7, 3, 1, 9, 2, 4)))
    assert counter.tolist() == [0, 8 * 3 * calls, 0] and most[0] == 1 << 31


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e6])
def test_every_depth_tolerance_and_level_of_detail(renderer_of, scale, seed):
    scene = room(seed, 60_000, scale=scale)
    renderer, seen = renderer_of(scene), 0
    for number, soft_z in enumerate(SOFT_Z):
        for size, lod in (((97, 61), None), ((333, 251), 2.0), ((1, 37), None)):
            camera = camera_in(scene, seed + number, size, fov=100.0)
            made = assert_same(renderer, camera, Settings(soft_z=soft_z, lod=lod))
            seen += np.isfinite(np.frombuffer(made[-2], "<f4")).sum()
    assert seen > 10_000


def test_weights_of_stations(renderer_of, seed):
    for unknown in ((), (1,)):
        scene = scanned(seed, unknown=unknown)
        scene.points[::9, 2] |= np.uint32(0xFF000000)  # a number that is not listed
        renderer = renderer_of(scene)
        for number in range(4):
            assert_same(renderer, camera_in(scene, seed + number))


def test_points_without_a_colour(renderer_of, seed):
    base = room(seed)
    points = base.points.copy()
    points[np.random.default_rng(seed).random(base.count) < 0.4, 2] &= np.uint32(0xFF000000)
    scene = replace(base, points=points, meta=replace(base.meta, colour=ColourSummary("rgb", 8, "", 0.4)))
    renderer = renderer_of(scene)
    for number in range(3):
        assert_same(renderer, camera_in(scene, seed + number))


@pytest.mark.parametrize("strength, levels", [(1.0, None), (0.3, 1), (2.5, 2), (1.0, 7)])
def test_the_depth_filter_on_the_processor_keeps_the_same_pixels(renderer_of, strength, levels, seed):
    """At sizes whose levels are odd, even, and mirrored about a single pixel."""
    scene, barred = room(seed), slats(seed)
    kept = []
    for number, size in enumerate(((97, 61), (333, 251), (1, 37), (53, 1), (8, 8), (33, 16), (97, 61), (320, 240))):
        renderer = renderer_of(barred if size == (320, 240) else scene)
        camera = before_slats(seed, size) if size == (320, 240) else camera_in(scene, seed + number, size)
        settings, masks = Settings(filter_strength=strength, filter_levels=levels), []
        for kind in ("cpu", "compute"):
            frame = renderer.render(camera, replace(settings, raster=kind), views=("filtered", "filled"))
            masks.append((frame.mask().tobytes(), frame.image("filtered").tobytes(), frame.image("filled").tobytes()))
            kept.append((frame.mask().sum(), np.isfinite(frame.depth()).sum()))
        assert masks[0] == masks[1], size
    assert 0 < sum(mask for mask, _ in kept) < sum(held for _, held in kept), "it removed some, and not all"


@pytest.mark.parametrize("colour_by", list(COLOUR_BY))
def test_edits(renderer_of, colour_by, seed):
    """Float32 decides both ways at the faces of clips and between levels, by the same operations."""
    scene = of_two_stations(room(seed, 40_000, origin=(4e5, 5e6, 100.0)), seed)
    renderer, random, changed = renderer_of(scene), np.random.default_rng(seed), 0
    for number in range(3):
        clips = random_clips(random, scene) if number else ()
        edits = Edits(clips=clips, hidden_stations=(37,) if number == 2 else (), look=Look(colour_by, "turbo"),
                      up=(0.0, 0.6, 0.8))
        camera = camera_in(scene, seed + number, (120, 90))
        changed += assert_same(renderer, camera, None, edits, ("raw",)) != made_by(renderer, "cpu", camera, views=("raw",))
    assert changed or colour_by == "rgb"


@pytest.mark.parametrize("threads", [1, 3, 16])
def test_any_number_of_threads_makes_the_same_picture(renderer_of, monkeypatch, threads, seed):
    scene = scanned(seed)
    camera = camera_in(scene, seed, (160, 120), fov=100.0)
    wanted = made_by(renderer_of(scene), "compute", camera)
    monkeypatch.setattr(processors, "_threads", [threads])
    renderer = renderer_of(scene)
    for _ in range(3):
        assert made_by(renderer, "cpu", camera) == wanted


def test_an_error_leaves_nothing_in_the_next_picture(renderer_of, monkeypatch, seed):
    scene = room(seed)
    renderer, camera = renderer_of(scene), camera_in(scene, seed, fov=100.0)
    wanted = made_by(renderer, "cpu", camera)

    def broken(*_):
        raise RuntimeError("broken here")

    with monkeypatch.context() as patch:
        patch.setattr(raster_cpu, "resolve_pixels", broken)  # the sums are made, and nobody reads them
        with pytest.raises(RuntimeError, match="broken here"):
            made_by(renderer, "cpu", camera)
    assert made_by(renderer, "cpu", camera) == wanted


def test_a_mapped_buffer_is_the_buffer_and_can_be_written_afterwards(context, seed):
    words = np.random.default_rng(seed).integers(0, 1 << 32, 5000, dtype=np.uint32)
    buffer = context.buffer(words.tobytes())
    try:
        with mapped(buffer) as held:
            assert np.array_equal(held, words)
        buffer.write(words[::-1].tobytes())
        with mapped(buffer) as held:
            assert np.array_equal(held, words[::-1])
        assert context.error == "GL_NO_ERROR"
    finally:
        buffer.release()
