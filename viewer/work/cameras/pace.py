"""The pace of a film: how far along its path the camera is at each time.

Without anything else it is constant.  The camera may stay at keyframes, which it then reaches and leaves slowly, and may begin
and end slowly.  The film keeps its length: between two stops the camera moves faster by as much.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

RAMP = 1.0
"""Seconds that the camera takes from standing to its full speed, at most a third of the way to the next stop: a move that
begins faster looks like a jolt."""
_MOST_STILL = 0.9
"""Share of a film that stays may take; longer ones are shortened alike."""


@dataclass(frozen=True)
class Pace:
    """seconds: of the whole film, above 0.  stays: seconds at each keyframe, () for none; those of more keyframes than are
    given are 0.  ease: whether the film begins and ends slowly."""

    seconds: float
    stays: tuple[float, ...] = ()
    ease: bool = False

    @property
    def constant(self) -> bool:
        """Whether the camera moves at one speed throughout."""
        return not (self.ease or any(stay > 0 for stay in self.stays))

    @property
    def shortened(self) -> str:
        """In words, that the stays are shortened; "" where they are not."""
        most, asked = _MOST_STILL * self.seconds, sum(self.stays)
        return f"stays of {asked:g} s in a film of {self.seconds:g} s are shortened to {most:.3g} s" if asked > most else ""

    def shares(self, times: np.ndarray, passing: np.ndarray) -> np.ndarray:
        """(N,) share of the path's length, 0 to 1, at each of (N,) times.  passing: (K,) share at each keyframe, increasing."""
        times, found = np.asarray(times, np.float64), np.zeros(len(times))
        for begin, end, low, high, slow_in, slow_out in self._moves(np.asarray(passing, np.float64)):
            inside = (times >= begin) & (times <= end)
            since, left = times[inside] - begin, end - times[inside]
            speed = (high - low) / max(end - begin - (slow_in + slow_out) / 2, 1e-300)
            found[inside] = np.select(
                [since < slow_in, left < slow_out],
                [low + speed * since**2 / (2 * max(slow_in, 1e-300)), high - speed * left**2 / (2 * max(slow_out, 1e-300))],
                low + speed * (since - slow_in / 2))  # fmt: skip
            found[times > end] = high
        return np.clip(found, 0.0, 1.0)

    def arrivals(self, passing: np.ndarray) -> np.ndarray:
        """(K,) seconds at which the camera reaches each keyframe.  passing: as of :meth:`shares`."""
        passing = np.asarray(passing, np.float64)
        if self.constant or len(passing) < 2:
            return passing * self.seconds
        found = np.zeros(len(passing))
        for begin, end, low, high, slow_in, slow_out in self._moves(passing):
            speed = (high - low) / max(end - begin - (slow_in + slow_out) / 2, 1e-300)
            for number in np.flatnonzero((passing > low) & (passing <= high)):
                way, rest = passing[number] - low, high - passing[number]
                if way < speed * slow_in / 2:
                    found[number] = begin + np.sqrt(2 * way * slow_in / speed)
                elif rest < speed * slow_out / 2:
                    found[number] = end - np.sqrt(2 * rest * slow_out / speed)
                else:
                    found[number] = begin + slow_in / 2 + way / speed
        return found

    def _moves(self, passing: np.ndarray) -> Iterator[tuple[float, float, float, float, float, float]]:
        """Between two stops: begin and end in seconds, the shares there, and the seconds of its slow beginning and end."""
        stays = np.zeros(len(passing))
        stays[: len(self.stays)] = self.stays[: len(passing)]
        stays *= min(1.0, _MOST_STILL * self.seconds / max(stays.sum(), 1e-300))
        moving, last = self.seconds - stays.sum(), len(passing) - 1
        stops = [0, *(np.flatnonzero(stays[1:-1] > 0) + 1).tolist(), last]
        now = stays[0]
        for a, b in pairwise(stops):
            low, high = passing[a], passing[b]
            takes = moving * (high - low)
            slow = min(RAMP, takes / 3)
            slow_in = slow if stays[a] > 0 or (self.ease and a == 0) else 0.0
            slow_out = slow if stays[b] > 0 or (self.ease and b == last) else 0.0
            yield now, now + takes, low, high, slow_in, slow_out
            now += takes + stays[b]
