"""Long work on a thread of its own, watched from the window: what it does, its progress, and a way to stop it."""

import threading
import traceback
from collections.abc import Callable
from time import monotonic
from typing import Any

from ....model.common.system import lower_thread_priority
from ...common.errors import Cancelled, PointglassError
from ...common.progress import set_sink

_WAKE_S = 0.25
"""Seconds between two reports of progress that wake the window's loop."""
AWAITED, BESIDE = 5, 10
"""Niceness of the thread, and of the threads and processes that it starts, where the system has one per thread (Linux), of work
that a person waits for and of work beside which a person goes on.  Beside other programs 5 leaves a third of what they take,
10 a tenth.  A thread that wakes beside two busy ones of niceness 5 waits 3 ms at p95, of 10 it waits 0.1 ms (Linux 6.18, two
cores), and a picture of the window wakes many times."""


class Worker:
    """Runs ``work()`` on a thread.  ``wake`` is called (on that thread) when it has ended, and a few times a second while it
    goes on.  start: at once, not by :meth:`start`.

    niceness: AWAITED or BESIDE.  title: what it does as a whole.  label, done, total: the latest progress (total 0: unknown).
    finished: result or error are there.
    error: what went wrong, an error or the line that a person reads; None where nothing did.
    cancelled: asked to stop; its result must not be used.
    """

    def __init__(self, work: Callable[[], Any], title: str, wake: Callable[[], None] = lambda: None, *, start: bool = True,
                 niceness: int = AWAITED):
        self.title, self.label, self.done, self.total = title, "", 0, 0
        self.result: Any = None
        self.error: PointglassError | str | None = None
        self.cancelled = False
        self._wake, self._woke, self._niceness = wake, 0.0, niceness
        self._step: tuple[str, float, int] | None = None  # the present step: its label, since when, and what was done then
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(work,), name=f"pointglass {title}", daemon=True)
        if start:
            self._thread.start()

    def start(self) -> None:
        """Starts work that was made with ``start=False``."""
        self._thread.start()

    @property
    def finished(self) -> bool:
        return self._over.is_set()

    @property
    def fraction(self) -> float | None:
        """How far the present step is, 0 to 1; None where that is not known."""
        return min(self.done / self.total, 1.0) if self.total else None

    @property
    def seconds_left(self) -> float | None:
        """Until the end of the present step, at its speed so far; None where that is not known yet."""
        if self._step is None or not self.total or self.done <= self._step[2]:
            return None
        _, since, done = self._step
        return (self.total - self.done) * (monotonic() - since) / (self.done - done)

    def cancel(self) -> None:
        """Asks the work to stop at its next progress report, where it cleans up after itself."""
        self.cancelled = True

    def join(self, timeout: float) -> bool:
        """Waits for the thread.  True where it ended."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def _sink(self, label: str, done: int, total: int) -> bool:
        now = monotonic()
        if self._step is None or self._step[0] != label or done < self.done:
            self._step = label, now, done
        self.label, self.done, self.total = label, done, total
        if now - self._woke >= _WAKE_S:  # the loop may sleep: the mouse rests
            self._woke = now
            self._wake()
        return not self.cancelled

    def _run(self, work: Callable[[], Any]) -> None:
        lower_thread_priority(self._niceness)
        set_sink(self._sink)
        try:
            self.result = work()
        except Cancelled:
            self.cancelled = True
        except PointglassError as error:
            self.error = error
        except MemoryError:
            self.error = f"{self.title}: not enough memory; close other programs or open a smaller scan"
        except Exception as error:  # a bug: the window lives on, and the terminal has what a report needs
            traceback.print_exc()
            self.error = f"{self.title}: unexpected {type(error).__name__}: {error}; the terminal has the details"
        finally:
            set_sink(None)
            self._over.set()
            self._wake()
