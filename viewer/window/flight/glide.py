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
        share = eased(elapsed / self.seconds)
        turn = (self.end.yaw - self.start.yaw + np.pi) % (2 * np.pi) - np.pi
        return replace(
            self.end, position=self.start.position + share * (self.end.position - self.start.position),
            yaw=float((self.start.yaw + share * turn + np.pi) % (2 * np.pi) - np.pi),
            pitch=float(self.start.pitch + share * (self.end.pitch - self.start.pitch)), velocity=np.zeros(3),
        )  # fmt: skip


TURN_SECONDS = 0.45
"""Duration of a turn about a point: half of a flight's, because what is looked at stays in place."""


def eased(t: float) -> float:
    """Smootherstep (Perlin 2002) of a share of the time, 0 to 1."""
    t = min(max(t, 0.0), 1.0)
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0)


@dataclass(frozen=True, eq=False)
class Turn:
    """A turn about a point, which moves straight across the picture from where it was seen to where it will be.

    pivot: (3,).  scales: of an orthographic camera, its distances at both ends; None of a pinhole.
    """

    start: FlyState
    end: FlyState
    pivot: np.ndarray
    scales: tuple[float, float] | None = None
    seconds: float = TURN_SECONDS

    def at(self, elapsed: float) -> FlyState:
        """The camera ``elapsed`` seconds after the start."""
        if elapsed >= self.seconds:
            return self.end
        share = eased(elapsed / self.seconds)
        turn = (self.end.yaw - self.start.yaw + np.pi) % (2 * np.pi) - np.pi
        state = replace(self.end, yaw=float((self.start.yaw + share * turn + np.pi) % (2 * np.pi) - np.pi),
                        pitch=float(self.start.pitch + share * (self.end.pitch - self.start.pitch)), velocity=np.zeros(3))
        first, last = (each.camera_to_world[:3, :3].T @ (self.pivot - each.position) for each in (self.start, self.end))
        return replace(state, position=self.pivot - state.camera_to_world[:3, :3] @ (first + share * (last - first)))

    def scale_at(self, elapsed: float) -> float | None:
        """The distance of the scale ``elapsed`` seconds after the start; it changes by equal factors in equal shares."""
        if self.scales is None:
            return None
        first, last = self.scales
        return last if elapsed >= self.seconds else first * (last / first) ** eased(elapsed / self.seconds)
