"""What a command says when it fails: one printable line and an exit code for every anticipated failure.

Lack of memory is found in the causes of an error, too: a decoder that runs out of memory inside a good file raises the same
error as for a damaged one, and only its cause tells them apart.
"""

import contextlib
import errno
import logging
import re
import sys

from .errors import Cancelled, PointglassError, is_opengl_error
from .text import printable

LONGEST = 1500  # characters of a message
STOPPED = 130
_NO_MEMORY = re.compile(r"bad[_ ]alloc|(can.?not|can't|unable to|failed to) (allocate|start new thread|map segment)|"
                        r"out of memory|not enough memory|insufficient memory|no memory", re.IGNORECASE)  # fmt: skip
"""What libraries say of it: libstdc++, torch, Python's threads, the dynamic linker, OpenBLAS, Mesa."""
_log = logging.getLogger(__name__)


def report(error: BaseException) -> int | None:
    """Says what failed on standard error and returns the exit code; the log gets the traceback.  None for a bug, which keeps
    its traceback, and for a closed pipe."""
    if isinstance(error, Cancelled) or _chain(error, KeyboardInterrupt):
        # compiled loops turn Ctrl-C into a SystemError, some imports into an ImportError
        tell("stopped")
        return STOPPED
    if isinstance(error, BrokenPipeError):
        return None
    line, code = _line(error)
    if line is not None:
        _log.debug("failed", exc_info=error)
        tell(line)
    return code


def tell(message: str) -> None:
    """One line on standard error.  Of a long one the beginning, which names the file, and the end, which says what to do, are
    kept."""
    line = printable(message)
    line = line if len(line) <= LONGEST else f"{line[: LONGEST - 200]} ... {line[-200:]}"
    with contextlib.suppress(OSError, ValueError, AttributeError):  # closed, or on a full disk
        print(f"pointglass: {line}", file=sys.stderr, flush=True)


def lacks_memory(error: BaseException) -> bool:
    """Whether an error, or one that led to it, is a lack of main memory."""
    return bool(_chain(error, MemoryError)) or any(
        (isinstance(one, OSError) and one.errno == errno.ENOMEM)
        or (isinstance(one, (RuntimeError, ImportError, SystemError)) and _NO_MEMORY.search(str(one)) is not None)
        for one in _causes(error))


def _line(error: BaseException) -> tuple[str | None, int | None]:
    if lacks_memory(error) and getattr(error, "exit_code", 2) == 2:
        about = error.subject() if isinstance(error, PointglassError) else ""
        return f"{about}not enough memory for this; close other programs, allow this one more, or take a smaller scan", 2
    if isinstance(error, PointglassError):
        return str(error), error.exit_code
    if isinstance(error, OSError):
        return f"{error.filename or 'input/output'}: {error.strerror or error}", 2
    if is_opengl_error(error):
        return f"OpenGL: {error}; choose a smaller --size or --gpu-memory, and see `pointglass doctor`", 3
    return None, None


def _chain(error: BaseException, kind: type[BaseException]) -> BaseException | None:
    return next((one for one in _causes(error) if isinstance(one, kind)), None)


def _causes(error: BaseException | None) -> list[BaseException]:
    found: list[BaseException] = []
    while error is not None and error not in found:
        found.append(error)
        error = error.__cause__ or error.__context__
    return found
