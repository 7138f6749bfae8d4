"""Messages between a command and its worker processes: pickles with their length before them, in a pipe.

To a worker: ``Start`` once, then pairs (number of the task, pickled task).  From it: any number of ``Said``, then one ``Done``
for each task.
"""

import logging
import pickle
import struct
import traceback
from dataclasses import dataclass
from typing import IO, Any

from ..errors import PointglassError
from ..failures import lacks_memory

_LENGTH = struct.Struct("<Q")


@dataclass(frozen=True)
class Start:
    """function: pickled, see run_tasks.  threads: processors that the worker may use.  processes: that share the machine.
    level: of the log, as in ``logging``.  folder: in which relative paths begin."""

    function: bytes
    threads: int
    processes: int
    level: int
    folder: str


@dataclass(frozen=True)
class Said:
    """What a worker reports: a record of the log, a line for standard error, or how far its task is ("reading 37 %")."""

    record: logging.LogRecord | None = None
    line: str = ""
    progress: str = ""


@dataclass(frozen=True)
class Done:
    """The end of a task.  value: what it returned.  error: what it raised, None where it returned.  no_memory: whether the
    error comes from a lack of memory, which its causes tell and pickling loses.  trace: of a bug, its traceback."""

    number: int
    value: Any = None
    error: BaseException | None = None
    no_memory: bool = False
    trace: str = ""

    def result(self) -> Any:
        """The value.  Raises the error."""
        if self.error is None:
            return self.value
        if self.no_memory:
            raise self.error from MemoryError()
        raise self.error from (WorkerTrace(f"in a worker:\n{self.trace}") if self.trace else None)


class WorkerTrace(Exception):
    """The cause of a bug's error: the traceback in the worker, as text."""


def failed(number: int, error: BaseException) -> Done:
    """The end of a task that raised ``error``; an error that cannot be pickled is replaced by its text."""
    try:
        pickle.loads(pickle.dumps(error))
        sent = error
    except Exception:
        sent = RuntimeError(f"{type(error).__name__}: {error}")
    bug = not isinstance(error, (PointglassError, OSError))
    trace = "".join(traceback.format_exception(error)) if bug else ""
    return Done(number, error=sent, no_memory=lacks_memory(error), trace=trace)


def send(pipe: IO[bytes], message: object) -> None:
    """Writes a message.  Raises OSError where nobody reads it."""
    data = pickle.dumps(message, protocol=5)
    pipe.write(_LENGTH.pack(len(data)))
    pipe.write(data)
    pipe.flush()


def receive_bytes(pipe: IO[bytes]) -> bytes | None:
    """The next message, still pickled; None at the end of the pipe, also in the middle of a message."""
    head = _read(pipe, _LENGTH.size)
    return None if head is None else _read(pipe, _LENGTH.unpack(head)[0])


def _read(pipe: IO[bytes], count: int) -> bytes | None:
    data = pipe.read(count)
    return data if data is not None and len(data) == count else None
