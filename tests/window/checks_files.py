"""Checks of what the window writes and reads: captures, help, bad files and weights, loads cancelled and replaced."""

import csv
import itertools
from dataclasses import replace

import numpy as np
from driver import SIZE, Driver


def check_screenshot_is_the_picture(d: Driver) -> None:
    from PIL import Image

    from pointglass.viewer.picture.background import composite

    d.rest()
    before = set(d.folder.glob("*.png"))
    d.key("F12")
    (path,) = set(d.folder.glob("*.png")) - before
    assert any(str(path) in toast.text for toast in d.session.notices.toasts)
    image, session = np.asarray(Image.open(path)), d.session
    assert image.shape[:2] == session.area.size[::-1]
    frame = d.app.viewport.renderer.render(session.camera, session.view_settings.settings)
    assert np.array_equal(image, composite(frame.image(session.view_settings.settings.view)))
    session.picture.dirty = True
    np.savez(
        d.folder / "shot.npz", image=image, matrix=session.camera.camera_to_world, view=session.view_settings.settings.view
    )  # drawn again through EGL when the window is gone
    path.unlink()


def check_recording_writes_a_row_a_frame(d: Driver) -> None:
    d.rest()
    d.key("F9")
    assert d.session.recording is not None
    for view in ("1", "2", "3"):
        d.key(view)
        d.rest()
    d.key("F9")
    assert d.session.recording is None
    (path,) = d.folder.glob("pointglass-frames-*.csv")
    rows = list(csv.DictReader(path.open()))
    views = [views for views, _ in itertools.groupby(row["views"] for row in rows)]  # one is made again where points arrive
    assert views[-3:] == ["raw", "filtered", "filled"], views
    assert d.session.notices.saved[-2:] == [path.with_suffix(".png"), path]
    assert float(rows[-1]["fill_ms"]) > 0 and rows[0]["fill_ms"] == "" and int(rows[0]["points_drawn"]) > 0
    assert not list(d.folder.glob(".*partial"))


def check_help_lists_every_control(d: Driver) -> None:
    before = d.canvas()
    d.key("F1")
    assert d.session.help and not np.array_equal(before, d.canvas())
    d.key("ESCAPE")
    assert not d.session.help and not d.app.closing
    from pointglass.viewer.window.interaction.controls import ALL

    assert {control.action for control in ALL if control.kind in ("press", "chord")} <= set(d.app.actions.table)


def check_interface_hides(d: Driver) -> None:
    d.session.notices.toasts = []
    shown = d.canvas()
    d.key("F10")
    d.rest()
    assert [toast.text for toast in d.session.notices.toasts] == ["Interface hidden; F10 or Esc shows it"]
    said = d.canvas()
    d.session.notices.toasts = []
    hidden = d.canvas()
    assert not np.array_equal(said, hidden), "a toast is seen with the interface hidden, too"
    assert not np.array_equal(shown, hidden) and np.array_equal(hidden, d.rendered())
    d.key("F10")
    assert d.session.interface and not d.session.notices.toasts


def check_bad_file_gives_a_dialog_and_the_scene_stays(d: Driver) -> None:
    bad = d.folder / "broken.ply"
    bad.write_bytes(b"ply\nformat ascii 1.0\nelement vertex many\nend_header\n")
    scene, picture = d.session.scene, d.bare()
    d.drop(bad)
    d.until(lambda: d.session.loads.current is None)
    assert d.session.notices.message is not None and "broken.ply" in d.session.notices.message.text
    assert "\n" not in d.session.notices.message.text and d.session.scene is scene
    assert not np.array_equal(picture, d.canvas())
    d.key("ESCAPE")
    assert d.session.notices.message is None and np.array_equal(picture, d.bare())
    d.drop(d.folder / "missing.laz")
    d.until(lambda: d.session.notices.message is not None)
    d.key("ENTER")
    assert d.session.notices.message is None and d.session.scene is scene


def check_missing_weights_give_a_dialog_and_the_setting_reverts(d: Driver) -> None:
    from pointglass.viewer.common.errors import InputError

    def none(settings):
        raise InputError("no weights are shipped for quality 'paper'")

    d.session.view_settings.load_network, original = none, d.session.view_settings.load_network
    d.session.view_settings.request(replace(d.session.view_settings.settings, quality="paper"))
    d.until(lambda: d.session.view_settings.network_load is None)
    d.session.view_settings.load_network = original
    assert "no weights" in d.session.notices.message.text
    chosen = d.session.view_settings
    assert chosen.shown_settings.quality == "balanced" and chosen.settings.quality == "balanced"
    d.key("ESCAPE")


def check_load_can_be_cancelled(d: Driver) -> None:
    scene = d.session.scene
    for cancel in (lambda: d.key("ESCAPE"), d.session.cancel_load):
        d.drop(d.folder / "slow.ply")
        d.until(lambda: d.session.loads.current.done > 3)
        assert d.session.loads.current.label == "Reading slow.ply"
        work = d.session.loads.current
        cancel()
        assert d.session.loads.current is None and work.join(5.0)
        d.settle()
        assert d.session.scene is scene and d.session.notices.message is None


def check_a_load_is_seen_where_the_figures_leave_no_room_beside_it(d: Driver) -> None:
    from imgui_bundle import imgui

    d.resize(500, 400)
    d.session.profiler = True
    d.bare()
    d.drop(d.folder / "slow.ply")
    d.until(lambda: d.session.loads.current.done > 3)
    d.settle()
    order = [window.name for window in imgui.get_current_context().windows if window.active]
    assert order.index("load") > order.index("profiler"), order
    d.session.cancel_load()
    d.session.profiler = False
    d.resize(*SIZE)


def check_second_drop_replaces_the_scene(d: Driver) -> None:
    picture = d.bare()
    d.drop(d.folder / "slow.ply")
    d.settle()
    d.drop(d.folder / "room2", d.folder / "room3")
    d.until(lambda: d.session.loads.current is None)
    assert d.session.scene.meta.sources == ("room2",)
    assert not np.array_equal(picture, d.bare()) and np.array_equal(d.bare(), d.rendered())


def check_failed_picture_falls_back(d: Driver) -> None:
    from pointglass.viewer.common.errors import DeviceError

    original, before = d.app.viewport.renderer.render, d.session.view_settings.settings

    def render(camera, settings, views=None, history=None, **how):
        if settings.soft_z == "paper-code":
            raise DeviceError("a shader does not compile")
        return original(camera, settings, views, history, **how)

    d.app.viewport.renderer.render = render
    d.session.view_settings.request(replace(before, soft_z="paper-code"))
    d.settle()
    d.app.viewport.renderer.render = original
    assert "does not compile" in d.session.notices.message.text and d.session.view_settings.settings == before
    d.key("ESCAPE")
    assert np.array_equal(d.bare(), d.rendered())
