"""Drives the window for ``test_window.py``, in a process of its own under Xvfb, and reports what each check found.

Events enter where GLFW's callbacks deliver them; one real key press comes from xdotool.  Run as
``python drive.py FOLDER``: pictures and ``report.json`` are left there.
"""

import csv
import json
import shutil
import subprocess
import sys
import threading
import time
import traceback
from dataclasses import replace
from pathlib import Path

import numpy as np

SIZE = (640, 400)


def room(points: int = 50_000, seed: int = 5):
    """A box room of 8 x 6 x 3 m with a coloured checker on its walls, as a Scene."""
    from viewer.cloud import scene_from_arrays

    rng = np.random.default_rng(seed)
    size = np.array([8.0, 6.0, 3.0])
    xyz = rng.random((points, 3)) * size
    wall = rng.integers(0, 6, points)
    xyz[np.arange(points), wall % 3] = np.where(wall < 3, 0.0, size[wall % 3])
    checker = (np.floor(xyz * 2).sum(axis=1).astype(int) % 2)[:, None]
    rgb = np.clip(60 + 28 * wall[:, None] + np.array([70, 20, 50]) * checker, 0, 255).astype(np.uint8)
    return scene_from_arrays(xyz, rgb, meta={"metres_per_unit": 1.0, "sources": [f"room{seed}"]})


class Driver:
    """An App and a hand."""

    def __init__(self, folder: Path):
        import glfw

        from viewer.settings import Settings
        from viewer.window.app import App

        self.folder = folder
        self.app = App(Settings(view="filled"), size=SIZE, folder=folder, scale=1.0)
        self.glfw = glfw
        self.session = self.app.session
        self.release = threading.Event()
        self.session.loads.open_scene = self._open
        self.session.panel = False  # at this size it would cover half of the picture

    def _open(self, paths):
        from viewer.cloud import open_scene
        from viewer.progress import progress

        name = paths[0].name
        if name == "slow.ply":  # a load that lasts until it is cancelled
            with progress(0, "Reading slow.ply") as meter:
                while True:
                    meter.update(1)
                    time.sleep(0.005)
        return room(seed=int(name[4:])) if name.startswith("room") else open_scene(paths, cache=False)

    def settle(self, steps: int = 4) -> None:
        for _ in range(steps):
            self.app.step(wait=False)

    def until(self, condition, seconds: float = 20.0) -> None:
        end = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < end, "waited too long"
            self.app.step(wait=False)
        self.settle()

    def key(self, name: str, action: str = "tap") -> None:
        key = getattr(self.glfw, f"KEY_{name}")
        code = self.glfw.get_key_scancode(key)
        if action in ("tap", "down"):
            self.app.hands.on_key(self.app.window, key, code, self.glfw.PRESS, 0)
        if action in ("tap", "up"):
            self.app.hands.on_key(self.app.window, key, code, self.glfw.RELEASE, 0)
        if action == "tap":
            self.settle()

    def point(self, x: float, y: float) -> None:
        self.app.hands.on_enter(self.app.window, 1)
        self.app.hands.on_pointer(self.app.window, float(x), float(y))
        self.settle(2)

    def button(self, action: int, button: int | None = None) -> None:
        self.app.hands.on_button(self.app.window, self.glfw.MOUSE_BUTTON_LEFT if button is None else button, action, 0)
        self.settle(2)

    def drop(self, *paths: Path) -> None:
        self.app.hands.on_drop(self.app.window, [str(path) for path in paths])

    def canvas(self) -> np.ndarray:
        self.settle()
        return self.app.painter.canvas.read()

    def bare(self) -> np.ndarray:
        """The picture alone, at rest: the interface hidden."""
        self.until(lambda: not (self.session.flight.moving or self.session.needs_picture))
        shown, self.session.interface = self.session.interface, False
        try:
            return self.canvas()
        finally:
            self.session.interface = shown

    def rendered(self) -> np.ndarray:
        from viewer.window.present import composite

        session = self.session
        frame = self.app.painter.renderer.render(session.camera, session.choice.settings)
        image = composite(frame.image(session.choice.settings.view))
        session.picture.dirty = True
        return image


def check_empty_start_page_invites(d: Driver) -> None:
    image = d.canvas()
    assert image.shape == (SIZE[1], SIZE[0], 3)
    assert image.std() > 0, "the start page is blank"


def check_dropped_scan_opens(d: Driver) -> None:
    d.drop(d.folder / "room1")
    d.until(lambda: d.session.loads.current is None)
    assert d.session.scene is not None and d.session.notices.message is None
    assert d.session.scene.count == 50_000
    assert d.bare().std() > 5


def check_window_shows_what_render_makes(d: Driver) -> None:
    for view in ("raw", "filtered", "filled"):
        d.session.choice.show(view)
        assert np.array_equal(d.bare(), d.rendered()), view


def check_digits_choose_views(d: Driver) -> None:
    seen = []
    for key, view in (("1", "raw"), ("2", "filtered"), ("3", "filled")):
        d.key(key)
        assert d.session.choice.settings.view == view
        seen.append(d.bare())
    assert not np.array_equal(seen[0], seen[2]) and (seen[0] == seen[1]).mean() < 1.0


def check_held_keys_fly(d: Driver) -> None:
    for key, axis in (("W", 2), ("S", 2), ("A", 0), ("D", 0), ("E", None), ("Q", None)):
        d.key("HOME")
        camera, before = d.session.camera, d.bare()
        d.key(key, "down")
        d.until(lambda start=camera: np.linalg.norm(d.session.camera.position - start.position) > 0.05)
        d.key(key, "up")
        moved = d.session.camera.position - camera.position
        along = moved[2] if axis is None else camera.camera_to_world[:3, axis] @ moved
        sign = {"W": -1, "S": 1, "A": -1, "D": 1, "E": 1, "Q": -1}[key]
        assert along * sign > 0.9 * np.linalg.norm(moved), key
        assert not np.array_equal(before, d.bare()), key
        d.until(lambda: not d.session.flight.state.moving)


def check_modifiers_change_the_pace(d: Driver) -> None:
    speeds = {}
    for modifier in ("LEFT_ALT", None, "LEFT_SHIFT"):
        d.key("HOME")
        if modifier:
            d.key(modifier, "down")
        d.key("W", "down")
        start = time.monotonic()
        d.until(lambda start=start: time.monotonic() - start > 0.8)
        speeds[modifier] = np.linalg.norm(d.session.flight.state.velocity)
        d.key("W", "up")
        if modifier:
            d.key(modifier, "up")
        d.until(lambda: not d.session.flight.state.moving)
    d.key("HOME")
    assert speeds["LEFT_ALT"] * 3 < speeds[None] < speeds["LEFT_SHIFT"] / 3, speeds


def check_still_camera_draws_nothing(d: Driver) -> None:
    d.settle(8)
    made = []
    original = d.app.painter.renderer.render
    d.app.painter.renderer.render = lambda *a, **k: made.append(1) or original(*a, **k)
    d.settle(10)
    d.app.painter.renderer.render = original
    assert not made
    d.session.notices.toasts = []
    d.settle(8)
    start, spent = time.monotonic(), time.process_time()
    while time.monotonic() - start < 1.5:
        d.app.step()
    assert time.process_time() - spent < 0.3, "an idle window uses the processor"


def check_wheel_changes_speed_and_shows_it(d: Driver) -> None:
    d.point(320, 350)
    before = d.session.flight.state.speed
    d.app.hands.on_scroll(d.app.window, 0.0, 2.0)
    d.settle()
    assert d.session.flight.state.speed > 1.4 * before
    assert any(toast.text.startswith("Speed") for toast in d.session.notices.toasts)
    d.app.hands.on_scroll(d.app.window, 0.0, -2.0)


def check_dragging_looks_around(d: Driver) -> None:
    for button in (d.glfw.MOUSE_BUTTON_LEFT, d.glfw.MOUSE_BUTTON_RIGHT):
        d.key("HOME")
        d.point(320, 350)
        before, direction = d.bare(), d.session.camera.forward
        d.button(d.glfw.PRESS, button)
        x, y = d.app.hands.pointer
        d.app.hands.on_pointer(d.app.window, x + 60, y + 5)
        d.settle(2)
        d.button(d.glfw.RELEASE, button)
        right = np.cross(direction, [0, 0, 1])
        assert d.session.camera.forward @ right > 0.1, "dragging right looks right"
        assert not np.array_equal(before, d.bare())
    d.key("HOME")


def check_home_and_frame(d: Driver) -> None:
    home = d.session.camera
    d.key("F")
    framed = d.session.camera
    assert np.allclose(framed.forward, home.forward)
    corners = d.session.scene.bounds
    middle = corners.mean(axis=0)
    seen = framed.world_to_camera @ [*middle, 1.0]
    assert -seen[2] > np.linalg.norm(corners[1] - corners[0]) / 4, "the scene lies in front"
    d.key("HOME")
    assert np.array_equal(d.session.camera.camera_to_world, home.camera_to_world)


def check_split_compares_and_its_handle_drags(d: Driver) -> None:
    d.key("3")
    filled = d.bare()
    d.key("1")
    raw = d.bare()
    d.key("3")
    d.key("V")
    assert d.session.choice.split and d.session.choice.sides == ("raw", "filled")
    half = d.bare()
    assert np.array_equal(half[:, :320], raw[:, :320]) and np.array_equal(half[:, 320:], filled[:, 320:])
    d.point(320, 300)
    assert d.app.hands.over_handle
    d.button(d.glfw.PRESS)
    assert d.session.dragging_handle and not d.session.flight.looking
    d.point(200, 300)
    d.button(d.glfw.RELEASE)
    moved = d.bare()
    assert np.array_equal(moved[:, :200], raw[:, :200]) and np.array_equal(moved[:, 200:], filled[:, 200:])
    d.key("V")
    assert np.array_equal(d.bare(), filled)


def check_screenshot_is_the_picture(d: Driver) -> None:
    from PIL import Image

    before = set(d.folder.glob("*.png"))
    d.key("F12")
    (path,) = set(d.folder.glob("*.png")) - before
    assert any(str(path) in toast.text for toast in d.session.notices.toasts)
    image = np.asarray(Image.open(path))
    assert np.array_equal(image, d.rendered())
    session = d.session
    np.savez(
        d.folder / "shot.npz", image=image, matrix=session.camera.camera_to_world, view=session.choice.settings.view
    )  # drawn again through EGL when the window is gone
    path.unlink()


def check_recording_writes_a_row_a_frame(d: Driver) -> None:
    d.settle()
    d.key("F9")
    assert d.session.recording is not None
    for view in ("1", "2", "3"):
        d.key(view)
    d.key("F9")
    assert d.session.recording is None
    (path,) = d.folder.glob("pointglass-frames-*.csv")
    rows = list(csv.DictReader(path.open()))
    assert [row["views"] for row in rows] == ["raw", "filtered", "filled"]
    assert float(rows[-1]["fill_ms"]) > 0 and rows[0]["fill_ms"] == "" and int(rows[0]["points_drawn"]) > 0
    assert not list(d.folder.glob(".*partial"))


def check_help_lists_every_control(d: Driver) -> None:
    before = d.canvas()
    d.key("F1")
    assert d.session.help and not np.array_equal(before, d.canvas())
    d.key("ESCAPE")
    assert not d.session.help and not d.app.closing
    from viewer.window.controls import ALL

    assert {control.action for control in ALL if control.kind == "press"} == set(d.app._actions)


def check_interface_hides(d: Driver) -> None:
    d.session.notices.toasts = []
    shown = d.canvas()
    d.key("F10")
    hidden = d.canvas()
    assert not np.array_equal(shown, hidden) and np.array_equal(hidden, d.rendered())
    d.key("F10")
    d.session.notices.toasts = []
    assert d.session.interface


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
    from viewer.errors import InputError

    def none(settings):
        raise InputError("no weights are shipped for quality 'paper'")

    d.session.choice.load_network, original = none, d.session.choice.load_network
    d.session.choice.request(replace(d.session.choice.settings, quality="paper"))
    d.until(lambda: d.session.choice.network_load is None)
    d.session.choice.load_network = original
    assert "no weights" in d.session.notices.message.text
    assert d.session.choice.shown_settings.quality == "balanced" and d.session.choice.settings.quality == "balanced"
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


def check_second_drop_replaces_the_scene(d: Driver) -> None:
    picture = d.bare()
    d.drop(d.folder / "slow.ply")
    d.settle()
    d.drop(d.folder / "room2", d.folder / "room3")
    d.until(lambda: d.session.loads.current is None)
    assert d.session.scene.meta["sources"] == ["room2"]
    assert not np.array_equal(picture, d.bare()) and np.array_equal(d.bare(), d.rendered())


def check_failed_picture_falls_back(d: Driver) -> None:
    from viewer.errors import DeviceError

    original, before = d.app.painter.renderer.render, d.session.choice.settings

    def render(camera, settings, views=None, history=None, **how):
        if settings.soft_z == "paper-code":
            raise DeviceError("a shader does not compile")
        return original(camera, settings, views, history, **how)

    d.app.painter.renderer.render = render
    d.session.choice.request(replace(before, soft_z="paper-code"))
    d.settle()
    d.app.painter.renderer.render = original
    assert "does not compile" in d.session.notices.message.text and d.session.choice.settings == before
    d.key("ESCAPE")
    assert np.array_equal(d.bare(), d.rendered())


def check_resizing_and_minimising(d: Driver) -> None:
    for size in ((517, 383), (333, 211)):
        d.glfw.set_window_size(d.app.window, *size)
        d.until(lambda size=size: d.session.size == size)
        assert d.bare().shape == (size[1], size[0], 3) and np.array_equal(d.bare(), d.rendered())
    d.app.hands.on_resize(d.app.window, 0, 0)
    d.settle()
    d.key("F12")
    d.app.hands.on_resize(d.app.window, 333, 211)
    d.glfw.set_window_size(d.app.window, *SIZE)
    d.until(lambda: d.session.size == SIZE)
    assert np.array_equal(d.bare(), d.rendered())


def check_real_key_press(d: Driver) -> None:
    assert shutil.which("xdotool"), "xdotool is missing: apt install xdotool"
    name = d.glfw.get_x11_window(d.app.window)
    subprocess.run(["xdotool", "windowfocus", "--sync", str(name)], check=True, timeout=10)
    d.settle()
    assert not d.session.help
    subprocess.run(["xdotool", "key", "F1"], check=True, timeout=10)
    d.until(lambda: d.session.help, 5.0)
    subprocess.run(["xdotool", "key", "Escape"], check=True, timeout=10)
    d.until(lambda: not d.session.help, 5.0)
    start = d.session.camera.position.copy()
    subprocess.run(["xdotool", "keydown", "w"], check=True, timeout=10)
    try:
        d.until(lambda: np.linalg.norm(d.session.camera.position - start) > 0.05, 5.0)
    finally:
        subprocess.run(["xdotool", "keyup", "w"], check=True, timeout=10)
    d.until(lambda: not d.session.flight.state.moving, 5.0)


def check_panel_folds_and_its_buttons_work(d: Driver) -> None:
    def click(x, y):
        d.point(x, y)
        d.button(d.glfw.PRESS)
        d.button(d.glfw.RELEASE)
        d.settle()

    d.key("3")
    camera = d.session.camera
    click(590, 28)
    assert d.session.panel
    before = d.canvas()
    click(363, 64)  # the first of the four views
    assert d.session.choice.settings.view == "raw" and not np.array_equal(before, d.canvas())
    assert np.array_equal(camera.camera_to_world, d.session.camera.camera_to_world), "a click on the panel looks around"
    d.session.panel = False


def check_neural_view_where_there_are_weights(d: Driver) -> None:
    d.key("4")
    assert d.session.choice.shown_settings.view == "neural"
    d.until(lambda: d.session.choice.network_load is None, 60.0)
    if d.session.notices.message is not None:
        assert "weights" in d.session.notices.message.text and d.session.choice.shown_settings.view == "filled"
        return
    d.until(lambda: not d.session.needs_picture)
    assert d.session.picture.stats["network"] and np.array_equal(d.bare(), d.rendered())
    d.key("V")
    assert d.session.choice.sides == ("raw", "neural") and d.bare().std() > 5
    d.key("V")
    d.key("3")


def check_a_flight_leaves_out_what_is_hidden_and_ends_exact(d: Driver) -> None:
    from viewer.render import occlusion

    usual, occlusion.WORTH = occlusion.WORTH, 0.0  # this room is so light that looking for what is hidden would not pay
    d.key("3")
    d.key("W", "down")
    d.until(lambda: d.session.flight.moving and "hidden cells skipped" in d.session.approximations)
    d.key("W", "up")
    occlusion.WORTH = usual
    assert np.array_equal(d.bare(), d.rendered()) and not d.session.approximations
    d.key("HOME")


def check_no_gl_error_is_left(d: Driver) -> None:
    assert d.app.context.error == "GL_NO_ERROR"


CHECKS = {name.removeprefix("check_"): made for name, made in list(globals().items()) if name.startswith("check_")}
HEADLESS = "screenshot_equals_headless_render"


def check_headless(folder: Path) -> None:
    """The screenshot again, without a window, through EGL."""
    from viewer.camera import from_fov
    from viewer.render.context import create_context
    from viewer.render.renderer import Renderer
    from viewer.settings import Settings
    from viewer.window.present import composite
    from viewer.window.start import FIELD_OF_VIEW

    shot = np.load(folder / "shot.npz")
    context = create_context()
    renderer = Renderer(context, room(seed=1))
    view = str(shot["view"])
    frame = renderer.render(from_fov(*SIZE, FIELD_OF_VIEW, shot["matrix"]), Settings(view=view))
    assert np.array_equal(composite(frame.image(view)), shot["image"])
    renderer.release()


def main(folder: Path) -> None:
    report: dict[str, dict] = {}

    def attempt(name: str, work) -> None:
        start, problem = time.monotonic(), None
        try:
            work()
        except Exception:
            problem = traceback.format_exc()
        report[name] = {"problem": problem, "seconds": time.monotonic() - start}
        (folder / "report.json").write_text(json.dumps(report, indent=1))

    driver = Driver(folder)
    for name, check in CHECKS.items():
        attempt(name, lambda check=check: check(driver))
        driver.session.notices.message, driver.session.help, driver.session.interface = None, False, True
    driver.app.close()
    attempt(HEADLESS, lambda: check_headless(folder))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
