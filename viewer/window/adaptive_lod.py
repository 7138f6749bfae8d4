"""What a moving picture leaves out so that it keeps up with the hand, and how the picture at rest gets it back.

While the camera moves: fewer points a pixel where drawing them all is slow, the filled view where the network is slow, and
no cells that lay hidden in the frame before.  At rest: four times the points, again and again, until nothing is left out
or the next step would take too long to wait for.  Nothing here knows a clock or a window; it learns from ``Frame.stats``.
Levels of detail: points a pixel, None where every point is drawn.
"""

from math import log2

MOVING_MS = 40.0
"""Milliseconds that choosing and drawing points may take while the camera moves."""
REST_MS = 2000.0
"""The same for one picture at rest."""
SLOW_NETWORK = 150.0
"""Milliseconds of network a frame from which on flying shows the filled view, and the neural one at rest."""
MANY_POINTS = 20_000_000
"""Points of a scene from which on the first picture is a coarse one."""
FINEST, COARSEST = 16.0, 0.5
"""Points a pixel while moving: at sixteen the soft z-buffer has more than it can show, under a half holes open."""
LEAST_HIDDEN = 0.25
"""Share of the points that must be hidden for looking after it to pay."""
_PATIENCE = 60  # frames until what did not pay is tried again
_STEP = 4.0  # at rest
_ALL = 1024.0  # points a pixel that no scan has


class AdaptiveLod:
    """keep_up: whether anything may be left out while moving."""

    def __init__(self) -> None:
        self.keep_up = True
        self.begin(0)

    def begin(self, points: int) -> None:
        """A scene of so many points is shown now."""
        self._moving: float | None = 1.0 if points > MANY_POINTS else None
        self._rest = self._moving
        self._points = -1
        self._network = 0.0
        self._idle = self._looked = self._stay = 0
        self._floor = COARSEST
        self._before: tuple[float | None, int, float] | None = None

    def jump(self) -> None:
        """The camera is elsewhere, or the settings are others: at rest one step from what a moving picture has."""
        self._rest, self._points = None if self._moving is None else _STEP * self._moving, -1

    def level(self, *, moving: bool) -> float | None:
        """The level of detail to draw with now."""
        if not self.keep_up:
            return None
        return self._moving if moving else self._rest

    def hides(self, *, moving: bool) -> bool:
        """Whether cells hidden in the last frame are to be left out."""
        return moving and self.keep_up and self._idle == 0

    def stand_in(self, view: str, *, moving: bool, resizing: bool = False) -> str:
        """The view drawn for ``view``: ``filled`` for ``neural`` while flying where the network is slow, and while the
        window's size changes, since the network is made ready for one size."""
        slow = resizing or (moving and self._network > SLOW_NETWORK)
        return "filled" if view == "neural" and slow and self.keep_up else view

    def drew(self, level: float | None, stats: dict, *, moving: bool) -> None:
        """Learns from a picture made at a level of detail: that of ``level``, or a coarser one that a person chose."""
        stages = stats["stages"]
        self._network = stages.get("network", self._network)
        spent = stages.get("cull", 0.0) + max(stages.get("raster", 0.0), stats["host"].get("raster", 0.0))
        if moving:
            self._drew_moving(level, spent, stats)
            return
        self._looked = 0
        if level == self._rest and not stats.get("points_missing"):  # what is still coming would be drawn for nothing so often
            self._drew_at_rest(spent, stats["points_drawn"])

    def _drew_moving(self, level: float | None, spent: float, stats: dict) -> None:
        points, before = stats["points_drawn"], self._before
        if before is not None and points < 0.7 * before[1] and spent > 0.8 * before[2]:
            self._floor, self._stay = before[0], _PATIENCE  # it is not the points that take the time
            self._moving = before[0]
        elif spent > 1.5 * MOVING_MS:
            halvings = min(max(round(log2(spent / MOVING_MS)), 1), 3)  # far too slow is put right in few frames
            self._moving = FINEST if level is None else max(min(level / 2**halvings, FINEST), self._floor)
        elif self._moving is not None and spent < MOVING_MS / 4:
            self._moving = min(2 * self._moving, FINEST)
        coarser = level is not None and self._moving is not None and self._moving < level
        self._before = (level, points, spent) if coarser else None
        self._stay = max(0, self._stay - 1)
        if self._stay == 0:
            self._floor = COARSEST
        self.jump()
        self._idle = max(0, self._idle - 1)
        self._looked = self._looked + 1 if "occlusion" in stats else 0
        if self._looked > 1:  # the first knows of nothing that hides
            hidden = stats["occlusion"]["points_hidden"]
            if hidden < LEAST_HIDDEN * (hidden + stats["points_drawn"]):
                self._idle, self._looked = _PATIENCE, 0

    def _drew_at_rest(self, spent: float, points: int) -> None:
        if self._rest is None:
            if spent < MOVING_MS:
                self._moving = None  # every point can keep up
            elif self._moving is None and spent > 1.5 * MOVING_MS:
                self._moving = FINEST
            return
        if _STEP * spent > REST_MS:
            return
        finer = _STEP * self._rest
        self._rest = None if points == self._points or finer > _ALL else finer
        self._points = points
