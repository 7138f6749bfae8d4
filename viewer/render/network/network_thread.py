"""Runs the network on a thread of its own, one picture at a time, so that the thread that draws the interface does not wait.

A run whose picture is not needed any more ends at the network's next layer (model.network.interruption).

No OpenGL here: the caller reads the packed input back before, and uploads the result after.  torch releases Python's lock
while it computes.
"""

import threading
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from ....model.common.system import lower_thread_priority
from ....model.network.interruption import Interrupted, interruptible

_NICENESS = 10
"""Added to the niceness of the thread, and of torch's threads that it starts, where the system has one per thread (Linux).  A
drag while the balanced network runs (two cores, window of 1280x720, studio.laz) is answered within 25 to 37 ms at p95, with 19
within 29 to 32; but with 19, beside other work (load 4), the network did not end within 60 s."""


@dataclass(frozen=True, eq=False)
class Finished:
    """One run.  serial: as given to :meth:`NetworkThread.start`.  made: what the work returned, None where it failed.
    milliseconds: of the run.  error: what was raised, or None."""

    serial: int
    made: np.ndarray | None
    milliseconds: float
    error: BaseException | None = None


class NetworkThread:
    """One worker thread, started with the first run.  Of the runs that wait only the latest is kept.

    lock: held during a run.  Hold it to run the same network on another thread.
    """

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self._state = threading.Condition()
        self._waiting: tuple[int, Callable[[], np.ndarray], Callable[[], None]] | None = None
        self._running: int | None = None
        self._wanted: int | None = None  # the run whose result is needed
        self._finished: Finished | None = None
        self._thread: threading.Thread | None = None
        self._closed = False

    def start(self, serial: int, work: Callable[[], np.ndarray], wake: Callable[[], None]) -> None:
        """Runs ``work`` as soon as the run before it has ended; that one is interrupted.  wake: called on the thread when it
        has ended."""
        with self._state:
            self._waiting, self._finished, self._wanted = (serial, work, wake), None, serial
            if self._thread is None:
                self._thread = threading.Thread(target=self._loop, name="pointglass network", daemon=True)
                self._thread.start()
            self._state.notify_all()

    def take(self, serial: int) -> Finished | None:
        """The run ``serial`` if it has ended, else None.  Older results are dropped."""
        with self._state:
            done = self._finished
            if done is None:
                return None
            self._finished = None
            return done if done.serial == serial else None

    def drop(self) -> None:
        """Forgets the run that has not begun and the result that was not taken, and interrupts the run under way."""
        with self._state:
            self._waiting = self._finished = self._wanted = None

    @property
    def busy(self) -> bool:
        """Whether a run is under way or waits."""
        with self._state:
            return self._running is not None or self._waiting is not None

    def close(self) -> None:
        """Interrupts the run under way and ends the thread; does not wait for it."""
        with self._state:
            self._waiting = self._finished = self._wanted = None
            self._closed = True
            self._state.notify_all()

    def _loop(self) -> None:
        lower_thread_priority(_NICENESS)
        while True:
            with self._state:
                self._state.wait_for(lambda: self._waiting is not None or self._closed)
                if self._waiting is None:
                    return
                (serial, work, wake), self._waiting = self._waiting, None
                self._running = serial
            begun, made, failed = perf_counter(), None, None
            try:
                with self.lock:
                    begun = perf_counter()
                    with interruptible(lambda serial=serial: self._wanted != serial):
                        made = work()
            except Interrupted:
                pass
            except BaseException as error:  # raised again where the result is taken
                failed = error
            with self._state:
                self._running = None
                if self._wanted == serial:
                    self._finished = Finished(serial, made, (perf_counter() - begun) * 1e3, failed)
            wake()
