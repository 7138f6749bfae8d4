"""Signals that stop a command: Ctrl-C, SIGTERM and, when its terminal is closed, SIGHUP.

A command is stopped by its signal handler alone: it ends the child processes, undoes what is unfinished (temporary files, new
folders: :func:`cleaned`, :func:`undone`), prints one line and ends the process with exit code 130.  No exception is raised, so
nothing is unwound: a KeyboardInterrupt inside a native library, a compiled loop or an import made them crash or fail with
another error (libe57 in 6 of 8 interrupts, LAZ writing in 16 of 24).  Python runs a handler on the main thread between two
bytecodes, so a native call ends first.

:func:`uninterrupted` delays a signal over work that must be whole, ``finish_before_interrupt``
(model/common/process/interrupts.py) turns it into a KeyboardInterrupt at a chosen place.  A Python program that imports
pointglass keeps its own handlers: there Ctrl-C is a KeyboardInterrupt, and the same clean-up runs while it unwinds.
"""

import contextlib
import itertools
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator

from ..system import ALL_STOPS, after_fork_in_child, child_processes, end_processes
from .native_output import error_descriptor

_CHILDREN_S = 5.0
"""Seconds that child processes have for their own clean-up: half of the 10 s after which ``docker stop`` kills, so that this
process has as long for its own."""

_EARLY = "_stopped"
"""Name of the handler that pointglass.py installs before anything is imported."""
AFTER_CHILDREN: list[Callable[[], object]] = []
"""Called where the process is stopped and had child processes, once these have ended."""


class _State:
    """quiet: no line is written.  stopping: a signal has come."""

    quiet = False
    stopping = False


_state = _State()
_undo: dict[int, Callable[[], object]] = {}
_numbers = itertools.count()


def stop_at_once(*, quiet: bool = False) -> None:
    """From now on these signals end the process, cleaned up, with exit code 130.  Signals that are ignored stay so (a shell's
    background jobs).  quiet: without the line, in a process whose parent says it."""
    _state.quiet = quiet
    for stop in ALL_STOPS:
        present = signal.getsignal(stop)
        if present in (signal.SIG_DFL, signal.default_int_handler) or getattr(present, "__name__", "") == _EARLY:
            signal.signal(stop, stopped)


def is_stopping() -> bool:
    """Whether a signal is ending this process: threads start nothing new then."""
    return _state.stopping


def stopped(_number: int, _frame) -> None:
    """The handler of :func:`stop_at_once`."""
    _state.stopping = True
    for stop in ALL_STOPS:
        signal.signal(stop, signal.SIG_IGN)
    if os.getpid() == _owner[0]:  # a forked child has its parent's handler and nothing to clean up
        if _end_children():
            for undo in AFTER_CHILDREN:
                with contextlib.suppress(BaseException):
                    undo()
        for undo in reversed([*_undo.values()]):
            with contextlib.suppress(BaseException):
                undo()
        with contextlib.suppress(OSError):
            if _state.quiet:
                os._exit(130)
            error = error_descriptor()
            shown = b"\n" if "tqdm" in sys.modules and os.isatty(error) else b""  # below a progress bar
            os.write(error, shown + b"pointglass: stopped\n")
    os._exit(130)


@contextlib.contextmanager
def on_stop(undo: Callable[[], object]) -> Iterator[None]:
    """``undo`` is called where the process is stopped within the block; the last registered first."""
    number = next(_numbers)
    _undo[number] = undo
    try:
        yield
    finally:
        _undo.pop(number, None)


@contextlib.contextmanager
def cleaned(undo: Callable[[], object]) -> Iterator[None]:
    """``undo`` is called at the end of the block in any case: done, failed, or the process stopped."""
    with on_stop(undo):
        try:
            yield
        finally:
            undo()


@contextlib.contextmanager
def undone(undo: Callable[[], object]) -> Iterator[None]:
    """``undo`` is called where the block fails or the process is stopped within it."""
    with on_stop(undo):
        try:
            yield
        except BaseException:
            undo()
            raise


@contextlib.contextmanager
def handled(stops: Iterable[signal.Signals], by: Callable) -> Iterator[None]:
    """Within the block ``by`` handles these signals; the previous handlers are restored at its end."""
    with contextlib.ExitStack() as stack:
        for stop in stops:
            stack.callback(signal.signal, stop, signal.getsignal(stop))
            signal.signal(stop, by)
        yield


@contextlib.contextmanager
def uninterrupted() -> Iterator[None]:
    """Delays Ctrl-C, and SIGTERM where it is handled, to the end of the block.

    For several renames that belong together, and for native calls on the main thread through which no exception may pass: an
    interrupt raised while numba converts results to Python objects causes a SystemError, and several of them a crash.
    """
    usual = {stop: handler for stop in ALL_STOPS if callable(handler := signal.getsignal(stop))}
    if threading.current_thread() is not threading.main_thread() or not usual:
        yield
        return
    came: list[tuple] = []
    try:
        with handled(usual, lambda *call: came.append(call)):
            yield
    finally:
        for call in came:
            usual[call[0]](*call)


def _end_children() -> bool:
    """Ends the processes that this one started, within _CHILDREN_S.  Returns whether there were any."""
    children = _children()
    end_processes(children, _CHILDREN_S)
    return bool(children)


def _children() -> list[int]:
    """Process numbers of the children, as far as the system names them; without multiprocessing's own helpers, which end
    with this process."""
    found = child_processes()
    active = getattr(sys.modules.get("multiprocessing"), "active_children", None)  # None too while it is being imported
    if active is not None:
        found |= {process.pid for process in active() if process.pid is not None}
    for name, holder, number in (("resource_tracker", "_resource_tracker", "_pid"),
                                 ("forkserver", "_forkserver", "_forkserver_pid")):
        helper = getattr(sys.modules.get(f"multiprocessing.{name}"), holder, None)
        found.discard(getattr(helper, number, None) or 0)
    return sorted(found)


_owner = [os.getpid()]


def _forked() -> None:
    _owner[0] = 0
    _undo.clear()


after_fork_in_child(_forked)
