"""The window itself: events in, pictures out.  All state that matters lives in the Session.

One loop: events -> session -> a picture, if it changed -> canvas -> interface -> screen.  Where nothing changes,
nothing is drawn and the loop sleeps until an event.  Nothing in the loop waits for a scan or for the network: both run on
threads of their own and wake the loop.  Pointer positions arrive in logical pixels; pictures are made in pixels of the
framebuffer.
"""

import ctypes
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from ....model.common.process.interrupts import finish_before_interrupt
from ...common.errors import InputError
from ...picture.settings import MEMORY, Memory, Settings
from ...readers.remote.address import is_address
from ..file_dialog.choice_window import ChoiceWindow
from ..file_dialog.file_dialogs import FileDialogs
from ..flight.gamepad import POLL
from ..interaction.meshes.arriving_meshes import scans_of_opened
from ..interaction.table import toolbox
from ..interaction.tool import ToolContext
from ..kit.chosen_button import ChosenButton
from ..kit.clipboard import SystemClipboard
from ..panels.missing_scans import MissingScansDialog
from ..panels.start_page import StartPage
from ..planning.opened_ahead import open_scene
from ..saving.save_actions import SaveActions
from ..session.loading import Loaded, preview_scene
from ..session.project_flow import ProjectFlow
from ..session.recent import last_view
from ..session.session import Session
from ..viewport.viewport import Viewport
from .actions import WindowActions
from .answers import Answers
from .devices import Devices
from .glfw_window import make_window, screen_scale
from .input import Input
from .interface import draw_interface

if TYPE_CHECKING:
    import moderngl

    from ...picture.camera import Camera

SIZE = (1280, 720)
_SETTLE = 3  # interface frames after an event: what imgui needs to lay out, hover and answer
_IDLE_SECONDS = 0.5  # seconds of sleep at most while idle
_REDRAW_SECONDS = 0.06  # seconds between interface frames while only the interface changes: a progress bar, a tooltip's delay
_LONG = 50.0  # milliseconds per picture above which the interface is laid out twice: its next frame is far off
_COMPILING_SECONDS = 12.0
_LINGER = 0.7  # seconds the interface is watched after the pointer moved over it


class App:
    """Owns the window, the interface and the viewport.  toolbox: the tools.  tools: their context.

    size: of the window, logical pixels.  folder: where captures go until a person chooses.
    scale: of the interface; None: the screen's own.
    """

    def __init__(self, settings: Settings, *, size: tuple[int, int] = SIZE, folder: Path | None = None,
                 scale: float | None = None, cache: bool = True, match: bool = True, memory: Memory = MEMORY,
                 start: "Camera | None" = None, columns: str | None = None):
        from imgui_bundle import imgui  # isort: skip  (before glfw: it brings the library that glfw then loads)
        import glfw  # isort: skip

        self.glfw, self.imgui = glfw, imgui
        self._scale, self._woken = scale, False
        self.window = make_window(glfw, size)
        self.address = ctypes.cast(self.window, ctypes.c_void_p).value or 0
        try:
            self._start_graphics()
        except Exception:
            glfw.destroy_window(self.window)
            glfw.terminate()
            raise
        self.session = Session(
            settings, glfw.get_framebuffer_size(self.window), wake=self._wake_loop,
            open_scene=partial(open_scene, cache=cache, match=match, columns=columns), start=start,
            preview_scene=partial(preview_scene, cache=cache, match=match, columns=columns),
        )  # fmt: skip
        reading = self.session.loads.reading
        reading.match, reading.columns, reading.cache = match, columns, cache
        self.files = FileDialogs(self._wake_loop, self._scan_folder)
        self.choice_window = ChoiceWindow()
        self.chosen_button = ChosenButton()  # of the message
        self.missing_scans = MissingScansDialog()
        self.start_page = StartPage(self.context)
        self.viewport = Viewport(self.context, self.session, memory=memory, wake=glfw.post_empty_event)
        self.toolbox = toolbox()
        self.tools = ToolContext(self.session, self.viewport, self.theme, set_captured=lambda on: self.input.set_captured(on))
        self.tools.clipboard = self.clipboard = SystemClipboard(glfw, self.window, self.session.notices.toast)
        imgui.get_platform_io().platform_get_clipboard_text_fn = lambda _context: self.clipboard.read()
        self.tools.files = self.files
        self.save_actions = SaveActions(self.session, self.viewport, self.files, folder)
        self.tools.saves = self.save_actions
        self.projects = ProjectFlow(self.session, self.files, self._wake_loop, lambda: self.toolbox.answering)
        self.tools.save_project, self.tools.open_scans = self.projects.save, self.open
        self._settle, self._awake_until, self._title = _SETTLE, 0.0, ""
        self.last_view, self.actions = last_view, WindowActions(self)
        self.answers = Answers()
        self.input = Input(self)
        self.devices = Devices(self)
        self._measure_density()

    @property
    def asking(self) -> bool:
        """Whether a file dialog or a question is open, whose keys are its own."""
        asked = self.files.choice is not None or self.missing_scans.asked is not None
        return asked and self.session.notices.message is None

    def _scan_folder(self) -> Path | None:
        """Where the first file of the scan lies; None without one."""
        paths = self.session.shown_scan.paths
        return paths[0].absolute().parent if paths and not is_address(paths[0]) else None

    def say_compiling(self, line: str) -> None:
        """Shows that loops are being compiled.  From any thread."""
        self.session.notices.toast(f"{line[0].upper()}{line[1:]}", seconds=_COMPILING_SECONDS)
        self._wake_loop()

    def _wake_loop(self) -> None:
        """Something is to be shown: progress, a result.  From any thread."""
        self._woken = True
        self.glfw.post_empty_event()

    def _start_graphics(self) -> None:
        from ...render.device.context import create_context
        from ..kit.theme import Theme

        glfw, imgui = self.glfw, self.imgui
        glfw.make_context_current(self.window)
        glfw.swap_interval(1)
        self.context: moderngl.Context = create_context(headless=False)
        imgui.create_context()
        io = imgui.get_io()
        io.set_ini_filename("")
        imgui.backends.glfw_init_for_opengl(self.address, False)
        imgui.backends.opengl3_init("#version 430")
        self.theme = Theme(self.interface_scale(), self._wake_loop)

    def interface_scale(self) -> float:
        """Logical pixels per design unit (kit.theme): the screen's scale, less what the framebuffer already brings."""
        return screen_scale(self.glfw, self.window) if self._scale is None else self._scale

    def wake(self) -> None:
        """Draws the interface for a few frames: something happened."""
        self._settle = _SETTLE

    def linger(self) -> None:
        """Keeps the interface going for a moment: a tooltip waits, a dialog fades in."""
        self._awake_until = perf_counter() + _LINGER

    def act(self, action: str) -> None:
        """Does what a control asks for, by its name in the table."""
        self.actions.do(action)

    def open(self, paths: Sequence[Path], start: "Camera | None" = None) -> None:
        """Opens scans or a project instead of what is open, once that is saved or given up; meshes alone join it."""
        if not (paths := scans_of_opened(self.session, paths)):
            return
        view = self.last_view(paths) if start is None else None
        self.projects.leave(lambda: self.session.open(paths, start, view=view))

    def close_scan(self) -> None:
        """Back to the start page, once the work is saved or given up."""
        self.projects.leave(self._close_scan)

    def _close_scan(self) -> None:
        self._remember_scan()
        self.session.close_scene()
        self.viewport.clear()
        self.start_page.renew()
        self.projects.look_for_offers()

    def _remember_scan(self) -> None:
        """Puts the scan that is being left among the recent ones, with the picture on the screen."""
        self.projects.remember(self.viewport.shown_picture())

    def _measure_density(self) -> None:
        width = self.glfw.get_window_size(self.window)[0]
        area = self.session.area
        area.density = area.window_size[0] / width if width and area.window_size[0] else 1.0

    def request_close(self) -> None:
        """Closes the window, once the work is saved or given up."""
        self.wake()
        if self.glfw.get_window_attrib(self.window, self.glfw.ICONIFIED) and self.projects.at_stake:
            self.glfw.restore_window(self.window)  # the question must be seen
        unfinished = [*self.toolbox.unfinished, *self.save_actions.unfinished]
        self.projects.end(unfinished, lambda: self.glfw.set_window_should_close(self.window, True))

    # -- the loop ----------------------------------------------------------------------------------------------------

    @property
    def closing(self) -> bool:
        return bool(self.glfw.window_should_close(self.window))

    def step(self, *, wait: bool = True) -> None:
        """One turn of the loop.  wait: sleep until something happens where nothing is to be done."""
        glfw, session, message = self.glfw, self.session, self.session.notices.message
        self.input.follow(drawn=min(session.area.window_size) > 0)
        arriving = self.viewport.note_arrivals()
        reading = self.viewport.pixels.waiting
        if self.viewport.finish_network():
            self.wake()
        change = session.next_change()
        loading = session.loads.current is not None or session.view_settings.network_load is not None
        restless = session.screen.needs_picture or change == 0.0 or session.notices.answered
        stirring = loading or self.files.polls or perf_counter() < self._awake_until
        busy = arriving or reading or restless or self._settle > 0
        with finish_before_interrupt():  # Ctrl-C in what GLFW calls back would be a traceback, and forgotten
            if wait and (not busy or min(session.area.window_size) == 0):
                nap = POLL if self.devices.connected else _IDLE_SECONDS
                glfw.wait_events_timeout(_REDRAW_SECONDS if stirring else min(nap, change or nap))
            else:
                glfw.poll_events()
        if self._woken:
            self._woken, self._settle = False, max(self._settle, 2)  # what appears is drawn in its second frame
        self.devices.follow()
        session.notices.take_answer()
        if self.files.poll():
            self.wake()
        self.missing_scans.follow(self)
        if (loaded := session.poll()) is not None:
            self._upload(loaded)
        if session.notices.message is not message:
            self.linger()
        if self.viewport.follow():
            self.wake()
        self.toolbox.follow(self.tools)
        self.save_actions.follow()
        self.projects.follow()
        if self.projects.title != self._title:
            self._title = self.projects.title
            glfw.set_window_title(self.window, self._title)
        if session.advance():
            self.wake()
        if stirring or reading:
            self._settle = max(self._settle, 1)
        if min(session.area.window_size) == 0:
            return
        self._measure_density()
        session.arrange(self.theme.scale)
        painted: float | None = None
        if session.screen.needs_picture and self.answers.come_first(session.picture):
            self._draw()
            session.arrange(self.theme.scale)  # a panel may be folded now
        if session.screen.needs_picture:
            self.viewport.paint()
            painted = perf_counter()
            self._settle = max(self._settle, 2)  # in the second frame tools begin to read the picture
            cost = session.picture.cost
            if cost is not None and cost.total_ms > _LONG:
                draw_interface(self, shown=False)
        elif not session.flight.moving:
            self.viewport.settle()
        if self._settle > 0 or not wait:
            self._settle = max(0, self._settle - 1)
            self._draw()
            if len(self.imgui.get_current_context().input_events_queue):  # imgui takes a key or two a frame
                self._settle = max(self._settle, 1)
            if painted is not None and session.flight.moving and self.viewport.shares_processors:
                session.picture.adaptive_lod.spent_outside((perf_counter() - painted) * 1e3)

    def _upload(self, loaded: Loaded) -> None:
        self.wake()
        if not self.projects.may_replace(loaded):  # the work was changed since the person was asked
            if not loaded.preview:
                self.projects.leave(lambda: self._upload(loaded))
            return
        if loaded.paths != self.session.shown_scan.paths:
            self._remember_scan()
        try:
            self.viewport.upload(loaded)
        except InputError as error:  # the file of its points became unreadable just now
            self._close_scan()
            self.session.notices.say("This scan cannot be shown", error)

    def _draw(self) -> None:
        """Draws the last picture and the interface on the canvas, and shows that on the screen."""
        canvas = self.viewport.show()
        if self.answers.begun:
            draw_interface(self, shown=False)
        draw_interface(self)
        canvas.to_screen()
        self.glfw.swap_buffers(self.window)
        self.answers.drawn()

    def close(self) -> None:
        """Ends everything; a recording under way is saved."""
        if self.session.recording is not None:
            self.save_actions.record()
        self._remember_scan()
        self.projects.close()
        self.save_actions.close()
        self.toolbox.close()
        self.devices.close()
        self.session.close()
        self.clipboard.close()
        self.start_page.release()
        self.viewport.release()
        imgui = self.imgui
        imgui.backends.opengl3_shutdown()
        imgui.backends.glfw_shutdown()
        imgui.destroy_context()
        self.glfw.destroy_window(self.window)
        self.glfw.terminate()
