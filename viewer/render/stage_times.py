"""Milliseconds of each stage of a frame, measured without stopping the GPU.

In software OpenGL, where timer queries of compute passes are wrong: by the clock around a finished stage.  On a GPU: by timer
queries, two sets in turn.  A frame's queries are read when its times are asked for, at the latest before the second frame after
it begins.
"""

from collections.abc import Callable
from time import perf_counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import moderngl

HOST_STAGES = ("cull",)
"""Stages on the host, timed by the clock on every device."""

Elapsed = Callable[[], float]
"""Returns the elapsed milliseconds; blocks until the GPU has finished."""


class Times:
    """Times of one frame.  begun, submitted: seconds by the clock, of the call that rendered it.

    host: milliseconds by stage until it was handed to the device; in software, until it was finished.
    """

    def __init__(self, clock: Callable[[], float]):
        self._clock = clock
        self.host: dict[str, float] = {}
        self._device: dict[str, Elapsed] = {}
        self._milliseconds: dict[str, float] | None = None
        self.begun = self.submitted = self._known = clock()
        self._device_ms = self._later_ms = 0.0

    def add(self, stage: str, milliseconds: float) -> None:
        """Adds a stage that ran elsewhere after the frame was submitted: the network on its own thread."""
        self.host[stage] = milliseconds
        self._later_ms += milliseconds
        if self._milliseconds is not None:
            self._milliseconds[stage] = milliseconds

    def note(self, stage: str, host_ms: float, device_ms: Elapsed | None) -> None:
        """Records a stage: its milliseconds on the host, and a function that returns those on the device."""
        self.host[stage] = host_ms
        if device_ms is not None:
            self._device[stage] = device_ms

    def milliseconds(self) -> dict[str, float]:
        """By stage, on the device that runs it; waits for the GPU."""
        if self._milliseconds is None:
            device = {stage: elapsed() for stage, elapsed in self._device.items()}
            self._device_ms, self._known = sum(device.values()), self._clock()
            self._milliseconds = {**self.host, **device}
        return self._milliseconds

    def total(self) -> float:
        """Milliseconds from the call until the pictures were there; waits for them.

        On a GPU this is an upper bound, exact where it is asked for at once: the device may start while the host continues, and
        a later question can only add both.
        """
        self.milliseconds()
        host = (self.submitted - self.begun) * 1e3
        if self._device:
            host = max(host, min((self._known - self.begun) * 1e3, host + self._device_ms))
        return host + self._later_ms


class Stages:
    """Times the stages of one frame after the other.  clock: replaceable in tests."""

    def __init__(self, context: "moderngl.Context", *, software: bool, clock: Callable[[], float] = perf_counter):
        self._context, self._software, self._clock = context, software, clock
        self._queries: list[dict[str, moderngl.Query]] = [{}, {}]
        self._frames: list[Times | None] = [None, None]
        self.times = Times(clock)

    def begin(self) -> None:
        """Starts a frame with new ``times``."""
        self._queries.reverse()
        self._frames.reverse()
        if self._frames[0] is not None:
            self._frames[0].milliseconds()  # its queries are reused
        self._frames[0] = self.times = Times(self._clock)

    def run(self, name: str, work: Callable[[], Elapsed | None]) -> None:
        """Runs ``work`` as the stage ``name``.  A function that it returns gives the stage's milliseconds, instead of a query
        of OpenGL, which does not see CUDA's work."""
        begun, elapsed = self._clock(), None
        if self._software:
            work()
            self._context.finish()
        elif name in HOST_STAGES:
            work()
        else:
            with (query := self._query(name)):
                made = work()
            elapsed = made or (lambda: query.elapsed / 1e6)
        self.times.note(name, (self._clock() - begun) * 1e3, elapsed)

    def _query(self, name: str) -> "moderngl.Query":
        mine = self._queries[0]
        if name not in mine:
            spare = _spare(self._context)
            mine[name] = spare.pop() if spare else self._context.query(time=True)
        return mine[name]

    def end(self) -> None:
        """Ends the frame.  A GPU may not have finished its pictures yet."""
        self.times.submitted = self._clock()

    def release(self) -> None:
        """Returns its queries to the context's pool."""
        for mine in self._queries:
            if mine:
                _spare(self._context).extend(mine.values())
                mine.clear()
        self._frames = [None, None]


def _spare(context: "moderngl.Context") -> "list[moderngl.Query]":
    """The pool of a context's unused queries, kept with the context: moderngl cannot free them."""
    if context.extra is None:
        context.extra = []
    return context.extra
