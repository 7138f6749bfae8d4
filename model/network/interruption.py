"""Interrupts a network between two of its layers, where its picture is not needed any more.

A thread says what may interrupt it with :func:`interruptible`; the layers of a network ask with :func:`check`.  Nothing else is
affected: other threads may run the same network meanwhile.
"""

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

_of_thread = threading.local()


class Interrupted(Exception):
    """The picture is not needed any more; the run has ended without a result."""


@contextmanager
def interruptible(needless: Callable[[], bool]) -> Iterator[None]:
    """Within the block, :func:`check` raises Interrupted on this thread as soon as ``needless`` returns True."""
    _of_thread.needless = needless
    try:
        yield
    finally:
        _of_thread.needless = None


def check(*_: object) -> None:
    """Raises Interrupted where this thread's work is needless.  Takes and ignores what torch hands to a hook of a layer."""
    needless = getattr(_of_thread, "needless", None)
    if needless is not None and needless():
        raise Interrupted
