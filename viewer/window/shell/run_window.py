"""Opens the window, and runs its loop until it is closed."""

import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

from ....model.common.loop_cache import NOTICE
from ...picture.settings import MEMORY, Memory, Settings
from ...readers.remote.address import is_address
from ..planning.opened_ahead import AHEAD
from ..session.preferences import preferences_of, read_preferences, take_preferences, with_preferences, write_preferences
from .app import App
from .warm_up import WarmUp

if TYPE_CHECKING:
    from ...picture.camera import Camera


_START_S = 5.0
"""Seconds after which a start counts as over although nothing is shown: what is opened is converted first."""
_SWITCH_S = 0.0005
"""Seconds after which Python takes its lock from a job that goes on; usual are 5 ms.  The window gives the lock away in
each call of GLFW, several times a picture, and waits so long to have it back.  While a film was rendered (studio, 1280x720, two
processors shared with other work) keys were answered within 106 ms at p95 before, within 57 and 66 ms in two runs since."""


def run(paths: list[Path], settings: Settings, *, cache: bool = True, match: bool = True, memory: Memory = MEMORY,
        start: "Camera | None" = None, columns: str | None = None, started: Callable[[], None] = lambda: None) -> int:
    """Opens the window on ``paths`` (none: the start page) until it is closed.  Returns the exit code, 0.

    cache: whether grids are kept for the next time.  match: give scans the same exposure.  memory: what points may take.
    columns: of text files.  start: the first camera; None: one is chosen (viewer.window.flight.start_viewpoint).
    started: called once, after the first picture, or where there is none after five seconds.
    Raises DeviceError where there is no display or no OpenGL 4.3.
    """
    kept = read_preferences()
    settings = with_preferences(settings, kept, sys.argv[1:])
    neural_later = bool(paths) and settings.view == "neural"  # torch would slow the first picture down: import it after that
    first = replace(settings, view="filled") if neural_later else settings
    if cache and all(path.suffix.lower() != ".pointglass" and not is_address(path) for path in paths):
        AHEAD.begin(paths, match=match, columns=columns)
    app = App(first, size=(kept.width, kept.height), cache=cache, match=match, memory=memory, start=start, columns=columns)
    take_preferences(app.session, kept)
    NOTICE.tell = app.say_compiling
    try:
        if paths:
            app.open(paths)
        else:
            WarmUp()  # while the start page is shown
        begun, starting = perf_counter(), True
        while not app.closing:
            app.step()
            if starting and (app.session.picture.made is not None or not paths or perf_counter() - begun > _START_S):
                starting = False
                started()
                sys.setswitchinterval(_SWITCH_S)
            if neural_later and app.session.picture.made is not None:
                neural_later = False
                if app.session.screen.drawn == ("filled",) and app.session.work.project is None:  # else another was chosen
                    app.act("view_neural")
    finally:
        if (now := preferences_of(app.session)) is not None:
            write_preferences(now)
        app.close()
    return 0
