"""Reprojection and the depth of the filled picture against their references, and what a moved picture must never do."""

import threading
from dataclasses import replace

import numpy as np
import pytest
from clouds import room

from pointglass.model.network.network_layout import DEPTH_FEATURE_SCALE
from pointglass.model.reference.reprojection import COUNTED, SHARE, WIDER, reprojected, smoothed, smoothing_of
from pointglass.viewer.picture.camera import Camera, from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.passes.reprojection import BAND_ROWS, BANDS, Keyframe, Reprojection
from pointglass.viewer.render.renderer import Renderer

pytestmark = pytest.mark.gl
NEAR = 2.01
"""Levels of 255: the result is rounded to a whole level, and textures are interpolated in steps of 1/256 (OpenGL 4.6, 8.14)."""
FEW = 1e-2
"""Of the pixels: those on a border between two pixels or depths fall to either side in float32."""


def opaque(rng, height: int, width: int, holes: float) -> tuple[np.ndarray, np.ndarray]:
    """A random picture, premultiplied, and the depth of its pixels: planes and steps; 0 where it is not opaque."""
    alpha = np.where(rng.random((height, width, 1)) < holes, rng.integers(0, 255, (height, width, 1)), 255)
    picture = np.concatenate([rng.integers(0, 256, (height, width, 3)) * alpha // 255, alpha], axis=-1).astype(np.uint8)
    x, y = np.meshgrid(np.linspace(0, 1, width), np.linspace(0, 1, height))
    depth = 3.0 + rng.uniform(-0.1, 0.1) * x + rng.uniform(-0.1, 0.1) * y + 2.0 * (x > rng.uniform(0.4, 0.6))
    return picture, np.where(alpha[..., 0] == 255, depth, 0.0).astype(np.float32)


def lens(camera: Camera) -> np.ndarray:
    return np.array([camera.fx, camera.fy, camera.cx, camera.cy])


def texture(context, array):
    width, height = array.shape[1], array.shape[0]
    kind = "f4" if array.dtype == np.float32 else "f1"
    return context.texture((width, height), 1 if array.ndim == 2 else 4, array.tobytes(), alignment=1, dtype=kind)


def moved_by_gl(context, filled, depth, camera, earlier, earlier_depth, earlier_camera, before=None, *, loops=None):
    """The result and the share of moved pixels.  before: what the network made ``earlier`` of."""
    programs = Programs(context)
    keyframe = Keyframe(context, (earlier_camera.width, earlier_camera.height))
    step = Reprojection(programs, (camera.width, camera.height), loops=loops)
    textures = [texture(context, array) for array in (filled, depth, earlier_depth, *([] if before is None else [before]))]
    try:
        keyframe.take_depth(earlier_camera, *textures[2:])
        keyframe.take_picture(earlier)
        result = step.run(textures[0], textures[1], camera, keyframe)
        made = np.frombuffer(result.read(alignment=1), np.uint8).reshape(camera.height, camera.width, 4)
        return made.copy(), step.share
    finally:
        for owned in (programs, keyframe, step, *textures):
            owned.release()


@pytest.mark.parametrize("loops", [True, False])
def test_a_moved_picture_is_that_of_the_reference(context, seed, loops):
    rng = np.random.default_rng(seed)
    rows, columns, size = *rng.integers((20, 20), (90, 600)), tuple(int(n) for n in rng.integers(50, 90, 2))
    width, height = int(columns), int(rows)
    filled, depth = opaque(rng, rows, columns, 0.1)
    before, earlier_depth = opaque(rng, size[1], size[0], 0.1)
    earlier = before.copy()
    earlier[..., :3] = before[..., :3] + 0.7 * (smoothed(before.astype(float)) - before[..., :3])
    eye = np.array([5e5, 4e6, 100.0])
    pose = look_at(eye, eye + (1, 0.02, 0))
    camera = Camera(width, height, width * 0.9, width * 0.9, width / 2, height / 2, pose)
    other = Camera(*size, size[0] * 0.8, size[0] * 0.8, size[0] / 2, size[1] / 2,
                   look_at(eye + rng.uniform(-0.15, 0.15, 3), eye + (1, *rng.uniform(-0.05, 0.05, 2))))
    rows = (size[1] - BAND_ROWS) * (2 * np.arange(BANDS) + 1) // (2 * BANDS)
    smoothing = smoothing_of(*(np.stack([one[row : row + BAND_ROWS] for row in rows]) for one in (before, earlier)))
    made, share = moved_by_gl(context, filled, depth, camera, earlier, earlier_depth, other, before, loops=loops)
    smoothing *= min(1.0, width / size[0]) ** 2
    turn = other.view_rotation @ camera.view_rotation.T
    shift = other.view_rotation @ (np.asarray(camera.position) - other.position)
    wanted, moved = reprojected(filled, depth, earlier, earlier_depth, turn, shift, lens(camera), lens(other),
                                smoothing)
    assert smoothing > 0.01 and moved.mean() > 0.005, "or nothing is tested"
    differs = (np.abs(made - wanted) > NEAR).any(axis=-1)
    assert differs.mean() < FEW, f"{differs.sum()} pixels differ, by {np.abs(made - wanted)[differs].max(axis=-1).round(1)}"
    assert abs(share - moved[::COUNTED, ::COUNTED].mean()) < 0.05


def test_from_the_same_place_each_colour_is_mixed_with_its_own(context, seed):
    rng = np.random.default_rng(seed)
    filled, depth = opaque(rng, 40, 64, 0.2)
    depth[depth > 0] = 2.0
    near = np.clip(filled[..., :3].astype(int) + rng.integers(-40, 41, (40, 64, 3)), 0, 255)
    earlier = np.concatenate([near, filled[..., 3:]], axis=-1).astype(np.uint8)
    camera = Camera(64, 40, 50.0, 50.0, 32.0, 20.0, look_at(np.zeros(3), (1.0, 0, 0)))
    made, share = moved_by_gl(context, filled, depth, camera, earlier, depth, camera)
    solid = depth > 0
    padded = np.pad(filled[..., :3].astype(float), ((1, 1), (1, 1), (0, 0)), mode="edge")
    around = np.stack([padded[y : y + 40, x : x + 64] for y in range(3) for x in range(3)])
    low, high = around.min(axis=0), around.max(axis=0)
    bounded = np.clip(earlier[..., :3], low - WIDER * (high - low), high + WIDER * (high - low))
    wanted = (1 - SHARE) * filled[..., :3] + SHARE * bounded
    assert np.abs(made[..., :3] - wanted)[solid].max() < NEAR
    assert np.array_equal(made[~solid], filled[~solid]), "what is not opaque stays as it was filled"
    assert share == pytest.approx(solid[::COUNTED, ::COUNTED].mean())


def test_what_the_earlier_camera_did_not_see_stays_as_it_was_filled(context, seed):
    rng = np.random.default_rng(seed)
    filled, depth = opaque(rng, 40, 64, 0.0)
    here = Camera(64, 40, 50.0, 50.0, 32.0, 20.0, look_at(np.zeros(3), (1.0, 0, 0)))
    behind = Camera(64, 40, 50.0, 50.0, 32.0, 20.0, look_at(np.zeros(3), (-1.0, 0, 0)))
    for camera, other_depth in ((behind, depth), (here, np.zeros_like(depth)), (here, 1.2 * depth)):
        made, share = moved_by_gl(context, filled, depth, here, 255 - filled, other_depth, camera)
        assert np.array_equal(made, filled) and share == 0


def test_a_network_that_is_kept_brings_the_picture_of_its_own_camera_beside_later_pictures(context, seed):
    renderer, ended = Renderer(context, room(seed), device="cpu"), threading.Event()
    renderer._runs._wake = ended.set
    here, there = (from_fov(96, 64, 70.0, look_at((3.0, 2.5, 1.5), aim)) for aim in ((6.0, 3.0, 1.0), (0.0, 2.0, 1.0)))
    settings, beside = Settings(view="neural", quality="fast"), {"defer_network": True, "keep_network": True}
    target = context.texture((96, 64), 4)
    try:
        exact = renderer.render(here, settings).image("neural").astype(int)
        frame = renderer.render(here, settings, ("filled", "neural"), filled_depth=True, streaming=True, **beside)
        assert renderer.keeps_network and frame.facts.network is None, "the frame says nothing of what it does not show"
        later = renderer.render(there, settings, ("filled",), streaming=True, keep_network=True)
        plain = later.image("filled")
        assert ended.wait(60) and renderer.finish_earlier(target) and not renderer.keeps_network
        made = np.frombuffer(target.read(), np.uint8).reshape(64, 96, 4).astype(int)
        solid = exact[..., 3] == 255
        assert solid.mean() > 0.5 and np.abs(made - exact)[solid].max() <= 1
        assert np.array_equal(renderer.render(there, settings, ("filled",)).image("filled"), plain)
        renderer.render(here, settings, ("filled", "neural"), filled_depth=True, streaming=True, **beside)
        renderer.render(there, settings, ("filled",), streaming=True)
        assert not renderer.keeps_network and not renderer.finish_earlier(target), "a picture made without it drops the network"
    finally:
        target.release()
        renderer.release()


def test_a_network_adds_its_picture_to_the_frame_it_was_made_of_alone(context, seed):
    """Not to an earlier one that still waits."""
    renderer, ended = Renderer(context, room(seed), device="cpu"), threading.Event()
    renderer._runs._wake = ended.set
    cameras = [from_fov(96, 64, 70.0, look_at((3.0, 2.5, 1.5), aim)) for aim in ((6.0, 3.0, 1.0), (0.0, 2.0, 1.0))]
    settings = Settings(view="neural", quality="fast")
    try:
        exact = renderer.render(cameras[1], settings).image("neural")
        first, second = (renderer.render(camera, settings, streaming=True, defer_network=True) for camera in cameras)
        while renderer.network_busy:
            assert ended.wait(60)
            ended.clear()
        assert not renderer.finish_network(first) and first.facts.network_pending
        assert renderer.finish_network(second) and not second.facts.network_pending
        assert np.array_equal(second.image("neural"), exact)
    finally:
        renderer.release()


@pytest.mark.parametrize("network", [False, True])
def test_the_depth_of_the_filled_picture_is_that_which_the_network_is_given(context, seed, network):
    scene = replace(room(seed), noise=None)  # noise is averaged differently in the two
    camera = from_fov(120, 90, 70.0, look_at((3.0, 2.5, 1.5), (6.0, 3.0, 1.0)))
    renderer = Renderer(context, scene)
    try:
        frame = renderer.render(camera, Settings(view="filled"), ("filled", "neural") if network else ("filled",),
                                filled_depth=True)
        assert frame.filled_depth is not None
        depth = np.frombuffer(frame.filled_depth.read(alignment=1), np.float32).reshape(90, 120)
        alpha, plain = frame.image("filled")[..., 3], frame.image("filled")
        renderer.render(camera, Settings(view="neural"))
        packed = renderer._passes.neural.bridge.sent().copy()
        again = renderer.render(camera, Settings(view="filled"))
        assert np.array_equal(again.image("filled"), plain) and again.filled_depth is None
    finally:
        renderer.release()
    told = 2.0 ** (packed[..., 4].astype(float) / DEPTH_FEATURE_SCALE) * camera.fx * scene.spacing
    solid = alpha == 255
    assert solid.mean() > 0.5 and (depth[~solid] == 0).all()
    assert np.abs(depth[solid] / told[solid] - 1).max() < 5e-3  # a half float of the feature is 0.3 % of the depth


def test_a_gpu_is_not_waited_for_the_share_of_moved_pixels(context):
    """It is then that of an earlier picture, once the GPU has ended it."""
    rng, camera = np.random.default_rng(2), from_fov(64, 48, 60.0, np.eye(4))
    picture, depth = opaque(rng, 48, 64, 0.1)
    _, told = moved_by_gl(context, picture, depth, camera, picture, depth, camera, loops=False)
    programs, keyframe = Programs(context), Keyframe(context, (64, 48))
    step, textures = Reprojection(programs, (64, 48), loops=False), [texture(context, array) for array in (picture, depth)]
    step._waits = False
    try:
        keyframe.take_depth(camera, textures[1])
        keyframe.take_picture(picture)
        shares = []
        for _ in range(2):
            step.run(*textures, camera, keyframe)
            shares.append(step.share)
            context.finish()
        assert shares == [0.0, told] and told > 0.5
    finally:
        for owned in (programs, keyframe, step, *textures):
            owned.release()
