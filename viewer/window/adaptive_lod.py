"""Adaptive level of detail: what a moving picture leaves out to hold a frame time, and how the picture at rest gets it back.

While the camera moves, in this order: a lower internal resolution, fewer points per pixel, the filled view instead of a slow
network; and cells that were hidden in the frame before are skipped.  At rest: four times the points, again and again, until
nothing is left out or the next step would take too long; then the network runs, once.
Nothing here knows a clock or a window; it learns from ``Frame.stats``.  Levels of detail: points per pixel, None draws every
point.
"""

from math import log2

TARGET_GPU_MS, TARGET_CPU_MS = 33.0, 66.0
"""Milliseconds a frame may take while the camera moves: 30 and 15 frames per second."""
POINTS_SHARE = 0.6
"""Share of the target that culling and rasterising points may take; filter and fill need the rest (measured on llvmpipe)."""
REST_MS = 2000.0
"""Milliseconds that culling and rasterising may take for one picture at rest."""
NETWORK_SHARE = 0.5
"""Share of the target up to which the network runs in every moving frame; where it takes longer the filled view is shown."""
MANY_POINTS = 20_000_000
"""Points of a scene from which on the first picture is a coarse one."""
FINEST, COARSEST = 16.0, 0.5
"""Points per pixel while moving: above 16 the soft z-buffer shows no difference, below 0.5 holes open."""
SCALES = (1.0, 0.75, 0.5)
"""Internal resolutions while moving, as a share of each side."""
CONTENDED_LEVEL = 1.0
"""Points per pixel of a moving picture while a network runs on the processors that draw (see :meth:`AdaptiveLod.scale`)."""
LEAST_HIDDEN = 0.25
"""Share of the points that must be hidden for occlusion culling to pay."""
OUTSIDE_WEIGHT = 0.2
"""Weight of the newest picture in the running mean of what is spent outside the renderer."""
_SLOWER = 1.25  # times the target: above it something is left out
_FASTER = 0.9  # times the target: a higher resolution is tried where it is predicted to stay below
_PATIENCE = 60  # frames until what did not pay is tried again
_STEP = 4.0  # at rest
_ALL = 1024.0  # points per pixel that no scan has


class AdaptiveLod:
    """keep_up: whether anything may be left out while moving.  target_ms: frame time to hold while the camera moves."""

    def __init__(self, target_ms: float = TARGET_CPU_MS) -> None:
        self.keep_up = True
        self.target_ms = target_ms
        self._network: float | None = None
        self._outside = 0.0
        self.begin(0)

    def begin(self, points: int) -> None:
        """A scene of so many points is shown now."""
        self._moving: float | None = 1.0 if points > MANY_POINTS else None
        self._rest = self._moving
        self._settled = False
        self._points = -1
        self._scale = 0
        self._idle = self._looked = self._stay = 0
        self._floor = COARSEST
        self._before: tuple[float | None, int, float] | None = None

    def jump(self) -> None:
        """The camera is elsewhere, or the settings changed: at rest refinement starts one step above the moving level."""
        self._rest, self._points = None if self._moving is None else _STEP * self._moving, -1
        self._settled = False

    def level(self, *, moving: bool, contended: bool = False) -> float | None:
        """The level of detail to draw with now.  contended: as for :meth:`scale`."""
        if not self.keep_up:
            return None
        if moving and contended:
            return CONTENDED_LEVEL if self._moving is None else min(self._moving, CONTENDED_LEVEL)
        return self._moving if moving else self._rest

    def scale(self, *, moving: bool, contended: bool = False) -> float:
        """The internal resolution to draw with now, as a share of the picture's sides.

        contended: a network that cannot be interrupted has the processors that draw, too: the lowest resolution answers input.
        """
        if not (moving and self.keep_up):
            return 1.0
        return SCALES[-1] if contended else SCALES[self._scale]

    @property
    def final(self) -> bool:
        """Whether the level at rest is the last one: the network runs only then."""
        return not self.keep_up or self._rest is None or self._settled

    def hides(self, *, moving: bool) -> bool:
        """Whether cells hidden in the last frame are to be left out."""
        return moving and self.keep_up and self._idle == 0

    def stand_in(self, view: str, *, moving: bool, resizing: bool = False) -> str:
        """The view drawn for ``view``: ``filled`` for ``neural`` while the camera moves and the network is slow or its speed
        unknown, while the picture at rest is still refined, and while the window is resized, since the network is prepared
        for one size."""
        if view != "neural":
            return view
        fast = self._network is not None and self._network <= NETWORK_SHARE * self.target_ms
        ready = not resizing and (fast if moving else self.final)
        return "neural" if ready else "filled"

    def ran_network(self, milliseconds: float) -> None:
        """Learns how long the network takes for one picture."""
        self._network = milliseconds

    def spent_outside(self, milliseconds: float) -> None:
        """Learns how long the interface and the screen take beside a picture, where they share its processors."""
        self._outside += OUTSIDE_WEIGHT * (min(milliseconds, self.target_ms / 2) - self._outside)

    def drew(self, level: float | None, stats: dict, *, moving: bool) -> None:
        """Learns from a picture made at a level of detail: that of ``level``, or a coarser one that a person chose."""
        stages = stats["stages"]
        self._network = stages.get("network", self._network)
        spent = stages.get("cull", 0.0) + max(stages.get("raster", 0.0), stats["host"].get("raster", 0.0))
        if moving:
            self._drew_moving(level, spent, stats)
            return
        self._looked = 0
        if level == self._rest and not stats.get("points_missing"):  # points still arriving would be drawn again and again
            self._drew_at_rest(spent, stats["points_drawn"])

    def _drew_moving(self, level: float | None, spent: float, stats: dict) -> None:
        target = POINTS_SHARE * (self.target_ms - self._outside)
        if not self._fit_resolution(max(stats["total_ms"], spent / POINTS_SHARE)):
            self._fit_points(level, spent, target, stats["points_drawn"])
        self._stay = max(0, self._stay - 1)
        if self._stay == 0:
            self._floor = COARSEST
        self.jump()
        self._idle = max(0, self._idle - 1)
        self._looked = self._looked + 1 if "occlusion" in stats else 0
        if self._looked > 1:  # the first frame has no history
            hidden = stats["occlusion"]["points_hidden"]
            if hidden < LEAST_HIDDEN * (hidden + stats["points_drawn"]):
                self._idle, self._looked = _PATIENCE, 0

    def _fit_resolution(self, total: float) -> bool:
        """Lowers or raises the internal resolution.  Returns whether it changed: then this frame says nothing about points."""
        target = self.target_ms - self._outside
        if total > _SLOWER * target and self._scale < len(SCALES) - 1:
            self._scale += 1 if total < 2.0 * target else len(SCALES) - 1 - self._scale
            self._before = None
            return True
        if self._scale > 0:
            larger = total * (SCALES[self._scale - 1] / SCALES[self._scale]) ** 2
            if larger < _FASTER * target and self._moving is None:
                self._scale -= 1
                self._before = None
                return True
        return False

    def _fit_points(self, level: float | None, spent: float, target: float, points: int) -> None:
        before = self._before
        if before is not None and points < 0.7 * before[1] and spent > 0.8 * before[2]:
            self._floor, self._stay = before[0] or COARSEST, _PATIENCE  # the time does not depend on the points
            self._moving = before[0]
        elif spent > 1.5 * target:
            halvings = min(max(round(log2(spent / target)), 1), 3)  # a large excess is corrected within few frames
            self._moving = FINEST if level is None else max(min(level / 2**halvings, FINEST), self._floor)
        elif self._moving is not None and spent < target / 4:
            self._moving = min(2 * self._moving, FINEST)
        coarser = level is not None and self._moving is not None and self._moving < level
        self._before = (level, points, spent) if coarser else None

    def _drew_at_rest(self, spent: float, points: int) -> None:
        if self._rest is None:
            if spent < POINTS_SHARE * self.target_ms:
                self._moving = None  # every point can keep up
            elif self._moving is None and self._scale == len(SCALES) - 1 and spent > 1.5 * POINTS_SHARE * self.target_ms:
                self._moving = FINEST
            return
        if _STEP * spent > REST_MS:
            self._settled = True
            return
        finer = _STEP * self._rest
        self._rest = None if points == self._points or finer > _ALL else finer
        self._points = points
