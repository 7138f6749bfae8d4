"""A short flight from one camera to another, eased at both ends.  Pure functions of time: no window, no clock.

Frame: file coordinates.
"""

from dataclasses import dataclass, replace

import numpy as np

from .navigation import FlyState

SECONDS = 0.8
"""Duration of a flight to a place that was clicked: below the 1 s that interrupts thought (Nielsen 1993).  Where it halves the
distance to a wall, the edge of a 1280 pixel picture moves at most 1000 pixels a second, 25 degrees a second on a screen of 96
dpi at 60 cm; the eye follows up to some 30 (LaValle, Virtual Reality, 5.3).  Half the duration would double that."""


@dataclass(frozen=True, eq=False)
class Glide:
    """start, end: cameras with the same direction that is up.  seconds: how long it takes, above 0."""

    start: FlyState
    end: FlyState
    seconds: float = SECONDS

    def at(self, elapsed: float) -> FlyState:
        """The camera ``elapsed`` seconds after the start; at rest, with the end's flying speed.

        Position on a straight line, yaw the shorter way round; velocity and acceleration are zero at both ends.
        """
        if elapsed >= self.seconds:
            return self.end
        t = max(elapsed, 0.0) / self.seconds
        share = t * t * t * (t * (6.0 * t - 15.0) + 10.0)  # smootherstep (Perlin 2002)
        turn = (self.end.yaw - self.start.yaw + np.pi) % (2 * np.pi) - np.pi
        return replace(
            self.end, position=self.start.position + share * (self.end.position - self.start.position),
            yaw=float((self.start.yaw + share * turn + np.pi) % (2 * np.pi) - np.pi),
            pitch=float(self.start.pitch + share * (self.end.pitch - self.start.pitch)), velocity=np.zeros(3),
        )  # fmt: skip
