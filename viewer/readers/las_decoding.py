"""The errors that laspy and lazrs raise for damaged files, as one line for a person."""

import os
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from ..errors import InputError

_DAMAGE_ERRORS = (OSError, ValueError, TypeError, LookupError, ArithmeticError, EOFError, MemoryError, struct.error)
"""What laspy raises, besides its own errors, where a header or a record is damaged."""


@contextmanager
def decoding(failed: Callable[[str], InputError]) -> Iterator[None]:
    """Turns the errors that laspy and lazrs raise for damaged files into ``failed(first line)``; others are bugs."""
    from laspy.errors import LaspyException

    lazrs: Any = import_module("lazrs")
    try:
        yield
    except (LaspyException, lazrs.LazrsError, *_DAMAGE_ERRORS) as error:
        raise failed(_line(error)) from None
    except BaseException as error:
        if type(error).__name__ != "PanicException":  # of Rust, for damage inside a chunk; the class is not exported
            raise
        raise failed(_line(error)) from None


@contextmanager
def without_native_output() -> Iterator[None]:
    """Within the block nothing that native code writes to standard error is seen: Rust reports a panic there, which becomes an
    error here.  For blocks of milliseconds; other threads' messages are lost as well."""
    try:
        kept = os.dup(2)
    except OSError:  # closed
        yield
        return
    if sys.stderr is not None:
        sys.stderr.flush()
    try:
        with open(os.devnull, "wb") as nothing:
            os.dup2(nothing.fileno(), 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)


def _line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:120]
