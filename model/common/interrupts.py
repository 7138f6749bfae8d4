"""A training is stopped: a step is finished before it counts, and processes that make pairs leave without a word.

A terminal sends Ctrl-C to every process of the command.  The first one says that it stops and sees to the others.
SIGTERM, as a scheduler sends it, is to the command line the same.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

from model.common.signals import STOPS, handled

T = TypeVar("T")


@contextlib.contextmanager
def to_its_end() -> Iterator[None]:
    """Ctrl-C or SIGTERM waits for the end of the block, a second Ctrl-C does not: half a step is no state to go on from."""
    usual = [stop for stop in STOPS if signal.getsignal(stop) == signal.default_int_handler]
    if not usual or threading.current_thread() is not threading.main_thread():
        yield  # whoever takes care of Ctrl-C in another way goes on doing so
        return
    pressed: list[int] = []

    def note(number: int, _frame) -> None:
        if pressed and number == signal.SIGINT:  # SIGTERM comes twice where a scheduler and a parent both send it
            raise KeyboardInterrupt
        pressed.append(number)

    try:
        with handled(usual, note):
            yield
    except Exception as error:
        if pressed:  # as when a process that has stopped already no longer answers
            raise KeyboardInterrupt from error
        raise
    if pressed:
        raise KeyboardInterrupt


@contextlib.contextmanager
def workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of processes for :func:`leaving` jobs.  Where the block fails, Ctrl-C included, they are ended at once."""
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(count, initializer=_start)
    try:
        yield pool
    except BaseException:
        for process in set(multiprocessing.active_children()) - others:
            process.terminate()
        raise
    finally:
        pool.shutdown(wait=True, cancel_futures=True)


def leaving(job: Callable[..., T], *args: Any) -> T:
    """Does a job in such a process; told to end, the job takes away what it has half made, and the process is gone."""
    try:
        return job(*args)
    except BaseException:
        if _told:
            os._exit(1)  # an executor's process would take the next job
        raise


_told: list[int] = []


def _start() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)


def _leave(number: int, _frame) -> None:
    if not _told:  # the executor says it once more
        _told.append(number)
        raise SystemExit(1)
