"""The window itself: events in, pictures out.  All state that matters lives in the Session.

One loop: events -> session -> a picture, if it changed -> canvas -> interface -> screen.  Where nothing changes,
nothing is drawn and the loop sleeps until an event.  Pointer positions arrive in logical pixels; pictures are made at
the framebuffer's size.
"""

import ctypes
import os
from collections import deque
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from viewer.errors import DeviceError, PointglassError
from viewer.render.occlusion import Occlusion
from viewer.settings import MEMORY, Memory, Settings
from viewer.window import capture
from viewer.window.hands import Hands
from viewer.window.present import Canvas, composite, split_column
from viewer.window.session import Session

if TYPE_CHECKING:
    import moderngl

    from viewer.render.renderer import Renderer

SIZE = (1280, 720)
_SETTLE = 3  # interface frames after an event: what imgui needs to lay out, hover and answer
_NAP = 0.5  # seconds of sleep at most while idle
_BREATH = 0.06  # seconds between interface frames while only the interface changes: a load's bar, a tooltip's delay
_LINGER = 0.7  # seconds the interface is watched after the pointer moved over it


def run(paths: list[Path], settings: Settings, *, cache: bool = True, match: bool = True, memory: Memory = MEMORY) -> int:
    """Opens the window on ``paths`` (none: an empty start page) until it is closed.  Returns the exit code, 0.

    cache: whether grids are kept for the next time.  match: scans to the same exposure.  memory: what points may take.
    Raises DeviceError where there is no display or no OpenGL 4.3.
    """
    app = App(settings, cache=cache, match=match, memory=memory)
    try:
        if paths:
            app.session.open(paths)
        while not app.closing:
            app.step()
    finally:
        app.close()
    return 0


class App:
    """Owns the window, the interface and the renderer of the scene shown.

    size: of the window, logical pixels.  folder: where captures go.  scale: of the interface; None: the screen's own.
    """

    def __init__(self, settings: Settings, *, size: tuple[int, int] = SIZE, folder: Path | None = None,
                 scale: float | None = None, cache: bool = True, match: bool = True, memory: Memory = MEMORY):
        from imgui_bundle import imgui  # isort: skip  (before glfw: it brings the library that glfw then loads)
        import glfw  # isort: skip

        self.glfw, self.imgui = glfw, imgui
        self._folder, self._scale, self._memory = folder or Path.cwd(), scale, memory
        self.window = _make_window(glfw, size)
        self.address = ctypes.cast(self.window, ctypes.c_void_p).value or 0
        try:
            self._start_graphics()
        except Exception:
            glfw.destroy_window(self.window)
            glfw.terminate()
            raise
        self.session = Session(
            settings, glfw.get_framebuffer_size(self.window), wake=glfw.post_empty_event,
            open_scene=lambda files: _open_scene(files, cache, match),
        )
        self.renderer: Renderer | None = None
        self._frame = None
        self._shown: tuple[str, ...] = ()
        self._seen = Occlusion()
        self._problem: str | None = None
        self._settle = _SETTLE
        self._awake_until = 0.0
        self._intervals: deque[float] = deque(maxlen=20)
        self._last_picture = 0.0
        self._actions = {
            "home": self.session.go_home,
            "frame": self.session.frame_scene,
            "view_raw": lambda: self.session.show("raw"),
            "view_filtered": lambda: self.session.show("filtered"),
            "view_filled": lambda: self.session.show("filled"),
            "view_neural": lambda: self.session.show("neural"),
            "split": lambda: self.session.compare(not self.session.split),
            "screenshot": self.screenshot,
            "record": self.record,
            "help": lambda: setattr(self.session, "help", not self.session.help),
            "interface": lambda: setattr(self.session, "interface", not self.session.interface),
            "escape": self.escape,
        }
        self.hands = Hands(self)

    def _start_graphics(self) -> None:
        from viewer.render.context import create_context
        from viewer.render.shader import Programs
        from viewer.window.theme import Theme

        glfw, imgui = self.glfw, self.imgui
        glfw.make_context_current(self.window)
        glfw.swap_interval(1)
        self.context: moderngl.Context = create_context(headless=False)
        self._programs = Programs(self.context)
        self.canvas: Canvas | None = None
        imgui.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        imgui.backends.glfw_init_for_opengl(self.address, False)
        imgui.backends.opengl3_init("#version 430")
        self.theme = Theme(self.interface_scale())

    def interface_scale(self) -> float:
        """Interface pixels per logical pixel: the screen's scale, less what the framebuffer already brings."""
        if self._scale is not None:
            return self._scale
        glfw = self.glfw
        width, drawn = glfw.get_window_size(self.window)[0], glfw.get_framebuffer_size(self.window)[0]
        ratio = drawn / width if width and drawn else 1.0
        return float(np.clip(glfw.get_window_content_scale(self.window)[0] / ratio, 0.75, 4.0))

    def wake(self) -> None:
        """Draws the interface for a few frames: something happened."""
        self._settle = _SETTLE

    def linger(self) -> None:
        """Keeps the interface going for a moment: a tooltip waits, a dialog fades in."""
        self._awake_until = perf_counter() + _LINGER

    def act(self, action: str) -> None:
        """Does what a control asks for, by the name it has in the table."""
        self._actions[action]()

    def escape(self) -> None:
        """Lets go of the pointer, or closes one thing."""
        if self.session.looking or self.session.dragging_handle:
            self.hands.release_pointer()
        else:
            self.session.escape()

    # -- the loop ----------------------------------------------------------------------------------------------------

    @property
    def closing(self) -> bool:
        return bool(self.glfw.window_should_close(self.window))

    def step(self, *, wait: bool = True) -> None:
        """One turn of the loop.  wait: sleep until something happens where nothing is to be done."""
        glfw, session = self.glfw, self.session
        self._note_arrivals()
        change = session.next_change()
        stirring = session.load is not None or session.network_load is not None or perf_counter() < self._awake_until
        busy = session.needs_picture or self._settle > 0 or change == 0.0
        if wait and (not busy or min(session.size) == 0):
            glfw.wait_events_timeout(_BREATH if stirring else min(_NAP, change or _NAP))
        else:
            glfw.poll_events()
        self._note_arrivals()
        message = session.message
        if (loaded := session.poll()) is not None:
            self._upload(loaded)
        if session.message is not message:
            self.linger()
        if session.advance():
            self.wake()
        if stirring:
            self._settle = max(self._settle, 1)
        if min(session.size) == 0:
            return
        if session.needs_picture:
            self._make_picture()
            self._settle = max(self._settle, 1)
        if self._settle > 0 or not wait:
            self._settle = max(0, self._settle - 1)
            self._draw()
            glfw.swap_buffers(self.window)

    def _note_arrivals(self) -> None:
        """Points of a scene larger than memory have come: the picture can have them."""
        if self.renderer is not None and self.renderer.pages.arrived:
            self.session.dirty = True

    def _upload(self, loaded) -> None:
        """Puts a loaded scene on the GPU; where that fails the scene before it stays."""
        from viewer.render.renderer import Renderer

        self.wake()
        try:
            renderer = Renderer(self.context, loaded.scene, memory=self._memory, wake=self.glfw.post_empty_event)
        except (PointglassError, MemoryError) as error:
            self.session.say("This scan cannot be shown", str(error) or "not enough memory for its points")
            return
        if self.renderer is not None:
            self.renderer.release()
        self.renderer, self._frame, self._shown, self._problem = renderer, None, (), None
        self.session.accept(loaded)
        self._intervals.clear()
        self.glfw.set_window_title(self.window, f"{self.session.title} · pointglass")

    def _make_picture(self) -> None:
        session, renderer = self.session, self.renderer
        if renderer is None:
            return
        plan = session.plan
        try:
            self._frame = renderer.render(
                session.camera, replace(session.settings, lod=plan.level), tuple(dict.fromkeys(plan.views)),
                self._seen if plan.hides else None, streaming=True,
            )  # fmt: skip
        except PointglassError as error:
            self._frame = None
            session.failed(str(error))
            return
        self._shown = plan.views
        now = perf_counter()
        if now - self._last_picture < 1.0:
            self._intervals.append(now - self._last_picture)
        else:
            self._intervals.clear()
        self._last_picture = now
        session.drew(plan, self._frame.stats)
        if (problem := renderer.pages.problem) != self._problem:
            self._problem = problem
            if problem:
                session.say("A part of this scan cannot be read", problem)

    @property
    def frame_rate(self) -> float | None:
        """Pictures a second while something moves; None at rest."""
        if not self._intervals or not self.session.moving:
            return None
        return len(self._intervals) / max(sum(self._intervals), 1e-9)

    def _draw(self) -> None:
        """The picture and the interface on the canvas, and that to the screen."""
        session = self.session
        if self.canvas is None or self.canvas.size != session.size:
            if self.canvas is not None:
                self.canvas.release()
            self.canvas = Canvas(self.context, self._programs, session.size)
        sides = [self._frame.textures[view] for view in self._shown] if self._frame is not None else []
        if len(sides) == 2:
            self.canvas.show(sides[0], sides[1], split_column(session.split_at, session.size[0]))
        else:
            self.canvas.show(sides[0] if sides else None)
        self._interface()
        self.canvas.to_screen()

    def _interface(self) -> None:
        from viewer.window import dialogs, hud, panels

        imgui, session, look = self.imgui, self.session, self.theme
        imgui.backends.opengl3_new_frame()
        imgui.backends.glfw_new_frame()
        imgui.new_frame()
        over = self.hands.over_handle and not imgui.get_io().want_capture_mouse
        if over or session.dragging_handle:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
        if session.interface:
            hud.draw_start(session, look)
            hud.draw_handle(session, look, hovered=over)
            if not session.help:  # which covers the middle, and at small sizes everything
                hud.draw_hud(session, look, fps=self.frame_rate)
                panels.draw_panel(session, look)
            hud.draw_recording(session, look)
            hud.draw_toasts(session, look)
        dialogs.draw_help(session, look, self.hands.key_name)
        dialogs.draw_load(session, look)
        dialogs.draw_message(session, look)
        imgui.render()
        imgui.backends.opengl3_render_draw_data(imgui.get_draw_data())

    # -- captures ----------------------------------------------------------------------------------------------------

    def picture(self) -> np.ndarray | None:
        """(H, W, 3) uint8: what is shown, without the interface and at full quality; None without a scene."""
        session = self.session
        if self.renderer is None or min(session.size) == 0:
            return None
        plan, sides = session.full_plan, session.sides
        frame = self.renderer.render(session.camera, session.settings, tuple(dict.fromkeys(sides)))
        self._frame, self._shown = frame, sides
        session.drew(plan, frame.stats)
        image = composite(frame.image(sides[0]))
        if len(sides) == 2:
            column = split_column(session.split_at, session.size[0])
            image[:, column:] = composite(frame.image(sides[1]))[:, column:]
        return image

    def screenshot(self) -> Path | None:
        """Saves the picture as PNG and says where."""
        try:
            image = self.picture()
            if image is None:
                return None
            path = capture.stamped("pointglass", ".png", self._folder)
            capture.save_png(path, image)
        except PointglassError as error:
            self.session.say("No screenshot was saved", str(error))
            return None
        self.session.toast(f"Saved {path}")
        return path

    def record(self) -> Path | None:
        """Starts recording frame times, or stops and saves them."""
        session = self.session
        if session.recording is None:
            session.recording = capture.FrameTimes()
            session.toast("Recording frame times; F9 stops")
            return None
        times, session.recording = session.recording, None
        path = capture.stamped("pointglass-frames", ".csv", self._folder)
        try:
            times.save(path)
        except PointglassError as error:
            session.say("The frame times were not saved", str(error))
            return None
        session.toast(f"Saved {len(times)} frames to {path}")
        return path

    def close(self) -> None:
        """Ends everything; a recording under way is saved."""
        if self.session.recording is not None:
            self.record()
        self.session.close()
        for owned in (self.renderer, self.canvas, self._programs):
            if owned is not None:
                owned.release()
        self.renderer = self.canvas = None
        imgui = self.imgui
        imgui.backends.opengl3_shutdown()
        imgui.backends.glfw_shutdown()
        imgui.destroy_context()
        self.glfw.destroy_window(self.window)
        self.glfw.terminate()


def _make_window(glfw, size: tuple[int, int]):
    """A window with an OpenGL 4.3 core context.  Raises DeviceError with the cause."""
    problems: list[str] = []
    glfw.set_error_callback(lambda code, text: problems.append(os.fsdecode(text)))

    def cause() -> str:
        return problems[-1] if problems else "no reason given"

    if not glfw.init():
        raise DeviceError(
            f"no window can be opened ({cause()}); set DISPLAY, or use `pointglass render` which needs no window"
        )
    glfw.window_hint(glfw.CONTEXT_VERSION_MAJOR, 4)
    glfw.window_hint(glfw.CONTEXT_VERSION_MINOR, 3)
    glfw.window_hint(glfw.OPENGL_PROFILE, glfw.OPENGL_CORE_PROFILE)
    glfw.window_hint(glfw.SAMPLES, 0)
    glfw.window_hint(glfw.DEPTH_BITS, 0)
    glfw.window_hint(glfw.STENCIL_BITS, 0)
    glfw.window_hint(glfw.SCALE_TO_MONITOR, True)
    window = glfw.create_window(*size, "pointglass", None, None)
    if window:
        glfw.set_window_size_limits(window, 320, 200, glfw.DONT_CARE, glfw.DONT_CARE)
    else:
        reason = cause()
        glfw.terminate()
        raise DeviceError(f"OpenGL 4.3 is needed and the window could not have it ({reason}); see `pointglass doctor`")
    return window


def _open_scene(paths: list[Path], cache: bool, match: bool):
    from viewer.cloud import open_scene

    return open_scene(paths, cache=cache, match=match)
