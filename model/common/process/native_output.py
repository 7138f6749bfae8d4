"""Holds back what native code writes to standard error: Rust reports a panic there, which becomes an exception as well.

The descriptor itself is exchanged, for all threads: what others write meanwhile is delayed to the end of the block, not lost.
:func:`error_descriptor` is standard error in any case, for what must be seen at once.
"""

import contextlib
import os
import re
import sys
import threading
from collections.abc import Iterator

from ..system import file_in_memory

_PANIC = re.compile(rb"\n?thread '[^\n]*panicked at.*", re.DOTALL)
"""A report of Rust's, to the end: the source line, the reason, and often the stack."""
_lock = threading.Lock()
_blocks = 0
_kept = 2
_file = -1


def error_descriptor() -> int:
    """The descriptor of standard error."""
    return _kept


@contextlib.contextmanager
def without_panics() -> Iterator[None]:
    """Within the block nothing reaches standard error; at its end reports of panics are dropped, and the rest is written."""
    held = _begin()
    try:
        yield
    finally:
        if held:
            _end()


def _begin() -> bool:
    global _blocks, _kept, _file
    with _lock:
        if _blocks == 0:
            try:
                if sys.stderr is not None:
                    sys.stderr.flush()
                kept = os.dup(2)
            except (OSError, ValueError):  # standard error is closed
                return False
            file = file_in_memory("standard error")
            if file is None:  # elsewhere than on Linux the report is seen
                os.close(kept)
                return False
            _file = file
            os.dup2(_file, 2)
            _kept = kept
        _blocks += 1
    return True


def _end() -> None:
    global _blocks, _kept, _file
    with _lock:
        _blocks -= 1
        if _blocks:
            return
        if sys.stderr is not None:
            with contextlib.suppress(OSError, ValueError):
                sys.stderr.flush()
        os.dup2(_kept, 2)
        os.close(_kept)
        _kept = 2
        os.lseek(_file, 0, os.SEEK_SET)
        text = b"".join(iter(lambda: os.read(_file, 1 << 16), b""))
        os.close(_file)
        if text := _PANIC.sub(b"", text):
            with contextlib.suppress(OSError):
                os.write(2, text)
