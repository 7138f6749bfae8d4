"""Background stays background: the network may take coverage away at an outline, but never add any, nor take any away inside a
closed room."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch
from clouds import room

from pointglass.model.network.reconstruct import Reconstructor
from pointglass.model.reference.hole_test import far_inside
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.network import neural
from pointglass.viewer.render.network.bridge import ReadBackBridge
from pointglass.viewer.render.network.neural_picture import NeuralPicture
from pointglass.viewer.render.network.present_loops import present_rows
from pointglass.viewer.render.renderer import Renderer


@pytest.fixture
def opening(monkeypatch):
    """A network that sees through everything by half, as far as it may."""
    network = Reconstructor("fast", filtered=True, device="cpu", precision="fp32")
    with torch.no_grad():
        network.network.head.weight[-4:] = 0
        network.network.head.bias[-4:] = -0.5
    monkeypatch.setattr(neural, "load_network", lambda *_: network)


def _pictures(context, scene, camera, *views):
    renderer = Renderer(context, scene, device="cpu")
    try:
        frame = renderer.render(camera, Settings(), views=views)
        return [frame.image(view).astype(int) for view in views]
    finally:
        renderer.release()


def _alpha(context, scene, camera):
    filled, made = _pictures(context, scene, camera, "filled", "neural")
    return filled[..., 3], made


def test_a_closed_room_cannot_be_opened(context, opening):
    scene = room(1, 120_000)
    camera = from_fov(160, 120, 60, look_at((3, 2.5, 1.5), (5.5, 4, 1.2)))
    filled, made = _alpha(context, scene, camera)
    assert (filled == 255).all() and (made[..., 3] == 255).all()


def test_what_the_tripod_hid_cannot_be_opened_though_there_is_no_roof(context, opening):
    """A court with a disc missing in its floor, the eye low over it; the sky above the walls is background."""
    rng = np.random.default_rng(4)
    points = rng.random((200_000, 3)) * (6, 5, 3)
    side = rng.integers(0, 5, len(points))
    points[np.arange(len(points)), side // 2] = np.array([6.0, 5.0, 3.0])[side // 2] * (side % 2)
    points = points[(points[:, 2] > 0) | (np.hypot(points[:, 0] - 3, points[:, 1] - 2.5) > 0.7)]
    scene = scene_from_arrays(points, np.full(points.shape, 150, np.uint8))
    filled, made = _alpha(context, scene, from_fov(160, 120, 70, look_at((2.6, 2.2, 1.5), (3.4, 2.9, 0.0))))
    assert (filled == 255).all() and (made[..., 3] == 255).all() and made[..., :3].min() > 100
    up = from_fov(160, 120, 70, look_at((2.6, 2.2, 1.5), (5.0, 3.9, 4.5)))
    filled, made = _alpha(context, scene, up)
    assert (filled == 0).any() and (made[filled == 0] == 0).all()


def test_outlines_in_a_void_may_be_opened_and_the_void_stays_empty(context, opening):
    rng = np.random.default_rng(3)
    ball = rng.normal(size=(80_000, 3))
    ball /= np.linalg.norm(ball, axis=1, keepdims=True)
    scene = scene_from_arrays(ball, np.full((80_000, 3), 180, np.uint8))
    camera = from_fov(320, 240, 50, look_at((4, 0, 0), (0, 0, 0)))
    kept, filled, made = _pictures(context, scene, camera, "filtered", "filled", "neural")
    filled, deep = filled[..., 3], far_inside(torch.from_numpy(kept[..., 3] > 0)).numpy()
    assert (filled == 0).any() and (filled == 255).any()
    assert (made[filled == 0] == 0).all()
    assert deep.any() and (made[deep][:, 3] == 255).all(), "nothing is seen through the middle"
    border = made[(filled == 255) & ~deep]
    assert len(border) and np.abs(border[:, 3] - 128).max() <= 1  # half of it, as the network says
    assert border[:, :3].max() <= 129  # premultiplied


@pytest.mark.parametrize("copied", [None, 1])
def test_what_is_shown_of_any_output_lies_in_range_and_is_premultiplied(context, seed, copied):
    """Numbers below 0 and above 1 are cut off before they are multiplied: no colour is brighter than its alpha."""
    rng = np.random.default_rng(seed)
    made = rng.uniform(-0.5, 1.7, (37, 53, 4)).astype(np.float16)
    alpha = rng.choice([0, 255], (37, 53)).astype(np.uint8)
    programs, filled = Programs(context), context.texture((53, 37), 4, np.repeat(alpha[..., None], 4, -1).tobytes())
    bridge = ReadBackBridge(context, (53, 37))
    bridge.output.write(made)
    shown_bridge = bridge if copied else SimpleNamespace(output=bridge.output)
    stage = NeuralPicture(programs, (53, 37), copied=copied is not None)
    try:
        stage.show(shown_bridge, filled, None, None)
        shown = np.frombuffer(stage.texture.read(), np.uint8).reshape(made.shape)
        by_loops = np.empty(alpha.size, np.uint32)
        present_rows(made.reshape(-1).view(np.uint16), np.frombuffer(filled.read(), np.uint32), 53, by_loops, 0, 37)
        assert np.abs(by_loops.view(np.uint8).reshape(made.shape).astype(int) - shown).max() <= 1
    finally:
        for resource in (filled, bridge, stage, programs):
            resource.release()
    wanted = made.astype(np.float64).clip(0, 1)
    wanted[..., 3] *= alpha / 255
    wanted[..., :3] *= wanted[..., 3:]
    assert np.abs(shown - 255 * wanted).max() < 0.51 and (shown[..., :3] <= shown[..., 3:]).all()


def test_without_an_opinion_the_networks_alpha_is_the_filled_pictures(context, monkeypatch):
    network = Reconstructor("fast", filtered=True, device="cpu", precision="fp32")
    with torch.no_grad():
        network.network.head.weight[-4:] = 0
        network.network.head.bias[-4:] = 0
    monkeypatch.setattr(neural, "load_network", lambda *_: network)
    scene = room(2, 3_000)
    camera = from_fov(120, 90, 70, look_at((9, 8, 4), (3, 2.5, 1.5)))
    filled, made = _alpha(context, scene, camera)
    assert np.array_equal(filled, made[..., 3])
