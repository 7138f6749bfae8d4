"""Interrupting a training: a training step is completed first, and worker processes end silently.

A terminal sends Ctrl-C to every process of the command.  Only the main process reports it, and terminates its workers.
SIGTERM, sent by a scheduler, is treated as Ctrl-C by the command line.
"""

import contextlib
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from typing import Any, TypeVar

from ..system import STOPS
from .signals import handled, stopped

T = TypeVar("T")


class Interrupt:
    """What :func:`finish_before_interrupt` gives: whether a signal has come."""

    def __init__(self) -> None:
        self.came = False

    def check(self) -> None:
        """Raises KeyboardInterrupt if a signal has come: a place where the work may be interrupted."""
        if self.came:
            raise KeyboardInterrupt


@contextlib.contextmanager
def finish_before_interrupt() -> Iterator[Interrupt]:
    """Delays Ctrl-C or SIGTERM to the end of the block, or to the next ``check()``, and raises KeyboardInterrupt there.

    A second Ctrl-C is not delayed.  For training steps, after which a checkpoint is saved, and for callbacks of native
    libraries.
    """
    interrupt = Interrupt()
    usual = {stop: handler for stop in STOPS
             if (handler := signal.getsignal(stop)) in (signal.default_int_handler, stopped)}
    if not usual or threading.current_thread() is not threading.main_thread():
        yield interrupt  # another handler is installed, and stays in charge
        return

    def note(number: int, frame) -> None:
        if interrupt.came and number == signal.SIGINT:  # SIGTERM may come twice, from a scheduler and a parent process
            usual.get(signal.SIGINT, signal.default_int_handler)(number, frame)  # type: ignore[operator]
        interrupt.came = True

    try:
        with handled(usual, note):
            yield interrupt
    except Exception as error:
        if interrupt.came:  # probably a consequence: another process of the training was stopped and no longer answers
            raise KeyboardInterrupt from error
        raise
    interrupt.check()


@contextlib.contextmanager
def workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of worker processes for :func:`run_in_worker`.  If the block fails, they are terminated."""
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


def run_in_worker(job: Callable[..., T], *args: Any) -> T:
    """Runs a job in a worker.  When the worker is terminated, the job's own clean-up runs, and the process then exits."""
    try:
        return job(*args)
    except BaseException:
        if _terminated:
            os._exit(1)  # otherwise the executor would give this process its next job
        raise


_terminated: list[int] = []


def _start() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _terminate)


def _terminate(number: int, _frame) -> None:
    if not _terminated:  # the executor sends a second SIGTERM
        _terminated.append(number)
        raise SystemExit(1)
