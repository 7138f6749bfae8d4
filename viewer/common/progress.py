"""Progress of long work: a bar on a terminal, a line every few seconds in a pipe, and a sink for the window.

A window runs loading on a worker thread and installs a sink for that thread; the sink sees every update and may
return False to cancel, which raises :class:`viewer.common.errors.Cancelled` inside the work, where clean-up handlers run.
"""

import contextlib
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import monotonic

from .errors import Cancelled
from .text import printable

Sink = Callable[[str, int, int], bool]
"""Called with (label, done, total); total is 0 where it is not known.  Returns False to cancel."""

_FIRST_LINE, _NEXT_LINE = 10.0, 5.0
"""Seconds until the first line in a pipe, so that short work is silent, and between lines.  A person attends to a task without
an answer for 10 s (Nielsen 1993).  Lines come with updates: half of that between them keeps the limit where an update takes 5
s."""
_TELLING = 3
"""Updates after the first, from which the time left is told; one where a tenth is done.  The first is left out of the speed:
shaders and loops are compiled in it, and 119 views of 1 s each seemed to take two hours."""
_local = threading.local()


def set_sink(sink: Sink | None) -> None:
    """Installs (or with None removes) the sink of the calling thread."""
    _local.sink = sink


class Progress:
    """Counts units of work.  ``update(n)`` adds n; made by :func:`progress`.

    bar: tqdm's.  sink: the window's.  unit: of the lines that are written to a pipe, None where there are none.
    """

    def __init__(self, total: int, label: str, bar, sink: Sink | None, unit: str | None = None):
        self.total, self.label, self.done = int(total), label, 0
        self._bar, self._sink, self._unit, self._said = bar, sink, unit, ""
        self._start = monotonic()
        self._next_line = self._start + _FIRST_LINE
        self._first: tuple[float, int] | None = None  # when the first update came, and what was done then
        self._updates = 0  # after the first

    def update(self, n: int) -> None:
        """Adds ``n`` finished units.  Raises Cancelled if the sink asks to stop."""
        self.done += int(n)
        if self._first is not None:
            self._updates += n > 0
        elif self.done:
            self._first = monotonic(), self.done
        if self._bar is not None:
            self._bar.update(int(n))
        self._ask()
        self._write_line()

    def _ask(self) -> None:
        if self._sink is not None and not self._sink(self._label(), self.done, self.total):
            raise Cancelled(f"{self.label}: cancelled")

    def _write_line(self) -> None:
        finished = 0 < self.total <= self.done
        if self._unit is not None and not finished and (now := monotonic()) >= self._next_line:
            self._next_line = now + _NEXT_LINE
            with contextlib.suppress(OSError, ValueError):  # whoever read standard error has gone
                print(f"pointglass: {self._line(now - self._start)}", file=sys.stderr, flush=True)

    def say(self, text: str) -> None:
        """Sets what is shown after the label: which of several tasks are under way, and how far they are; "" where that is not
        known.  Raises Cancelled if the sink asks to stop."""
        if text != self._said:
            self._said = text
            if self._bar is not None:
                self._bar.set_description_str(printable(self._label()))
        self._ask()
        if text:
            self._write_line()

    def _label(self) -> str:
        return f"{self.label} ({self._said})" if self._said else self.label

    def _line(self, seconds: float) -> str:
        """"rendering: 37 of 200 pictures (18 %), about 1 min 12 s left"."""
        unit = f" {self._unit}" if self._unit else ""
        if not 0 < self.done < self.total:
            of_all = f" of {self.total:,}" if self.total > 1 and not self.done else ""
            counts = f": {self.done:,}{of_all}{unit}" if self.done or (of_all and unit) else ""
            return printable(f"{self._label()}{counts}, {duration_text(seconds)} so far")
        left = self._left()
        times = f"{duration_text(seconds)} so far" if left is None else f"about {duration_text(left)} left"
        share = 100 * self.done // self.total
        return printable(f"{self._label()}: {self.done:,} of {self.total:,}{unit} ({share} %), {times}")

    def _left(self) -> float | None:
        """Seconds, at the speed since the first update; None where that is not known well enough."""
        if self._first is None or self._updates < (1 if 10 * self.done >= self.total else _TELLING):
            return None
        since, done = self._first
        return (monotonic() - since) * (self.total - self.done) / (self.done - done)


def duration_text(seconds: float) -> str:
    """"8 s", "1 min 12 s", "3 h 20 min"."""
    whole = max(1, round(seconds))
    if whole < 60:
        return f"{whole} s"
    if whole < 3600:
        return f"{whole // 60} min {whole % 60} s"
    return f"{whole // 3600} h {whole % 3600 // 60} min"


@contextmanager
def named_progress(name: str) -> Iterator[None]:
    """Labels of progress on this thread begin with ``name``: which of several files it is of."""
    before = getattr(_local, "name", "")
    _local.name = f"{before}{name}: "
    try:
        yield
    finally:
        _local.name = before


@contextmanager
def progress(total: int, label: str, unit: str = "") -> Iterator[Progress]:
    """A progress meter over ``total`` units (0: unknown) with a plain-words ``label``."""
    sink, label = getattr(_local, "sink", None), getattr(_local, "name", "") + label
    bar, lines = None, None
    if sink is None and sys.stderr is not None and not sys.stderr.isatty():
        lines = unit.strip()
        lines += "s" if lines and not lines.endswith("s") else ""
    elif sink is None and sys.stderr is not None:
        from tqdm import tqdm

        bar = tqdm(total=total or None, desc=label, unit=unit, unit_scale=True, leave=False, file=sys.stderr)
    try:
        yield Progress(total, label, bar, sink, lines)
    finally:
        if bar is not None:
            bar.close()


@contextmanager
def share_unknown() -> Iterator[None]:
    """Around short work before that which takes long: the window is told what is done and can cancel it, but no share, so that
    its bar only grows."""
    sink: Sink | None = getattr(_local, "sink", None)
    if sink is not None:
        set_sink(lambda label, _done, _total: sink(label, 0, 0))
    try:
        yield
    finally:
        set_sink(sink)


@contextmanager
def stage(label: str) -> Iterator[None]:
    """A part of long work whose length is not known, with a plain-words ``label``.  Raises Cancelled at its beginning if the
    sink asks to stop."""
    with progress(0, label) as meter:
        meter.update(0)
        yield
