"""The errors that laspy and lazrs raise for damaged files, as one line for a person."""

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

from ....model.common.process.native_output import without_panics
from ...common.errors import InputError

_DAMAGE_ERRORS = (OSError, ValueError, TypeError, LookupError, ArithmeticError, EOFError, MemoryError, struct.error)
"""What laspy raises, besides its own errors, where a header or a record is damaged."""


@contextmanager
def decoding(failed: Callable[[str], InputError]) -> Iterator[None]:
    """Turns the errors that laspy and lazrs raise for damaged files into ``failed(first line)``; others are bugs.

    Not around a ``yield`` of a generator: standard error is held back within the block.
    """
    from laspy.errors import LaspyException

    lazrs: Any = import_module("lazrs")
    try:
        with without_panics():
            yield
    except (LaspyException, lazrs.LazrsError, *_DAMAGE_ERRORS) as error:
        raise failed(_line(error)) from None
    except BaseException as error:
        if type(error).__name__ != "PanicException":  # of Rust, for damage inside a chunk; the class is not exported
            raise
        raise failed(_line(error)) from None


def _line(error: BaseException) -> str:
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:120]
