"""Pairs of points that a person clicks: a point of the scan that moves, and the same place in another scan, either first.

The point of the moving scan is kept in the coordinates of its own file, so that it stays on its scan when that is moved.
Frame: own coordinates of the moving file, and document coordinates of the others; float64, file units.
"""

from dataclasses import dataclass, field

import numpy as np

from ....common.errors import InputError
from ....common.rigid_transform import Rows, inverse, moved_points
from ....work.registration.point_pairs import LEAST, PairFit, fit_pairs


@dataclass(eq=False)
class Pairs:
    """moving: own coordinates, (3,) each.  fixed: document coordinates of their partners.
    begun: the first point of a pair, None while none is begun: whether it is of the moving scan, and its place, own or
    document coordinates."""

    moving: list[np.ndarray] = field(default_factory=list)
    fixed: list[np.ndarray] = field(default_factory=list)
    begun: tuple[bool, np.ndarray] | None = None

    @property
    def count(self) -> int:
        """Pairs that are complete."""
        return len(self.fixed)

    def takes(self, of_moving: bool) -> bool:
        """Whether a point of the moving scan, or of another, can be added now."""
        return self.begun is None or self.begun[0] != of_moving

    def add(self, of_moving: bool, place: np.ndarray, transform: Rows) -> None:
        """A point was clicked, (3,) document coordinates.  transform: of the moving scan now."""
        place = own(place, transform) if of_moving else place
        if self.begun is None:
            self.begun = of_moving, place
            return
        first, self.begun = self.begun[1], None
        self.moving.append(place if of_moving else first)
        self.fixed.append(first if of_moving else place)

    def correct(self, before: np.ndarray, after: np.ndarray, transform: Rows) -> None:
        """The exact place of a point is known; ``before``: as it was added."""
        was, now = own(before, transform), own(after, transform)
        self.moving = [now if np.array_equal(point, was) else point for point in self.moving]
        self.fixed = [after if np.array_equal(point, before) else point for point in self.fixed]
        if self.begun is not None and np.array_equal(self.begun[1], was if self.begun[0] else before):
            self.begun = self.begun[0], now if self.begun[0] else after

    def drop_last(self) -> bool:
        """Takes the last click back.  Returns whether there was one."""
        if self.begun is not None:
            self.begun = None
        elif self.moving:
            self.begun = True, self.moving.pop()
            self.fixed.pop()
        else:
            return False
        return True

    def drop(self, number: int) -> None:
        """Takes a pair away."""
        del self.moving[number], self.fixed[number]

    def clear(self) -> None:
        """Takes all away: another scan is to be moved."""
        self.moving, self.fixed, self.begun = [], [], None

    def fit(self) -> PairFit | str | None:
        """What the pairs give, or in words why they give nothing; None where there are too few."""
        if self.count < LEAST:
            return None
        try:
            return fit_pairs(np.array(self.moving), np.array(self.fixed))
        except InputError as error:
            return str(error)


def own(place: np.ndarray, transform: Rows) -> np.ndarray:
    """(3,): a place in the coordinates of the moving file."""
    return moved_points(inverse(transform), place[None])[0]
