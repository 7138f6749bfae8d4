"""What a command reports while it runs: Python's ``logging``, shown on standard error and, on request, kept in a file.

Modules log to ``logging.getLogger(__name__)`` and configure nothing.  Levels: WARNING, a fallback that costs the person
something (a damaged cache, a slower engine); INFO, what was chosen and why (device, rasteriser, cache); DEBUG, the rest.
"""

import logging
import os
import platform
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from .. import __version__
from .errors import InputError
from .failures import tell
from .text import printable

OURS = ("pointglass",)
"""Top-level loggers; those of libraries keep to themselves."""
_shown: set[str] = set()
"""Lines that were shown on standard error."""


@contextmanager
def logging_to(*, verbose: bool, file: Path | None, arguments: Sequence[str]) -> Iterator[None]:
    """Within the block warnings go to standard error, with ``verbose`` INFO as well, and everything goes to ``file``, appended.

    arguments: of the command, for the file's first line.  Raises InputError if the file cannot be written, at the end of the
    block where that happens within it.
    """
    screen = _Screen(sys.stderr)
    screen.setLevel(logging.INFO if verbose else logging.WARNING)
    screen.setFormatter(_ScreenLine())
    handlers: list[logging.Handler] = [screen]
    if file is not None:
        try:
            kept = _KeptLog(file, encoding="utf-8", errors="backslashreplace")
        except OSError as error:
            raise InputError(f"cannot write this log ({error.strerror})", file=file,
                             remedy="choose another --log-file") from None
        kept.setFormatter(_FileLine("%(asctime)s %(levelname)s %(name)s [%(threadName)s] %(message)s"))
        handlers.append(kept)
    before = {name: logging.getLogger(name).level for name in OURS}
    for name in OURS:
        logger = logging.getLogger(name)
        logger.setLevel(logging.DEBUG if file is not None else screen.level)
        for handler in handlers:
            logger.addHandler(handler)
    logging.captureWarnings(True)  # NumPy's and others' go to the log alone, not beside the one line of an error
    others = logging.getLogger("py.warnings")
    others.propagate, others.level = False, logging.DEBUG
    others.handlers = handlers[1:] or [logging.NullHandler()]
    try:
        logging.getLogger("pointglass").debug(
            "pointglass %s, Python %s, %s, arguments: %s", __version__, platform.python_version(), platform.platform(),
            " ".join(arguments))
        yield
    finally:
        logging.captureWarnings(False)
        for name, level in before.items():
            logger = logging.getLogger(name)
            logger.setLevel(level)
            for handler in handlers:
                logger.removeHandler(handler)
        for handler in handlers:
            handler.close()
    if (failed := getattr(handlers[-1], "failed", None)) is not None:
        raise InputError(f"this log is incomplete ({failed.strerror or failed}); the command itself is done", file=file)


class _Screen(logging.StreamHandler):
    """Standard error.  A warning that a worker process repeats is shown once."""

    def emit(self, record: logging.LogRecord) -> None:
        text, ours = record.getMessage(), record.process == os.getpid()
        if ours or text not in _shown:
            super().emit(record)
        _shown.add(text)


def say_once(line: str) -> None:
    """A line on standard error, of a worker process; the same one comes from each of them."""
    if line not in _shown:
        _shown.add(line)
        tell(line)


class _KeptLog(logging.FileHandler):
    """A log file.  failed: the error after which nothing more is written, such as a full disk."""

    failed: OSError | None = None

    def emit(self, record: logging.LogRecord) -> None:
        if self.failed is None:
            super().emit(record)

    def handleError(self, record: logging.LogRecord) -> None:
        error = sys.exc_info()[1]
        if not isinstance(error, OSError):
            super().handleError(record)
            return
        self.failed = error

    def close(self) -> None:
        try:
            super().close()
        except OSError as error:
            self.failed = self.failed or error


class _ScreenLine(logging.Formatter):
    """``pointglass: warning: text``, one line a record, with tracebacks left to the file."""

    def format(self, record: logging.LogRecord) -> str:
        return f"pointglass: {record.levelname.lower()}: {printable(record.getMessage())}"


class _FileLine(logging.Formatter):
    """A line with the time and the place, and the traceback below it."""

    def format(self, record: logging.LogRecord) -> str:
        return printable(super().format(record), lines=True)
