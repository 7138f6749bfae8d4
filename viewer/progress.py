"""Progress of long work: a bar on a terminal, silence in a pipe, and a sink for the window.

A window runs loading on a worker thread and installs a sink for that thread; the sink sees every update and may
return False to cancel, which raises :class:`viewer.errors.Cancelled` inside the work, where clean-up handlers run.
"""

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from .errors import Cancelled

Sink = Callable[[str, int, int], bool]
"""Called with (label, done, total); total is 0 where it is not known.  Returns False to cancel."""

_local = threading.local()


def set_sink(sink: Sink | None) -> None:
    """Installs (or with None removes) the sink of the calling thread."""
    _local.sink = sink


class Progress:
    """Counts units of work.  ``update(n)`` adds n; made by :func:`progress`."""

    def __init__(self, total: int, label: str, bar, sink: Sink | None):
        self.total, self.label, self.done = int(total), label, 0
        self._bar, self._sink = bar, sink

    def update(self, n: int) -> None:
        """Adds ``n`` finished units.  Raises Cancelled if the sink asks to stop."""
        self.done += int(n)
        if self._bar is not None:
            self._bar.update(int(n))
        if self._sink is not None and not self._sink(self.label, self.done, self.total):
            raise Cancelled(f"{self.label}: cancelled")


@contextmanager
def progress(total: int, label: str, unit: str = "") -> Iterator[Progress]:
    """A progress meter over ``total`` units (0: unknown) with a plain-words ``label``."""
    sink = getattr(_local, "sink", None)
    bar = None
    if sink is None and sys.stderr.isatty():
        from tqdm import tqdm

        bar = tqdm(total=total or None, desc=label, unit=unit, unit_scale=True, leave=False, file=sys.stderr)
    try:
        yield Progress(total, label, bar, sink)
    finally:
        if bar is not None:
            bar.close()
