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

    def __call__(self, name: str) -> "Stage":
        """``with stages("fill"): ...`` runs the block as the stage ``fill``."""
        return Stage(self, name)

    def start(self, stage: "Stage") -> None:
        """Begins a stage: on a GPU, and not on the host, inside a query."""
        stage.begun = self._clock()
        if not self._software and stage.name not in HOST_STAGES:
            stage.query = self._query(stage.name)
            stage.query.__enter__()

    def stop(self, stage: "Stage", *, failed: bool) -> None:
        """Ends a stage, and notes what it took unless it failed."""
        if (query := stage.query) is not None:
            query.__exit__()  # type: ignore[call-arg]
        if failed:
            return
        if self._software:
            self._context.finish()
        elapsed = None if query is None else stage.elapsed or (lambda: query.elapsed / 1e6)
        self.times.note(stage.name, (self._clock() - stage.begun) * 1e3, elapsed)

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


class Stage:
    """One stage while it runs.  elapsed: where it is set inside the block, a function that gives the milliseconds instead of a
    query of OpenGL, which does not see CUDA's work."""

    __slots__ = ("_stages", "begun", "elapsed", "name", "query")

    def __init__(self, stages: Stages, name: str):
        self._stages, self.name, self.begun = stages, name, 0.0
        self.query: moderngl.Query | None = None
        self.elapsed: Elapsed | None = None

    def __enter__(self) -> "Stage":
        self._stages.start(self)
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        self._stages.stop(self, failed=kind is not None)


def _spare(context: "moderngl.Context") -> "list[moderngl.Query]":
    """The pool of a context's unused queries, kept with the context: moderngl cannot free them."""
    if context.extra is None:
        context.extra = []
    return context.extra
