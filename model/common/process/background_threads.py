"""The end of a process while its background threads may still compute.

Python stops a daemon thread where it asks for the interpreter's lock once the interpreter is being taken down; inside a C++
library (torch, a reader) the C++ runtime then aborts the process ("terminate called without an active exception"), and static
objects of native libraries are destroyed under threads that use them.  So the threads of ours are waited for, and a command
ends without taking Python down.
"""

import atexit
import contextlib
import os
import sys
import threading
from time import monotonic
from typing import NoReturn

PREFIX = "pointglass "
"""Begins the name of every thread of ours."""


def wait_for_threads(seconds: float) -> bool:
    """Waits until all threads of ours have ended, ``seconds`` at most.  Returns whether they have."""
    latest = monotonic() + seconds
    for thread in _ours():
        thread.join(max(latest - monotonic(), 0.0))
    return not _ours()


def leave(code: int, seconds: float = 1.0) -> NoReturn:
    """Ends the process with exit code ``code``: once all threads of ours have ended, at most ``seconds`` later, after the
    functions of ``atexit``, with what was written flushed.  Where standard output cannot be written, one line says so, and the
    code is 2; a closed pipe is no error."""
    wait_for_threads(seconds)
    atexit._run_exitfuncs()
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        pass
    except OSError as error:
        if code == 0:
            code = 2
            with contextlib.suppress(OSError, ValueError):
                print(f"pointglass: standard output: cannot be written ({error.strerror or error})", file=sys.stderr)
    with contextlib.suppress(OSError, ValueError, AttributeError):
        sys.stderr.flush()
    os._exit(code)


def _ours() -> list[threading.Thread]:
    return [thread for thread in threading.enumerate()
            if thread.name.startswith(PREFIX) and thread is not threading.current_thread()]
