"""Pictures per second over the last few pictures."""

from collections import deque

_KEPT = 20
"""Intervals that the rate is the mean of."""
_PAUSE = 1.0
"""Seconds between two pictures from which on they do not belong to one movement."""


class FrameRate:
    """Learns when each picture was made.  Times: seconds of any steady clock."""

    def __init__(self) -> None:
        self._intervals: deque[float] = deque(maxlen=_KEPT)
        self._last = float("-inf")

    def add(self, now: float) -> None:
        """A picture was made."""
        if now - self._last < _PAUSE:
            self._intervals.append(now - self._last)
        else:
            self._intervals.clear()
        self._last = now

    def clear(self) -> None:
        """What was measured belongs to another scene."""
        self._intervals.clear()

    @property
    def per_second(self) -> float | None:
        """The mean rate; None before the second picture of a movement."""
        return len(self._intervals) / max(sum(self._intervals), 1e-9) if self._intervals else None
