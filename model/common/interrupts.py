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

from .signals import STOPS, handled

T = TypeVar("T")


@contextlib.contextmanager
def finish_before_interrupt() -> Iterator[None]:
    """Delays Ctrl-C or SIGTERM to the end of the block; a second Ctrl-C is not delayed.

    For training steps: a checkpoint must not be saved in the middle of one.
    """
    usual = [stop for stop in STOPS if signal.getsignal(stop) == signal.default_int_handler]
    if not usual or threading.current_thread() is not threading.main_thread():
        yield  # another handler is installed, and stays in charge
        return
    pressed: list[int] = []

    def note(number: int, _frame) -> None:
        if pressed and number == signal.SIGINT:  # SIGTERM may come twice, from a scheduler and a parent process
            raise KeyboardInterrupt
        pressed.append(number)

    try:
        with handled(usual, note):
            yield
    except Exception as error:
        if pressed:  # probably a consequence: another process of the training was stopped and no longer answers
            raise KeyboardInterrupt from error
        raise
    if pressed:
        raise KeyboardInterrupt


@contextlib.contextmanager
def workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """A pool of worker processes for :func:`run_in_worker`.  If the block fails, Ctrl-C included, they are terminated."""
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
