"""A worker process: takes tasks from standard input, and gives what they return to what was standard output.

It ends when its input ends.  Where that happens within a task, the command that it works for has been killed: the task is
stopped as by SIGTERM, and what it has left unfinished is removed.  Ctrl-C is left to the command.
"""

import contextlib
import gc
import logging
import os
import pickle
import platform
import queue
import signal
import sys
import threading
from collections.abc import Callable
from time import monotonic
from typing import IO, Any

from ....model.common.loop_cache import NOTICE
from ....model.common.process.background_threads import leave
from ....model.common.process.processors import limit_processors
from ....model.common.process.signals import stop_at_once
from ..errors import InputError
from ..progress import set_sink
from .messages import Done, Said, Start, failed, receive_bytes, send
from .run_tasks import opened_function

_TELL_S = 0.3
"""Seconds between two messages on progress."""
_STOP_S = 5.0
"""Seconds that a task which is stopped has for its clean-up."""


class _ToParent(logging.Handler):
    """Gives records of the log to the command, with their texts made."""

    def __init__(self, say: Callable[[Said], None]):
        super().__init__()
        self._say = say

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        if record.exc_info:
            text = f"{text}\n{logging.Formatter().formatException(record.exc_info)}"
        sent = logging.LogRecord(record.name, record.levelno, record.pathname, record.lineno, text, None, None)
        sent.threadName = f"worker {os.getpid()}"
        with contextlib.suppress(OSError):  # the command has gone
            self._say(Said(record=sent))


class _Progress:
    """A sink that tells the command how far a task is, a few times a second: the command shows one bar for all tasks."""

    def __init__(self, say: Callable[[Said], None]):
        self._say, self._next = say, 0.0

    def __call__(self, label: str, done: int, total: int) -> bool:
        if (now := monotonic()) >= self._next:
            self._next = now + _TELL_S
            with contextlib.suppress(OSError):  # the command has gone
                self._say(Said(progress=f"{label} {100 * done // total} %" if total else label))
        return True


def main() -> None:
    """Runs until the input ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    stop_at_once(quiet=True)
    taken, given = _pipes()
    lock = threading.Lock()

    def say(message: object) -> None:
        with lock:
            send(given, message)

    tasks: queue.SimpleQueue[bytes | None] = queue.SimpleQueue()
    busy = threading.Event()
    threading.Thread(target=_listen, args=(taken, tasks, busy), daemon=True).start()
    data = tasks.get()
    if data is not None:
        start: Start = pickle.loads(data)
        limit_processors(start.threads, start.processes)
        _report_to(say, start.level)
        _work(start, tasks, busy, say)
    leave(0)


def _pipes() -> tuple[IO[bytes], IO[bytes]]:
    """The pipes to and from the command; what else is printed goes to standard error."""
    taken, given = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    os.dup2(2, 1)
    return taken, given


def _listen(taken: IO[bytes], tasks: "queue.SimpleQueue[bytes | None]", busy: threading.Event) -> None:
    while (data := receive_bytes(taken)) is not None:
        tasks.put(data)
    tasks.put(None)
    if busy.is_set():
        os.kill(os.getpid(), signal.SIGTERM)
    threading.Event().wait(_STOP_S)
    os._exit(130)


def _report_to(say: Callable[[Said], None], level: int) -> None:
    handler = _ToParent(say)
    logging.getLogger("pointglass").setLevel(level)
    logging.getLogger("pointglass").addHandler(handler)
    logging.captureWarnings(True)
    others = logging.getLogger("py.warnings")
    others.propagate, others.handlers = False, [handler] if level <= logging.DEBUG else [logging.NullHandler()]
    NOTICE.tell = lambda line: say(Said(line=line))
    set_sink(_Progress(say))


def _work(start: Start, tasks: "queue.SimpleQueue[bytes | None]", busy: threading.Event, say: Callable[[Any], None]) -> None:
    """Does one task after the other.  What they share is opened with the first and closed at the end."""
    with contextlib.ExitStack() as opened:
        function: Callable[[Any], Any] | None = None
        while (data := tasks.get()) is not None:
            busy.set()
            number = -1
            try:
                number, task = pickle.loads(data)
                if function is None:
                    _enter(start.folder)
                    function = opened_function(pickle.loads(start.function), opened)
                    gc.freeze()
                done = Done(number, function(pickle.loads(task)))
            except BaseException as error:
                done = failed(number, error)
            busy.clear()
            try:
                say(done)
            except OSError:
                return
            except Exception as error:  # the value cannot be pickled
                say(failed(number, error))


def _enter(folder: str) -> None:
    try:
        os.chdir(folder)
    except OSError as error:
        raise InputError(f"cannot be entered by the worker on {platform.node()} ({error.strerror or error})", file=folder,
                         remedy="start the command in a folder that all workers share") from None


if __name__ == "__main__":
    main()
    sys.exit(0)
