"""A window does not wait for photographs: its first picture is without them, they fade in over the next ones, and then it has
the same bytes as one that waited."""

import itertools
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.camera import from_fov
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.readers.photographs.posed_photograph import PosedPhotograph
from pointglass.viewer.render.renderer import Renderer


@pytest.fixture
def wall(seed):
    """A textured wall of few points, its photograph from the front, and a camera beside it."""
    rng = np.random.default_rng(seed)
    noise = rng.integers(40, 216, (24, 32, 3)).astype(np.float32)
    texture = noise.repeat(10, 0).repeat(10, 1).astype(np.uint8)  # 320 x 240 over 4 x 3 units at z = -2
    xy = rng.uniform((-2, -1.5), (2, 1.5), (9000, 2))
    rgb = texture[np.clip((1.5 - xy[:, 1]) * 80, 0, 239).astype(int), np.clip((xy[:, 0] + 2) * 80, 0, 319).astype(int)]
    scene = scene_from_arrays(np.c_[xy, np.full(len(xy), -2.0)], rgb, noise=False)
    lens = 160.0, 160.0, 160.0, 120.0
    photo = PosedPhotograph("wall", "pinhole", 320, 240, lens, False, np.eye(4), lambda _: (texture, None))
    pose = np.eye(4)
    pose[0, 3] = 0.3
    return scene, photo, from_fov(160, 120, 60.0, pose)


def test_photographs_come_later_and_make_the_same_picture(context, wall):
    scene, photo, camera = wall
    woken = []
    made = []
    for streaming in (True, False):
        renderer = Renderer(context, scene, wake=lambda: woken.append(1))
        renderer.photographs.give("wall", [photo])
        settings = Settings(view="filled", photos="wall")
        frame = renderer.render(camera, settings, streaming=streaming)
        if streaming:
            plain = renderer.render(camera, Settings(view="filled", photos="off")).image("filled").copy()
            end = time.monotonic() + 60
            assert np.array_equal(frame.image("filled"), plain), "the points are sampled on a thread"
            library = renderer.photographs.library("wall")
            while not library._coming and time.monotonic() < end:
                renderer.render(camera, settings, streaming=True)
            while not library._coming[0].done() and time.monotonic() < end:
                time.sleep(0.01)
            steps = [plain.astype(int)]
            while len(steps) < 2 or (renderer.photographs.arrived and len(steps) < 20):
                frame = renderer.render(camera, settings, streaming=True)
                steps.append(frame.image("filled").astype(int))
            changes = [np.abs(after - before).mean() for before, after in itertools.pairwise(steps)]
            assert len(changes) > 3 and max(changes) < 0.4 * np.abs(steps[-1] - steps[0]).mean() > 0
        share = frame.from_photographs("filled")
        assert share is not None and share.mean() > 0.5 and frame.facts.photographs == 1
        made.append(frame.image("filled").copy())
        renderer.release()
    assert woken and np.array_equal(made[0], made[1]) and not np.array_equal(made[0], plain)


def test_what_nobody_foresaw_costs_a_window_the_photograph_and_a_still_picture_everything(context, wall, monkeypatch, caplog):
    scene, photo, camera = wall
    broken = "pointglass.viewer.render.photographs.photo_library.fitted"
    monkeypatch.setattr(broken, lambda *_: (_ for _ in ()).throw(AttributeError("torch has no Tensor")))
    renderer = Renderer(context, scene, device="cpu")
    renderer.photographs.give("wall", [photo])
    settings = Settings(view="filled", photos="wall")
    try:
        with pytest.raises(AttributeError, match="no Tensor"):
            renderer.render(camera, settings)
        end = time.monotonic() + 60
        while "left out of pictures" not in caplog.text and time.monotonic() < end:
            frame = renderer.render(camera, settings, streaming=True)
        assert "wall could not be prepared" in caplog.text and "no Tensor" in caplog.text
        frame = renderer.render(camera, settings)  # and does not try again
        plain = renderer.render(camera, replace(settings, photos="off"))
        assert not frame.facts.photographs and np.array_equal(frame.image("filled"), plain.image("filled"))
    finally:
        renderer.release()


def test_shaders_and_loops_make_one_picture(context, wall):
    scene, photo, camera = wall
    made = []
    for shaders in (False, True):
        renderer = Renderer(context, scene, device="cpu")
        renderer.photographs.give("wall", [photo])
        renderer.photographs.shaders = shaders
        frame = renderer.render(camera, Settings(view="neural", quality="fast", photos="wall"), ("filled", "neural"))
        made.append([frame.image(view).astype(int) for view in ("filled", "neural")] + [frame.from_photographs("neural")])
        renderer.release()
    assert made[1][2].mean() > 0.5 and np.mean(made[0][2] != made[1][2]) < 0.004
    for loops, shaders in zip(made[0][:2], made[1][:2], strict=True):
        assert np.mean(np.abs(loops - shaders).max(-1) > 1) < 0.004


def test_a_network_that_goes_on_in_flight_keeps_the_photographs_of_its_own_picture(context, wall):
    scene, photo, here = wall
    pose = np.eye(4)
    pose[:2, 3] = -0.5, 0.2
    there, ended = from_fov(160, 120, 60.0, pose), threading.Event()
    renderer = Renderer(context, scene, device="cpu")
    renderer.photographs.give("wall", [photo])
    renderer._runs._wake = ended.set
    settings, target = Settings(view="neural", quality="fast", photos="wall"), context.texture((160, 120), 4)
    try:
        frame = renderer.render(here, settings)
        exact, part = frame.image("neural").astype(int), frame.from_photographs("neural")
        alone = renderer.render(here, replace(settings, photos="off")).image("neural").astype(int)
        assert part is not None and part.mean() > 0.5 and np.abs(exact - alone)[part].mean() > 5
        renderer.render(here, settings, ("filled", "neural"), filled_depth=True, streaming=True, defer_network=True,
                        keep_network=True)
        renderer.render(there, settings, ("filled",), streaming=True, keep_network=True)
        assert ended.wait(60) and renderer.finish_earlier(target)
        made = np.frombuffer(target.read(), np.uint8).reshape(120, 160, 4).astype(int)
        assert np.abs(made - exact)[exact[..., 3] == 255].max() <= 1
    finally:
        target.release()
        renderer.release()
