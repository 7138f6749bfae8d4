"""Signals that stop a command: Ctrl-C, and SIGTERM where the command line treats it as Ctrl-C (viewer/__main__.py)."""

import contextlib
import os
import signal
from collections.abc import Callable, Iterable, Iterator

STOPS = (signal.SIGINT, signal.SIGTERM)
"""Signals that stop a command."""


@contextlib.contextmanager
def handled(stops: Iterable[signal.Signals], by: Callable) -> Iterator[None]:
    """Within the block ``by`` handles these signals; the previous handlers are restored at its end."""
    with contextlib.ExitStack() as stack:
        for stop in stops:
            stack.callback(signal.signal, stop, signal.getsignal(stop))
            signal.signal(stop, by)
        yield


@contextlib.contextmanager
def importing() -> Iterator[None]:
    """Within the block, which only imports, Ctrl-C or SIGTERM ends the process at once with one line and exit code 130.

    A KeyboardInterrupt raised during an import is lost in some compiled modules, which then fail with another error, and makes
    torch crash.
    """
    with handled([stop for stop in STOPS if signal.getsignal(stop) == signal.default_int_handler], _exit):
        yield


def _exit(_number: int, _frame) -> None:
    os.write(2, b"pointglass: stopped\n")
    os._exit(130)
