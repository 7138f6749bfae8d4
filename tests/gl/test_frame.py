"""The OpenGL frame against its reference implementation in torch on the same packed points, and against itself."""

from dataclasses import replace

import numpy as np
import pytest
from clouds import before_slats, camera_in, room, slats
from reference import reference_frame

from pointglass.model.common.linear_light import TO_LINEAR, TO_SRGB
from pointglass.model.reference import depth_filter
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.camera import Camera
from pointglass.viewer.picture.settings import FILTERS, SOFT_Z, Settings
from pointglass.viewer.preprocess.scan_description import ColourSummary
from pointglass.viewer.render.device.context import describe_device
from pointglass.viewer.render.device.device_class import DIFFERING_PIXELS, FOLLOWING_PIXELS
from pointglass.viewer.render.raster import raster_compute
from pointglass.viewer.render.raster.choose_raster import RasterChoice
from pointglass.viewer.render.renderer import Renderer

pytestmark = pytest.mark.gl
ALL = ("raw", "filtered", "filled")
FILTER_AND_SOFT_Z = [*((preset, "auto") for preset in FILTERS), *(("auto", soft_z) for soft_z in SOFT_Z if soft_z != "auto"),
                     ("paper-code", "paper-code")]
"""Every filter, every depth tolerance, and the published pair: one is applied after the other, with limits of its own."""


@pytest.fixture(scope="module")
def drawn(context):
    scene = room(1)
    renderer = Renderer(context, scene)
    yield scene, renderer
    renderer.release()


def assert_agrees(frame, reference):
    """Depth to the bit; colour and mask exact; the filled picture to the rounding of one level.

    On a GPU within the tolerance stated in viewer/render/device/device_class.py; and a confidence or a tone between two steps.
    """
    wrong = frame.depth() != reference.raster.depth.numpy()
    colour = reference.raster.colour.permute(1, 2, 0).numpy()
    wrong |= (frame.image("raw")[..., :3] != colour).any(-1)
    software = describe_device(frame.depth_texture.ctx).software
    assert wrong.sum() <= (0 if software else max(2, DIFFERING_PIXELS * wrong.size))
    around = FOLLOWING_PIXELS * wrong.size if wrong.any() else 0
    between = 0 if software else 1e-3 * wrong.size
    assert (frame.mask() != reference.mask).sum() <= around
    image = frame.image("filled")
    same_alpha = np.abs(image[..., 3] / 255 - reference.alpha) < 0.51 / 255
    assert (~same_alpha).sum() <= 2e-4 * same_alpha.size + 2 + around  # float32 rays on the border of a direction cell
    filled = np.clip(reference.shown, 0, 1).transpose(1, 2, 0) * 255 * reference.alpha[..., None]
    assert (np.abs(image[..., :3] - filled)[same_alpha].max(-1) > 0.51).sum() <= max(around, between)


def sums(renderer) -> np.ndarray:
    """Colour sums and counts of the last picture: what the mean of a pixel's points does not tell."""
    return np.frombuffer(renderer._passes.rasterisers["compute"].sums.read(), np.uint32)


@pytest.mark.parametrize("number, scale", [(0, 1e-3), (1, 1.0), (2, 1e3)])
@pytest.mark.parametrize("preset", list(FILTERS))
def test_frame_agrees_with_the_reference(context, number, scale, preset):
    scene = room(7, scale=scale)
    renderer = Renderer(context, scene)
    try:
        camera, settings = camera_in(scene, number), Settings(filter=preset)
        assert_agrees(renderer.render(camera, settings, views=ALL), reference_frame(scene, camera, settings))
    finally:
        renderer.release()


@pytest.mark.parametrize("preset, soft_z", FILTER_AND_SOFT_Z)
def test_a_file_in_another_unit_agrees_with_the_reference(context, preset, soft_z, seed):
    """Of the published presets some limits are metres, whatever the file's unit is."""
    metre = 1000.0
    base = room(seed, scale=metre)
    scene = replace(base, meta=replace(base.meta, metres_per_unit=1 / metre))
    camera, settings = camera_in(scene, seed), Settings(filter=preset, soft_z=soft_z)
    renderer = Renderer(context, scene)
    try:
        assert_agrees(renderer.render(camera, settings, views=ALL), reference_frame(scene, camera, settings, metre=metre))
    finally:
        renderer.release()


@pytest.mark.parametrize(("threads", "stretch"), [(1, 8), (2, 1), (3, 2), (5, 1), (64, 8)])
def test_every_batch_is_drawn_once_however_they_are_dealt_out(context, monkeypatch, drawn, threads, stretch, seed):
    """Told by the sums: a batch drawn twice changes no mean."""
    scene, renderer = drawn
    camera, settings = camera_in(scene, seed, fov=100.0), Settings(raster="compute")
    wanted = renderer.render(camera, settings, views=("raw",))
    depth, colour = wanted.depth().copy(), wanted.image("raw").copy()
    monkeypatch.setattr(raster_compute, "usable_processors", lambda: threads)
    monkeypatch.setattr(raster_compute, "STRETCH", stretch)
    other = Renderer(context, scene)
    try:
        frame = other.render(camera, settings, views=("raw",))
        assert np.array_equal(frame.depth(), depth) and np.array_equal(frame.image("raw"), colour)
        assert np.array_equal(sums(other), sums(renderer))
    finally:
        other.release()


@pytest.mark.parametrize("soft_z", list(SOFT_Z))
def test_soft_z_presets_agree_with_the_reference(drawn, soft_z):
    scene, renderer = drawn
    camera, settings = camera_in(scene, 3), Settings(soft_z=soft_z)
    assert_agrees(renderer.render(camera, settings, views=ALL), reference_frame(scene, camera, settings))


@pytest.mark.parametrize("preset, soft_z", FILTER_AND_SOFT_Z)
def test_points_without_a_colour_hide_and_show_nothing(context, preset, soft_z, seed):
    base = room(seed)
    black = np.random.default_rng(seed).random(base.count) < 0.4
    points = base.points.copy()
    points[black, 2] &= np.uint32(0xFF000000)
    scene = replace(base, points=points, meta=replace(base.meta, colour=ColourSummary("rgb", 8, "", 0.4)))
    assert scene.unlit and not base.unlit
    plain, renderer = Renderer(context, base), Renderer(context, scene)
    try:
        camera, bytes_of = camera_in(scene, seed), []
        reference = reference_frame(scene, camera, Settings(filter=preset, soft_z=soft_z))
        for kind in ("compute", "points"):
            settings = Settings(filter=preset, soft_z=soft_z, raster=kind)
            frame = renderer.render(camera, settings, views=ALL)
            assert_agrees(frame, reference)
            raw, held = frame.image("raw"), np.isfinite(frame.depth())
            if soft_z == "auto":
                assert (held & (raw[..., 3] == 0)).any() and not (frame.mask() & (raw[..., 3] == 0)).any()
                assert (raw[..., :3].any(-1) | (raw[..., 3] == 0)).all(), "no black pixel is shown"
            else:
                assert np.array_equal(held, raw[..., 3] > 0), "the paper's z-buffer knows colours only"
            bytes_of.append([frame.image(view).tobytes() for view in ALL])
            assert np.array_equal(frame.depth(), plain.render(camera, settings, views=("raw",)).depth()), "they hide as before"
        assert bytes_of[0] == bytes_of[1]
    finally:
        plain.release()
        renderer.release()


@pytest.mark.parametrize("size", [(1, 1), (1, 37), (53, 1), (127, 97), (2, 2), (333, 251)])
def test_odd_and_prime_sizes_agree_with_the_reference(drawn, size):
    scene, renderer = drawn
    camera, settings = camera_in(scene, 5, size), Settings()
    assert_agrees(renderer.render(camera, settings, views=ALL), reference_frame(scene, camera, settings))


@pytest.mark.parametrize("strength, levels", [(0.3, 2), (1.0, 1), (2.5, 7)])
@pytest.mark.parametrize("preset", ["auto", "paper-code", "paper-text", "npbg++"])
def test_filter_flags_agree_with_the_reference(drawn, preset, strength, levels):
    scene, renderer = drawn
    camera = camera_in(scene, 11)
    settings = Settings(filter=preset, filter_strength=strength, filter_levels=levels)
    assert_agrees(renderer.render(camera, settings, views=ALL), reference_frame(scene, camera, settings))


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_thin_things_in_front_agree_with_the_reference(context, monkeypatch, scale, seed):
    """The depth filter's rule for few but clumped points decides on many of these pixels."""
    scene, decided = slats(seed, scale), 0
    renderer = Renderer(context, scene)
    try:
        for number, size in enumerate(((320, 240), (211, 127))):
            camera = before_slats(seed + number, size, scale)
            reference = reference_frame(scene, camera, Settings())
            assert_agrees(renderer.render(camera, Settings(), views=ALL), reference)
            monkeypatch.setattr(depth_filter, "CLUMPED", 1e9)
            decided += (reference_frame(scene, camera, Settings()).mask != reference.mask).sum()
            monkeypatch.undo()
        assert decided > 50
    finally:
        renderer.release()


@pytest.mark.parametrize("lod", [None, 1.0, 4.0])
def test_both_rasterisers_give_the_same_picture(drawn, lod, agree):
    """And one of them the same bytes twice, on every device: its sums are integers."""
    scene, renderer = drawn
    for seed in range(4):
        camera = camera_in(scene, 20 + seed)
        images = []
        for kind in ("compute", "points", "compute"):
            frame = renderer.render(camera, Settings(raster=kind, lod=lod), views=ALL)
            images.append({**{v: frame.image(v).copy() for v in ALL}, "depth": frame.depth().copy(), "mask": frame.mask()})
        assert agree(images[1], images[0])
        assert all(np.array_equal(images[0][name], images[2][name]) for name in images[0])


def test_a_million_points_in_one_pixel_keep_their_mean(context):
    rng = np.random.default_rng(0)
    rgb = np.full((1_000_000, 3), 254, np.uint8)
    rgb[:500_001] = 255
    xyz = np.zeros((len(rgb), 3)) + [0.0, 5.0, 0.0] + rng.uniform(-1e-6, 1e-6, (len(rgb), 3))
    scene = scene_from_arrays(xyz, rgb)
    camera = Camera(3, 3, 10.0, 10.0, 1.5, 1.5, np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]]))
    renderer = Renderer(context, scene)
    try:
        for kind in ("compute", "points", "cpu"):
            frame = renderer.render(camera, Settings(raster=kind), views=("raw",))
            assert frame.image("raw")[1, 1].tolist() == [255, 255, 255, 255]
            assert np.isfinite(frame.depth()).sum() == 1
    finally:
        renderer.release()


@pytest.mark.parametrize("kind", ["compute", "points"])
def test_sums_past_sixteen_bits_are_carried_and_gone_in_the_next_frame(context, kind, monkeypatch):
    """Crowds of 1 to 200,000 points, a pixel each, about the edges of 16 and 32 bits; then fewer, then after a broken frame."""
    rng = np.random.default_rng(5)
    crowds = [1, 15, 16, 17, 18, 33, 256, 257, 4097, 65_535, 65_536, 65_537, 200_000]
    scenes = []
    for share in (1.0, 0.5):
        rgb, xyz, want = [], [], []
        for column, crowd in enumerate(crowds):
            n = int(np.ceil(share * crowd))
            levels = rng.integers(0, 256, 3) if column % 2 else np.array([255, 0, 255])
            colours = np.clip(levels + rng.integers(-3, 4, (n, 3)), 0, 255).astype(np.uint8)
            rgb.append(colours)
            sums = TO_LINEAR[colours].astype(np.int64).sum(axis=0)  # the mean in linear light, rounded half up
            want.append(TO_SRGB[(2 * sums + n) // (2 * n)].astype(np.uint8))
            xyz.append(np.tile([(column + 0.5 - 7) * 0.5, 5.0, 0.0], (n, 1)))
        scenes.append((scene_from_arrays(np.concatenate(xyz), np.concatenate(rgb)), np.array(want)))
    camera = Camera(14, 1, 10.0, 10.0, 7.0, 0.5, np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]]))
    renderers = [Renderer(context, scene) for scene, _ in scenes]
    settings = Settings(raster=kind)
    renderers[1]._passes.rasterisers = renderers[0]._passes.rasterisers  # the same sums for both
    renderers[1]._passes.size = renderers[0]._passes.size = (14, 1)

    def shown(number: int) -> np.ndarray:
        return renderers[number].render(camera, settings, views=("raw",)).image("raw")[0, : len(crowds), :3]

    def broken():
        raise RuntimeError("broken here")

    try:
        for number in (0, 0, 1, 0, 1):
            assert np.array_equal(shown(number), scenes[number][1])
        rasteriser = renderers[0]._passes.rasterisers[kind]
        with monkeypatch.context() as patch:
            patch.setattr(rasteriser, "_copy", broken)  # the sums are made, and nobody reads them
            with pytest.raises(RuntimeError, match="broken here"):
                shown(0)
        assert np.array_equal(shown(1), scenes[1][1])
    finally:
        renderers[1]._passes.rasterisers = {}
        for renderer in renderers:
            renderer.release()


@pytest.mark.parametrize("software", [True, False])
def test_pages_and_bands_change_no_pixel(context, drawn, software):
    """Storage blocks too small for the scene and for the picture: several pages of points, several bands of rows.  And what is
    told that it runs on a GPU clears its buffers and shares out points as it would there."""
    scene, whole = drawn
    camera = camera_in(scene, 31, (160, 120))
    small = Renderer(context, scene)
    limited = 16 + 16 * 160 * 17  # 17 rows of colour sums
    small.device = type(small.device)(**{**vars(small.device), "storage_limit": limited, "software": software})
    small.choice = RasterChoice("auto", small.device)
    small.pages.release()
    from pointglass.viewer.render.raster.points import PointPages

    small.pages = PointPages(context, scene, limited)
    try:
        assert len(small.pages.buffers) > 3
        for kind in ("compute", "points"):
            a = whole.render(camera, Settings(raster=kind), views=ALL)
            expected = [a.image(v).tobytes() for v in ALL] + [a.depth().tobytes()]
            small.render(camera_in(scene, 32, (160, 120)), Settings(raster=kind), views=ALL)  # and leaves nothing behind
            b = small.render(camera, Settings(raster=kind), views=ALL)
            assert small._passes.rasterisers[kind].band_rows == 17
            assert [b.image(v).tobytes() for v in ALL] + [b.depth().tobytes()] == expected
        c = small.render(camera, Settings(), views=ALL)  # whichever is chosen
        assert [c.image(v).tobytes() for v in ALL] + [c.depth().tobytes()] == expected
        assert c.stats["raster"] == "cpu" or not software
    finally:
        small.release()


@pytest.mark.parametrize("factor", [2.0**-7, 2.0**9])
def test_power_of_two_scaling_changes_no_pixel(context, factor):
    rng = np.random.default_rng(2)
    xyz = rng.uniform(-3, 3, (40_000, 3))
    rgb = rng.integers(0, 256, (len(xyz), 3)).astype(np.uint8)
    frames = []
    for s in (1.0, factor):
        scene = scene_from_arrays(xyz * s, rgb)
        camera = camera_in(scene_from_arrays(xyz, rgb), 4)
        pose = camera.camera_to_world.copy()
        pose[:3, 3] *= s
        renderer = Renderer(context, scene)
        frame = renderer.render(camera.moved(pose), Settings(), views=ALL)
        frames.append([frame.image(v).tobytes() for v in ALL] + [(frame.depth() / np.float32(s)).tobytes()])
        renderer.release()
    assert frames[0] == frames[1]


def test_shift_by_whole_cells_changes_no_pixel(context):
    """No jitter at large coordinates: a shift that float64 holds exactly moves nothing."""
    rng = np.random.default_rng(3)
    xyz = np.round(rng.uniform(0, 8, (30_000, 3)) * 2**16) / 2**16
    rgb = rng.integers(0, 256, (len(xyz), 3)).astype(np.uint8)
    frames = []
    for shift in (np.zeros(3), np.array([2.0**23, -(2.0**22), 2.0**12])):
        scene = scene_from_arrays(xyz + shift, rgb)
        camera = camera_in(scene_from_arrays(xyz, rgb), 9)
        pose = camera.camera_to_world.copy()
        pose[:3, 3] = np.round(pose[:3, 3] * 2**16) / 2**16 + shift
        renderer = Renderer(context, scene)
        frame = renderer.render(camera.moved(pose), Settings(), views=ALL)
        frames.append([frame.image(v).tobytes() for v in ALL] + [frame.depth().tobytes()])
        renderer.release()
    assert frames[0] == frames[1]


def test_colours_at_both_ends_and_points_behind_the_camera(context):
    xyz = np.array([[0.0, 2, 0], [0.5, 2, 0], [0, -2, 0], [0, 0, 0], [0.2, 1e-12, 0.0]])
    rgb = np.array([[0, 0, 0], [255, 255, 255], [255, 0, 0], [255, 0, 0], [255, 0, 0]], np.uint8)
    camera = Camera(41, 31, 20.0, 20.0, 20.5, 15.5, np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]]))
    renderer = Renderer(context, scene_from_arrays(xyz, rgb))
    try:
        frame = renderer.render(camera, Settings(), views=("raw",))
        image = frame.image("raw")
        assert image[15, 20].tolist() == [0, 0, 0, 255] and image[15, 25].tolist() == [255, 255, 255, 255]
        assert np.isfinite(frame.depth()).sum() == 2  # neither behind nor in the camera's plane
    finally:
        renderer.release()


def test_empty_view_is_empty(drawn):
    scene, renderer = drawn
    camera = camera_in(scene, 1)
    pose = camera.camera_to_world.copy()
    pose[:3, 3] += 1e4 * (pose[:3, 3] - scene.bounds.mean(axis=0)) + 1e5
    away = pose.copy()
    away[:3, 2] *= -1
    away[:3, 0] *= -1
    for matrix in (pose, away):
        frame = renderer.render(camera.moved(matrix), Settings(), views=ALL)
        if not np.isfinite(frame.depth()).any():
            assert not frame.image("filled").any() and not frame.mask().any()
            break
    else:
        pytest.fail("one of two opposite views from far outside must be empty")
