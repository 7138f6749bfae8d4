"""What stops a command: Ctrl-C, and SIGTERM where the command line takes it for one (viewer/__main__.py)."""

import contextlib
import os
import signal
from collections.abc import Callable, Iterable, Iterator

STOPS = (signal.SIGINT, signal.SIGTERM)


@contextlib.contextmanager
def handled(stops: Iterable[signal.Signals], by: Callable) -> Iterator[None]:
    """Within the block ``by`` gets these signals; after it, whatever comes in between, who had each of them before."""
    with contextlib.ExitStack() as stack:
        for stop in stops:
            stack.callback(signal.signal, stop, signal.getsignal(stop))
            signal.signal(stop, by)
        yield


@contextlib.contextmanager
def importing() -> Iterator[None]:
    """Within the block, in which nothing is begun yet, Ctrl-C or SIGTERM ends the process at once, and says so.

    For imports: raised, it is lost in some of compiled modules, which fail with a word of their own then, and in torch's it
    is a crash.
    """
    with handled([stop for stop in STOPS if signal.getsignal(stop) == signal.default_int_handler], _leave):
        yield


def _leave(_number: int, _frame) -> None:
    os.write(2, b"pointglass: stopped\n")
    os._exit(130)
