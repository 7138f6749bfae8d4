"""Drives an App: events enter where GLFW's callbacks deliver them."""

import threading
import time
from pathlib import Path

import numpy as np

from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary

SIZE = (640, 400)
NAP = 0.02
"""Seconds between two turns of the loop while something is waited for."""


def room(points: int = 50_000, seed: int = 5):
    """A box room of 8 x 6 x 3 m with a coloured checker on its walls, as a Scene."""
    from pointglass.viewer.grid.open_scene import scene_from_arrays

    rng = np.random.default_rng(seed)
    size = np.array([8.0, 6.0, 3.0])
    xyz = rng.random((points, 3)) * size
    wall = rng.integers(0, 6, points)
    xyz[np.arange(points), wall % 3] = np.where(wall < 3, 0.0, size[wall % 3])
    checker = (np.floor(xyz * 2).sum(axis=1).astype(int) % 2)[:, None]
    rgb = np.clip(60 + 28 * wall[:, None] + np.array([70, 20, 50]) * checker, 0, 255).astype(np.uint8)
    return scene_from_arrays(xyz, rgb, meta=ScanDescription((f"room{seed}",), metres_per_unit=1.0))


def pair_of_files(seed: int):
    """The room, its left half from one file and its right half from another, both without scanner positions."""
    from pointglass.viewer.grid.open_scene import scene_from_arrays
    from pointglass.viewer.grid.scene import unpack

    xyz, rgb, _, _ = unpack(room(seed=seed))
    scans = tuple(ScanSummary(name, 0) for name in ("left", "right"))
    return scene_from_arrays(xyz, rgb, scan=(xyz[:, 0] > 4).astype(np.uint8),
                             meta=ScanDescription(("left.laz", "right.laz"), metres_per_unit=1.0, scans=scans))


def room_with_passer(seed: int):
    """The room from two stations, 3 m apart; in the scan of the first one a person stands between them, blue."""
    from pointglass.viewer.grid.open_scene import scene_from_arrays

    rng = np.random.default_rng(seed)
    size, foot, radius = np.array([8.0, 6.0, 3.0]), np.array([4.0, 3.6]), 0.3
    places = np.array([[2.5, 3.0, 1.5], [5.5, 3.0, 1.5]])
    xyz, rgb, station = [], [], []
    for number, place in enumerate(places):
        ray = rng.normal(size=(60_000, 3))
        ray /= np.linalg.norm(ray, axis=1, keepdims=True)
        reach = np.min(np.where(ray > 0, size - place, -place) / ray, axis=1)
        flat, start = ray[:, :2], place[:2] - foot
        a, b, c = (flat**2).sum(axis=1), flat @ start, start @ start - radius**2
        with np.errstate(invalid="ignore"):
            t = (-b - np.sqrt(b * b - a * c)) / a
        met = (number == 0) & (t > 0) & (t < reach) & (place[2] + t * ray[:, 2] < 1.8)
        xyz.append(place + ray * np.where(met, t, reach)[:, None])
        grey = (110 + 60 * (np.floor(xyz[-1] * 2).sum(axis=1).astype(int) % 2))[:, None]
        rgb.append(np.where(met[:, None], (40, 60, 220), grey))
        station.append(np.full(len(ray), number))
    scans = tuple(ScanSummary(f"tripod {number}", 0, tuple(place)) for number, place in enumerate(places.tolist()))
    return scene_from_arrays(np.concatenate(xyz), np.concatenate(rgb).astype(np.uint8), noise=False,
                             scan=np.concatenate(station).astype(np.uint8),
                             meta=ScanDescription((f"passer{seed}",), metres_per_unit=1.0, scans=scans))


def middle(d: "Driver", right: float = 0.0, down: float = 0.0) -> tuple[float, float]:
    """A position of the window: the middle of the picture, moved by shares of its size."""
    (left, top), (width, height) = d.session.area.origin, d.session.area.size
    return left + width * (0.5 + right), top + height * (0.5 + down)


class Driver:
    """An App, and events for it.  A picture "bare" is that of the whole window with the interface hidden.

    on_screen: copy the canvas to the X server's screen, too.  Checks read the canvas, and the copy is a third of a frame in
    software OpenGL.  drive.py and random_actions.py present every frame, as the program does; test_installed_window.py and
    test_work_is_kept.py look at the screen.
    """

    def __init__(self, folder: Path, *, on_screen: bool = False):
        import glfw

        from pointglass.viewer.picture.settings import Settings
        from pointglass.viewer.window.shell.app import App
        from pointglass.viewer.window.viewport.present import Canvas

        if not on_screen:
            Canvas.to_screen = lambda canvas: canvas._context.screen.use()  # what OpenGL is left to, as with it
            glfw.swap_buffers = lambda window: None
        self.folder = folder
        self.app = App(Settings(view="filled"), size=SIZE, folder=folder, scale=1.0)
        self.glfw = glfw
        self.session = self.app.session
        self.release = threading.Event()
        self.session.loads.open_scene = self._open
        self.app.projects.leave = lambda then: then()  # unsaved work is given up; test_unsaved_work.py has the questions
        self.app.projects.may_replace = lambda loaded: True
        self.app.last_view = lambda paths: None  # every scan begins at its start viewpoint

    def _open(self, paths, **options):
        from pointglass.viewer.common.progress import progress
        from pointglass.viewer.grid.open_scene import open_scene

        name = paths[0].name
        if name == "slow.ply":  # a load that lasts until it is cancelled
            with progress(0, "Reading slow.ply") as meter:
                while True:
                    meter.update(1)
                    time.sleep(0.005)
        if name.startswith("pair"):
            return pair_of_files(int(name[4:]))
        if name.startswith("passer"):
            return room_with_passer(int(name[6:]))
        return room(seed=int(name[4:])) if name.startswith("room") else open_scene(paths, cache=False, **options)

    def fresh(self, scan: str | None) -> None:
        """Brings the window to where any check may begin: ``scan`` from its start viewpoint, None: the start page; nothing
        held, nothing open, settings, size and panels as at first."""
        from pointglass.viewer.picture.settings import Settings
        from pointglass.viewer.window.interaction.tool import Modifiers

        app, session = self.app, self.session
        session.loads.cancel()
        session.let_go()
        app.input.release_pointer()
        app.input._modifiers = Modifiers()
        session.notices.message, session.notices.toasts, session.recording = None, [], None
        session.help, session.interface, session.profiler = False, True, False
        if app.toolbox.active is not app.toolbox.fly:
            app.toolbox.select(app.toolbox.fly.name, app.tools)
        if session.area.window_size != SIZE:
            self.resize(*SIZE)
        self.panels.outliner = self.panels.inspector = False  # as in any window as narrow as SIZE
        self.panels._narrow, self.panels._before = True, (True, True)
        chosen = session.view_settings
        chosen.split, chosen.left, chosen.background = False, "raw", "plain"
        chosen.request(Settings(view="filled"))
        session.picture.adaptive_lod.keep_up = True
        session.work.shot_noted = session.work.shot_legend = False
        session.work.shot_scale, session.work.photo, session.work.tint = 1, None, False
        if session.scene is not None:
            app.act("close_scan")
        self.settle()
        if scan is not None:
            self.drop(self.folder / scan)
            self.until(lambda: session.loads.current is None and session.scene is not None
                       and not session.shown_scan.preview, 120.0)
            self.key("HOME")
            self.rest()

    def settle(self, steps: int = 3) -> None:
        for _ in range(steps):
            self.app.step(wait=False)

    def until(self, condition, seconds: float = 90.0) -> None:
        """Runs the window's own loop, which sleeps and draws nothing where nothing happens: a worker keeps the processors."""
        from pointglass.viewer.window.shell import app

        end, nap = time.monotonic() + seconds, app._IDLE_SECONDS
        app._IDLE_SECONDS = NAP
        try:
            while not condition():
                assert time.monotonic() < end, "waited too long"
                self.app.step()
                if self.session.flight.moving:
                    time.sleep(4 * NAP)  # a flight takes its time, however many pictures are made of it
        finally:
            app._IDLE_SECONDS = nap
        self.settle()

    def rest(self) -> None:
        """Waits until the picture is the final one."""
        self.until(lambda: not self.session.screen.refining, 60.0)

    def resize(self, *size: int) -> None:
        self.glfw.set_window_size(self.app.window, *size)
        self.until(lambda: self.session.area.window_size == size)

    def click(self, x: float, y: float, button: int | None = None) -> None:
        self.point(x, y)
        self.button(self.glfw.PRESS, button)
        self.button(self.glfw.RELEASE, button)
        self.settle()

    def double_click(self, x: float, y: float) -> None:
        """Two clicks at the same moment, however long the frames between them take."""
        usual = self.app.input._clock
        now = usual()
        self.app.input._clock = lambda: now
        try:
            self.click(x, y)
            self.click(x, y)
        finally:
            self.app.input._clock = usual

    def key(self, name: str, action: str = "tap") -> None:
        key = getattr(self.glfw, f"KEY_{name}")
        code = self.glfw.get_key_scancode(key)
        if action in ("tap", "down"):
            self.app.input.on_key(self.app.window, key, code, self.glfw.PRESS, 0)
        if action in ("tap", "up"):
            self.app.input.on_key(self.app.window, key, code, self.glfw.RELEASE, 0)
        if action == "tap":
            self.settle()

    def point(self, x: float, y: float) -> None:
        self.app.input.on_enter(self.app.window, 1)
        self.app.input.on_pointer(self.app.window, float(x), float(y))
        self.settle(2)

    def button(self, action: int, button: int | None = None) -> None:
        self.app.input.on_button(self.app.window, self.glfw.MOUSE_BUTTON_LEFT if button is None else button, action, 0)
        self.settle(2)

    def drop(self, *paths: Path) -> None:
        self.app.input.window_events.on_drop(self.app.window, [str(path) for path in paths])

    def canvas(self) -> np.ndarray:
        self.settle()
        return self.app.viewport.canvas.read()

    @property
    def panels(self):
        """Which panels are open."""
        return self.session.area.panels

    @property
    def imgui_wants_pointer(self) -> bool:
        return self.app.imgui.get_io().want_capture_mouse

    def picture(self, name: str, settle: int = 2) -> None:
        """Leaves what the window shows as ``NAME.png``, to be looked at."""
        from PIL import Image

        self.settle(settle)
        Image.fromarray(self.app.viewport.canvas.read()).save(self.folder / f"{name}.png")

    def bare(self) -> np.ndarray:
        """The picture alone, at rest: the interface hidden."""
        shown, self.session.interface = self.session.interface, False
        said, self.session.notices.toasts = self.session.notices.toasts, []
        try:
            self.settle(1)
            self.rest()
            return self.app.viewport.canvas.read()
        finally:
            self.session.interface, self.session.notices.toasts = shown, said

    def rendered(self) -> np.ndarray:
        from pointglass.viewer.picture.background import composite

        """What ``render`` makes of the present view, at the size of the window."""
        session = self.session
        camera = session.camera.resized(*session.area.window_size)
        frame = self.app.viewport.renderer.render(camera, session.view_settings.settings)
        image = composite(frame.image(session.view_settings.settings.view))
        session.picture.dirty = True
        return image
