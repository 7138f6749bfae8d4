"""The end of a process while its background threads may still compute.

Python stops a daemon thread where it asks for the interpreter's lock once the interpreter is being taken down; inside a C++
library (torch, a reader) the C++ runtime then aborts the process ("terminate called without an active exception").
So threads are waited for before the end, and a process whose threads do not end in time leaves without taking Python down.
"""

import atexit
import os
import sys
import threading
from time import monotonic

PREFIX = "pointglass "
"""Begins the name of every thread of ours."""


def wait_for_threads(seconds: float) -> bool:
    """Waits until all threads of ours have ended, ``seconds`` at most.  Returns whether they have."""
    latest = monotonic() + seconds
    for thread in _ours():
        thread.join(max(latest - monotonic(), 0.0))
    return not _ours()


def leave(code: int, seconds: float = 1.0) -> int:
    """The exit code ``code`` for ``sys.exit``, once all threads of ours have ended.  Ends the process itself where one does
    not end within ``seconds``: after the functions of ``atexit``, with what was written flushed."""
    if wait_for_threads(seconds):
        return code
    atexit._run_exitfuncs()
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:
            stream.flush()
    os._exit(code)


def _ours() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate()
            if thread.name.startswith(PREFIX) and thread is not threading.current_thread()]
