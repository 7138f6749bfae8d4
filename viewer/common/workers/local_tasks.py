"""Tasks spread over processes of this machine: a thread for each, which gives it one task after the other."""

import logging
import os
import queue
import threading
from collections import deque
from collections.abc import Generator, Sequence
from typing import Any

from ....model.common.files.temporary import sweep_recorded
from ....model.common.process.background_threads import PREFIX
from ....model.common.process.processors import usable_processors
from ....model.common.process.signals import cleaned, is_stopping
from ..command_log import say_once
from ..errors import InputError, Option
from ..progress import Progress
from ..text import counted
from .messages import Done, Said, Start
from .worker_choice import Workers
from .worker_process import WorkerDied, WorkerProcess, stop_processes

MOST_DEATHS = 3
"""Times that the worker of one task may be killed: a killer that picks processes at random (lack of memory, a person) has then
picked the same task three times."""
_PAUSE_S = 0.2
"""Seconds before a worker is replaced: where the whole command is being stopped, that is known by then."""
_SHOWN_S = 0.25
"""Seconds between two looks at what the workers do."""
_NAMED = 2
"""Running tasks that are named in the progress."""
_log = logging.getLogger(__name__)


def local_results(function: bytes, tasks: Sequence[bytes], names: Sequence[str], workers: Workers, meter: Progress,
                  ahead: int | None) -> Generator[Any, None, None]:  # fmt: skip
    """As of run_tasks.  function, tasks: pickled."""
    pool = _Pool(function, tasks, names, min(workers.count, len(tasks)), ahead)
    with cleaned(pool.end):
        pool.begin()
        done: dict[int, Done] = {}
        for number in range(len(tasks)):
            while number not in done:
                try:
                    found = pool.results.get(timeout=_SHOWN_S)
                except queue.Empty:
                    meter.say(pool.running())
                    continue
                if isinstance(found, BaseException):
                    raise found
                done[found.number] = found
                found.result()
                meter.update(1)
            pool.take(number)
            yield done.pop(number).result()
        pool.close()


class _Pool:
    """results: receives each ``Done``, and an error after which nothing goes on."""

    def __init__(self, function: bytes, tasks: Sequence[bytes], names: Sequence[str], count: int, ahead: int | None):
        threads = max(1, usable_processors() // count)
        level = logging.getLogger("pointglass").getEffectiveLevel()
        self._start = Start(function, threads, count, level, os.getcwd())
        self._tasks, self._names, self._ahead = tasks, names, ahead
        self.results: queue.SimpleQueue[Done | BaseException] = queue.SimpleQueue()
        self._waiting, self._deaths, self._wanted = deque(range(len(tasks))), [0] * len(tasks), 0
        self._changed, self._ended = threading.Condition(), False
        self._running: set[WorkerProcess] = set()
        self._progress: dict[int, str] = {}
        self._threads = [threading.Thread(target=self._serve, name=f"{PREFIX}worker {n}", daemon=True) for n in range(count)]
        _log.info("%d worker process%s, %d thread%s each", count, "es" if count > 1 else "", threads,
                  "s" if threads > 1 else "")  # fmt: skip

    def begin(self) -> None:
        for thread in self._threads:
            thread.start()

    def take(self, number: int) -> None:
        """The result of this task is taken: later tasks may begin."""
        with self._changed:
            self._wanted = number + 1
            self._changed.notify_all()

    def running(self) -> str:
        """"a.e57: reading 37 %, b.e57: placing 5 %, and 2 others": the tasks that report how far they are."""
        known = [f"{self._names[number]}: {text}" for number, text in sorted(self._progress.copy().items())]
        others = len(known) - _NAMED
        return ", ".join([*known[:_NAMED], *([f"and {counted(others, 'other')}"] if others > 0 else [])])

    def close(self) -> None:
        """All tasks are done: waits until the processes have ended by themselves."""
        for thread in self._threads:
            thread.join()

    def end(self) -> None:
        """Stops the processes at once."""
        with self._changed:
            self._ended = True
            running = [*self._running]
            self._changed.notify_all()
        stop_processes(running)

    def _next(self) -> int | None:
        """The next task to begin, waited for; None where none is left."""
        with self._changed:
            while not self._ended and self._waiting:
                if self._ahead is None or self._waiting[0] <= self._wanted + self._ahead:
                    return self._waiting.popleft()
                self._changed.wait()
        return None

    def _serve(self) -> None:
        """The life of one worker and its successors."""
        process = None
        try:
            while (number := self._next()) is not None:
                while process is None or not self._did(process, number):
                    process = self._started()
                    if process is None:
                        return
        except BaseException as error:
            self.results.put(error)
        finally:
            if process is not None:
                process.close()
                with self._changed:
                    self._running.discard(process)

    def _started(self) -> WorkerProcess | None:
        """A new process; None where the command is being stopped."""
        with self._changed:
            if self._ended or is_stopping():
                return None
            process = WorkerProcess(self._start)
            self._running.add(process)
        return process

    def _did(self, process: WorkerProcess, number: int) -> bool:
        """Whether a task was done; False where the process died.  Raises InputError where that has happened too often."""
        def told(said: Said) -> None:
            if said.progress:
                self._progress[number] = said.progress
            heard(said)

        try:
            self.results.put(process.run(number, self._tasks[number], told))
            return True
        except WorkerDied as death:
            process.close()
            with self._changed:
                self._running.discard(process)
                self._changed.wait_for(lambda: self._ended, _PAUSE_S)
                if self._ended or is_stopping():
                    return False
            self._deaths[number] += 1
            sweep_recorded()
            check_deaths(self._names[number], self._deaths[number], death.how)
            _log.warning("%s: its worker ended (%s); it is done again", self._names[number], death.how)
            return False
        finally:
            self._progress.pop(number, None)


def check_deaths(name: str, deaths: int, how: str) -> None:
    """Raises InputError where a task has ended its worker too often."""
    if deaths >= MOST_DEATHS:
        raise InputError((f"{name}: its worker ended {deaths} times ({how})",),
                         remedy=("fewer ", Option("--workers"), " leave more memory to each; without ", Option("--workers"),
                                 " the reason may be seen"))  # fmt: skip


def heard(said: Said) -> None:
    """Passes on what a worker reports; what several report alike is shown once."""
    if said.line:
        say_once(said.line)
    if (record := said.record) is not None:
        logging.getLogger(record.name).handle(record)
