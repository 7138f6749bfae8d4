"""What the stages of a frame cost, found out without stopping them.

In software OpenGL, where queries of compute passes are wrong, by the clock around a finished stage.  On a GPU by timer queries,
two sets in turn: a frame's are read when somebody asks, at the latest before the second frame after it begins.
"""

from collections.abc import Callable
from time import perf_counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import moderngl

HOST_STAGES = ("cull",)
"""Timed by the clock everywhere."""

Told = Callable[[], float]
"""Tells milliseconds, waiting for what took them."""


class Times:
    """Of one frame.  begun, submitted: seconds by the clock, of the call that made it.

    host: milliseconds by stage until it was handed to the device; in software, until it was finished.
    """

    def __init__(self, clock: Callable[[], float]):
        self._clock = clock
        self.host: dict[str, float] = {}
        self._device: dict[str, Told] = {}
        self._milliseconds: dict[str, float] | None = None
        self.begun = self.submitted = self._known = clock()
        self._device_ms = self._later_ms = 0.0

    def add(self, stage: str, milliseconds: float) -> None:
        """Adds a stage that ran elsewhere after the frame was submitted: the network on its own thread."""
        self.host[stage] = milliseconds
        self._later_ms += milliseconds
        if self._milliseconds is not None:
            self._milliseconds[stage] = milliseconds

    def note(self, stage: str, host_ms: float, device_ms: Told | None) -> None:
        """What a stage took on the host, and what will tell, waiting for it, how long on the device."""
        self.host[stage] = host_ms
        if device_ms is not None:
            self._device[stage] = device_ms

    def milliseconds(self) -> dict[str, float]:
        """By stage, on the device that runs it; waits for the GPU."""
        if self._milliseconds is None:
            device = {stage: told() for stage, told in self._device.items()}
            self._device_ms, self._known = sum(device.values()), self._clock()
            self._milliseconds = {**self.host, **device}
        return self._milliseconds

    def total(self) -> float:
        """Milliseconds from the call until the pictures were there; waits for them.

        On a GPU never less than that, and no more where it is asked for at once: the device may begin while the host goes on,
        and what is known later is only that it took no longer than one after the other.
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
        """Starts a frame, whose ``times`` are new ones."""
        self._queries.reverse()
        self._frames.reverse()
        if self._frames[0] is not None:
            self._frames[0].milliseconds()  # its queries are used again
        self._frames[0] = self.times = Times(self._clock)

    def run(self, name: str, work: Callable[[], Told | None]) -> None:
        """Runs ``work`` as the stage ``name``.  What it returns, if anything, tells its milliseconds: of what CUDA does OpenGL
        need not see more than that later work waits."""
        begun, told = self._clock(), None
        if self._software:
            work()
            self._context.finish()
        elif name in HOST_STAGES:
            work()
        else:
            with (query := self._query(name)):
                made = work()
            told = made or (lambda: query.elapsed / 1e6)
        self.times.note(name, (self._clock() - begun) * 1e3, told)

    def _query(self, name: str) -> "moderngl.Query":
        mine = self._queries[0]
        if name not in mine:
            spare = _spare(self._context)
            mine[name] = spare.pop() if spare else self._context.query(time=True)
        return mine[name]

    def end(self) -> None:
        """Ends the frame.  On a GPU the pictures may still be in the making."""
        self.times.submitted = self._clock()

    def release(self) -> None:
        """Leaves its queries to others."""
        for mine in self._queries:
            if mine:
                _spare(self._context).extend(mine.values())
                mine.clear()
        self._frames = [None, None]


def _spare(context: "moderngl.Context") -> "list[moderngl.Query]":
    """Queries that no renderer of a context uses any more: moderngl cannot free them.  They are kept with the context."""
    if context.extra is None:
        context.extra = []
    return context.extra
