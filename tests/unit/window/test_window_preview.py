"""The window's preview of a scan: shown first, followed by the complete scan, or kept where loading is cancelled."""

import threading
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from window_session import FEW, room, session, until_idle

from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.progress import progress
from pointglass.viewer.window.flight.navigation import view_along
from pointglass.viewer.window.flight.start_viewpoint import start_state, survey
from pointglass.viewer.window.interaction.tool import ToolContext
from pointglass.viewer.window.interaction.walk_mode import WalkMode
from pointglass.viewer.window.kit.notices import LoadAllPoints
from pointglass.viewer.window.panels.status_bar import _columns
from pointglass.viewer.window.session.loading import Loaded
from pointglass.viewer.window.session.scan_notice_actions import current_notices


def test_a_preview_is_shown_first_and_the_complete_scan_follows_without_moving_the_camera():
    gate, shown = threading.Event(), room(points=500)

    def opened(paths, **_):
        assert gate.wait(20)
        return room()

    made, _ = session()
    made.loads.open_scene, made.loads.preview_scene = opened, lambda paths, **_: shown
    made.open([Path("a.laz")])
    work, loaded = made.loads.current, None
    while loaded is None:
        loaded = made.poll()
    made.accept(loaded)
    assert made.scene is shown and made.shown_scan.preview and made.loads.current is work
    assert _columns(made, None)[3].text == "preview" and "being read" in _columns(made, None)[3].explained
    made.flight.state = replace(made.flight.state, position=made.flight.state.position + 0.3)
    camera = made.camera
    gate.set()
    assert work is not None and work.join(20)
    loaded = made.poll()
    assert loaded is not None
    made.accept(loaded)
    assert not made.shown_scan.preview and made.scene is not shown and made.scene is not None and made.scene.count == 40_000
    assert np.array_equal(made.camera.camera_to_world, camera.camera_to_world)


@pytest.mark.timeout(300)
def test_walking_that_is_asked_for_in_a_preview_begins_when_there_is_a_floor():
    gate, shown = threading.Event(), room(points=500)

    def opened(paths, **_):
        assert gate.wait(120)
        return room()

    made, _ = session()
    context = ToolContext(made, SimpleNamespace(frame=None), SimpleNamespace(scale=1.0))  # type: ignore[arg-type]
    walk = WalkMode()
    made.loads.open_scene, made.loads.preview_scene = opened, lambda paths, **_: shown
    made.open([Path("a.laz")])
    while made.scene is not shown:
        if (loaded := made.poll()) is not None:
            made.accept(loaded)
    walk.toggle(context)
    until_idle(made, lambda: walk.follow(context), lambda: walk._build is not None, loads=False)
    assert walk.on and made.flight.walker is None and "Flying" not in [toast.text for toast in made.notices.toasts]
    gate.set()
    until_idle(made, lambda: walk.follow(context), lambda: walk.on and made.flight.walker is None)
    assert walk.on and made.flight.walker is not None and not made.shown_scan.preview
    scene = room(points=FEW)
    made.work.accept()
    made.accept(Loaded(scene, survey(scene)))  # of other work
    walk.follow(context)
    walk.follow(context)
    assert not walk.on and made.flight.walker is None


def test_a_scan_at_an_address_becomes_finer_in_place_until_all_of_it_is_there():
    gate, scenes = threading.Event(), [room(points=count) for count in (500, 2000)]

    def opened(paths, **_):
        assert gate.wait(20)
        return room()

    made, _ = session()
    made.loads.open_scene = opened
    made.loads.preview_scene = lambda paths, detail, **_: scenes[detail] if detail < len(scenes) else None
    made.open([Path("https://archive.example/a.copc.laz")])
    work = made.loads.current
    for scene in scenes:
        while (loaded := made.poll()) is None:
            pass
        made.accept(loaded)
        made.loads.preview_shown()
        assert made.scene is scene and made.shown_scan.preview and made.loads.current is work
        if scene is scenes[0]:
            made.flight.state = replace(made.flight.state, position=made.flight.state.position + 0.3)
            camera = made.camera
        assert np.array_equal(made.camera.camera_to_world, camera.camera_to_world), "the camera stays"
    gate.set()
    assert work is not None and work.join(20)
    made.accept(made.poll())
    assert not made.shown_scan.preview and made.scene.count == 40_000
    assert np.array_equal(made.camera.camera_to_world, camera.camera_to_world)


@pytest.mark.parametrize("done", ["nothing", "moved", "clicked", "set off"])
def test_who_has_not_moved_or_clicked_flies_from_a_poor_viewpoint_of_the_preview_to_a_good_one(done):
    made, clock = session()
    assert made.scene is not None
    complete = room()
    good = start_state(complete, survey(complete), 1.6)
    poor = view_along(np.array([7.4, 3.0, 1.6]), np.array([1.0, 0.0, 0.0]), 1.0, np.eye(3))  # close to a wall, facing it
    made.accept(Loaded(room(points=500), survey(complete), (Path("a.laz"),), preview=True))
    made.flight.begin(poor, survey(complete))
    if done == "moved":
        made.flight.state = replace(poor, position=poor.position - 0.2)
    made.shown_scan.touched = done == "clicked"
    if done == "set off":
        made.flight.glide_to(replace(poor, position=poor.position - 0.2))
    camera = made.camera
    made.accept(Loaded(complete, survey(complete), (Path("a.laz"),), follows_preview=True))
    for _ in range(40):
        clock.now += 0.1
        made.advance()
    if done == "set off":
        assert np.allclose(made.camera.position, poor.position - 0.2)
    elif done != "nothing":
        assert np.array_equal(made.camera.camera_to_world, camera.camera_to_world)
    else:
        assert np.allclose(made.camera.position, good.position, atol=1e-6) and made.flight.at_home


def test_a_preview_whose_load_is_cancelled_stays_and_offers_the_rest():
    def endless(paths, **_):
        with progress(0, "Reading") as meter:
            while True:
                meter.update(1)

    made, _ = session()
    made.loads.open_scene, made.loads.preview_scene = endless, lambda paths, **_: room(points=500)
    made.open([Path("a.laz")])
    work, loaded = made.loads.current, None
    while loaded is None:
        loaded = made.poll()
    made.accept(loaded)
    made.escape()
    assert _columns(made, None)[3].text == "preview" and "were not read" in _columns(made, None)[3].explained
    assert made.shown_scan.preview and made.scene is loaded.scene and work is not None and work.join(10)
    assert [notice.offer for notice in current_notices(made)] == [LoadAllPoints()]


def test_a_preview_whose_load_fails_stays_and_offers_the_rest():
    silent = threading.Event()

    def failing(paths, **_):
        silent.wait(60)
        raise InputError("no answer for 20 s", file="a.laz")

    made, _ = session()
    made.loads.open_scene, made.loads.preview_scene = failing, lambda paths, **_: room(points=500)
    made.open([Path("a.laz")])
    loaded = None
    while loaded is None:
        loaded = made.poll()
    made.accept(loaded)
    assert current_notices(made) == []
    silent.set()
    while made.loads.current is not None:
        assert made.poll() is None
    assert made.notices.message is not None and "no answer for 20 s" in made.notices.message.text
    assert [notice.offer for notice in current_notices(made)] == [LoadAllPoints()]
