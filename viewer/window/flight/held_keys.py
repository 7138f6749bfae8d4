"""The keys that are held down to fly, and those that came up within a frame: a long frame takes press and release together, or
sees the key up only at its end, and what was asked for between is flown all the same.

GLFW tells no times of keys.  A key that was held when the frame began came up somewhere in it: on average at its half.  One
that was pressed in it, too, was held for a third of it, the mean distance of two random moments.
"""

from collections.abc import Iterable

TAP = 0.1
"""Seconds that a key counts as held at most where it was pressed and released within a frame: about as long as a typed key."""


class HeldKeys(set[str]):
    """Actions of the keys held down.  ``discard``: the key came up.  ``clear``: all are forgotten, and nothing is flown for
    them."""

    def __init__(self, actions: Iterable[str] = ()):
        super().__init__(actions)
        self._before: frozenset[str] = frozenset()
        self._released: set[str] = set()

    def discard(self, element: object) -> None:
        if isinstance(element, str) and element in self:
            self._released.add(element)
        super().discard(element)

    def clear(self) -> None:
        super().clear()
        self._released.clear()

    @property
    def asked(self) -> set[str]:
        """Actions held now or since the last call of ``spans``."""
        return self | self._released

    def spans(self, dt: float, since: float) -> list[tuple[set[str], float]]:
        """What was held since the last call, in order, and for how many seconds each.

        dt: seconds to be flown.  since: seconds since the last call, more than dt where the camera was at rest.
        """
        released, before = self._released - self, self._before
        self._before, self._released = frozenset(self), set()
        if not released:
            return [(self, dt)]
        first = dt / 2 if released & before else min(since / 3, TAP)
        return [(self | released, first), (self, max(dt - first, 0.0))]
