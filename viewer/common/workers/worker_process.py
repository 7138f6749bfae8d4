"""A worker process of this machine, as the command that gives it tasks sees it.

The process is started anew and not forked: OpenGL, CUDA and threads do not survive a fork.  It has a session of its own, so
that Ctrl-C in a terminal reaches the command alone, which ends it.
"""

import contextlib
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable
from typing import Any

from ....model.common.system import WINDOWS, end_processes
from .messages import Done, Said, Start, receive_bytes, send

_SECONDS = 5.0
"""Seconds that a process has to end by itself."""
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "RAYON_NUM_THREADS",
            "LP_NUM_THREADS")  # fmt: skip
"""Where libraries look for their number of threads; LP: Mesa's llvmpipe."""
_PROGRAM = ("import sys; sys.path[:] = {path!r}; import pointglass; "
            "from pointglass.viewer.common.workers.worker_main import main; main()")


class WorkerDied(Exception):
    """The process has ended within a task.  how: "killed by SIGKILL", "exit code 3"."""

    def __init__(self, how: str):
        super().__init__(how)
        self.how = how


def stop_processes(processes: "Iterable[WorkerProcess]") -> None:
    """Ends processes at once; each removes what its task has left unfinished."""
    end_processes([pid for process in processes if (pid := process.pid) is not None], _SECONDS)


class WorkerProcess:
    """Runs tasks, one at a time.  start: what it is told first."""

    def __init__(self, start: Start):
        program = _PROGRAM.format(path=[os.path.abspath(place) for place in sys.path])
        apart: dict[str, Any] = (
            {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP} if WINDOWS  # type: ignore[attr-defined]
            else {"start_new_session": True})
        threads = {name: os.environ.get(name, str(start.threads)) for name in _THREADS}
        self._process = subprocess.Popen([sys.executable, "-c", program], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                                         env={**os.environ, **threads}, **apart)
        with contextlib.suppress(OSError):  # it has ended already: its first task will tell
            assert self._process.stdin is not None
            send(self._process.stdin, start)

    def run(self, number: int, task: bytes, heard: Callable[[Said], object]) -> Done:
        """Has a task done, and gives to ``heard`` what is reported meanwhile.  Raises WorkerDied."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        try:
            send(self._process.stdin, (number, task))
        except OSError:
            raise WorkerDied(self._end()) from None
        while (data := receive_bytes(self._process.stdout)) is not None:
            message = pickle.loads(data)
            if isinstance(message, Done):
                return message
            heard(message)
        raise WorkerDied(self._end())

    def close(self) -> None:
        """Lets it end by itself, after its task."""
        with contextlib.suppress(OSError):
            assert self._process.stdin is not None
            self._process.stdin.close()
        try:
            self._process.wait(_SECONDS)
        except subprocess.TimeoutExpired:
            stop_processes([self])
        with contextlib.suppress(OSError):
            assert self._process.stdout is not None
            self._process.stdout.close()

    @property
    def pid(self) -> int | None:
        """Its number; None where it has ended."""
        return self._process.pid if self._process.poll() is None else None

    def _end(self) -> str:
        try:
            code = self._process.wait(_SECONDS)
        except subprocess.TimeoutExpired:
            self._process.kill()
            code = self._process.wait()
        if code >= 0:
            return f"exit code {code}"
        with contextlib.suppress(ValueError):
            return f"killed by {signal.Signals(-code).name}"
        return f"killed by signal {-code}"
