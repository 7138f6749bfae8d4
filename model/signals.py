"""What stops a command: Ctrl-C, and SIGTERM where the command line takes it for one (viewer/__main__.py)."""

import contextlib
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
