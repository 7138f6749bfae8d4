"""Adaptive level of detail: what a moving picture leaves out to hold a frame time, and how the picture at rest gets it back.

While the camera moves, in this order: a smaller network, the filled view instead of a network, no colours of photographs, a
lower internal resolution, fewer points per pixel; and cells that were hidden in the frame before are skipped.  But for the
photographs the order is that of the error at equal time, measured along the fixed path of three scans at 1280x720 (PSNR to the
full neural picture: demo, studio, plant room):

    the fast network at full resolution     35.0  42.1  41.2 dB     the balanced one at 75 %, as slow     30.6  38.8  36.5 dB
    the filled view at full resolution      30.8  36.2  37.7 dB     the same at 75 %                      28.3  36.3  35.4 dB
    the filled view at 50 %                 30.0  35.5  36.0 dB     the balanced network at 50 %          30.3  36.1  34.8 dB

A network at a lower resolution is hardly closer than the filled view, which takes a third of its time; 75 % is no closer than
50 %.  At rest: four times the points, again and again, until nothing is left out or the next step would take too long; then the
network runs, once.
Nothing here knows a clock or a window; it learns from ``Frame.cost``.  Levels of detail: points per pixel, None draws every
point.  Networks: keys of model.network.qualities.QUALITIES.
"""

from collections.abc import Sequence
from math import log2

from ....model.network.qualities import QUALITIES
from ...render.frame import FrameCost

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
SCALES = (1.0, 0.5)
"""Internal resolutions while moving, as a share of each side."""
CONTENDED_LEVEL = COARSEST
"""Points per pixel of a moving picture while a network runs on the processors that draw (see :meth:`AdaptiveLod.scale`): of the
one or two pictures until it ends at its next layer."""
LEAST_HIDDEN = 0.25
"""Share of the points that must be hidden for occlusion culling to pay."""
OUTSIDE_WEIGHT = 0.2
"""Weight of the newest picture in the running mean of what is spent outside the renderer."""
SPARE = 0.25
"""Share of the target that a moving picture must leave, so that a network runs beside the flight.  It slows drawing where both
share processors, and pictures that come late are noticed first: a choice, not measured."""
_SLOWER = 1.25  # times the target: above it something is left out
_FASTER = 0.9  # times the target: a higher resolution is tried where it is predicted to stay below
_PATIENCE = 60  # frames until what did not pay is tried again
_STEP = 4.0  # at rest
_ALL = 1024.0  # points per pixel that no scan has
_PIXELS_SHARE = 0.2  # of a picture's time: below it fewer points come before a lower resolution (raw)
_OVER = 1.2  # times the points' target: above it fewer are drawn
_SPARE = 0.45  # share of the points' target below which twice the points are drawn


class AdaptiveLod:
    """keep_up: whether anything may be left out while moving.  target_ms: frame time to hold while the camera moves.
    spare: whether a moving picture with nothing left out leaves SPARE of that time to a network beside the flight.
    photographs: whether a moving picture has time for the colours of photographs."""

    def __init__(self, target_ms: float = TARGET_CPU_MS) -> None:
        self.keep_up = True
        self.target_ms = target_ms
        self._network_ms: dict[str, float] = {}
        self._outside = 0.0
        self.begin(0)

    def begin(self, points: int) -> None:
        """A scene of so many points is shown now."""
        self._moving: float | None = 1.0 if points > MANY_POINTS else None
        self._rest = self._moving
        self._settled = False
        self._points = -1
        self._scale = 0
        self.spare = False
        self._idle = self._looked = self._stay = 0
        self._no_network = self._no_scale = self._no_all = 0  # moving frames until it is tried again
        self._no_photos, self._photo_ms = 0, 0.0  # of a picture at full resolution
        self.photographs = True
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

    def network(self, networks: Sequence[str], *, moving: bool, resizing: bool = False, contended: bool = False) -> str | None:
        """The network to draw the neural view with; None: the filled view stands in.

        networks: the one asked for, then smaller ones that may replace it while the camera moves.  contended: as for
        :meth:`scale`.  The filled view is drawn where each of them is slow, or its time unknown, while the picture at rest is
        still refined, and while the window is resized, since a network is prepared for one size.
        """
        if resizing or not networks:
            return None
        if not moving:
            return networks[0] if self.final else None
        if contended or self._scale > 0 or self._no_network > 0:
            return None
        usable = networks if self.keep_up else networks[:1]
        return next((name for name in usable if self._expected(name) <= NETWORK_SHARE * self.target_ms), None)

    def _expected(self, network: str) -> float:
        """Milliseconds that a network takes: measured, else by the table from another's; infinite where none is known."""
        if network in self._network_ms or not self._network_ms:
            return self._network_ms.get(network, float("inf"))
        known, milliseconds = next(reversed(self._network_ms.items()))
        return milliseconds * QUALITIES[network].relative_time / QUALITIES[known].relative_time

    def ran_network(self, network: str, milliseconds: float) -> None:
        """Learns how long a network takes for one picture."""
        self._network_ms[network] = milliseconds

    def spent_outside(self, milliseconds: float) -> None:
        """Learns how long the interface and the screen take beside a picture, where they share its processors."""
        self._outside += OUTSIDE_WEIGHT * (min(milliseconds, self.target_ms / 2) - self._outside)

    def drew(self, level: float | None, cost: FrameCost, *, moving: bool, network: str | None = None) -> None:
        """Learns from a picture made at a level of detail: that of ``level``, or a coarser one that a person chose.  network:
        that of its neural view, None without one."""
        stages = cost.stages
        if network is not None and "network" in stages:
            self.ran_network(network, stages["network"])
        spent = stages.get("cull", 0.0) + max(stages.get("raster", 0.0), cost.host.get("raster", 0.0))
        if moving:
            self._drew_moving(level, spent, cost, network is not None)
            return
        self._looked = 0
        if level == self._rest and not cost.facts.points_missing:  # points still arriving would be drawn again and again
            self._drew_at_rest(spent, cost.points_drawn)

    def _drew_moving(self, level: float | None, spent: float, cost: FrameCost, neural: bool) -> None:
        self._no_network, self._no_scale, self._no_all, self._no_photos, self._stay = (
            max(0, frames - 1) for frames in (self._no_network, self._no_scale, self._no_all, self._no_photos, self._stay)
        )
        total, whole = max(cost.total_ms, spent), self.target_ms - self._outside
        self.spare = level is None and self._scale == 0 and total < (1 - SPARE) * whole
        if neural and total > _SLOWER * whole:
            self._no_network = _PATIENCE
        elif not self._fit_photographs(total, cost.stages.get("photographs", 0.0)) and not self._fit_resolution(total, spent):
            target = max(POINTS_SHARE * whole, whole - (total - spent))  # the raw view has no other stages
            self._fit_points(level, spent, target, cost.points_drawn)
        if self._stay == 0:
            self._floor = COARSEST
        self.jump()
        self._idle = max(0, self._idle - 1)
        self._looked = 0 if cost.hidden is None else self._looked + 1
        if cost.hidden is not None and self._looked > 1:  # the first frame has no history
            hidden = cost.hidden.points_hidden
            if hidden < LEAST_HIDDEN * (hidden + cost.points_drawn):
                self._idle, self._looked = _PATIENCE, 0

    @property
    def knows_photographs(self) -> bool:
        """Whether photographs have coloured a moving picture."""
        return self._photo_ms > 0

    def _fit_photographs(self, total: float, spent: float) -> bool:
        """Leaves the photographs out of the next pictures, or takes them back.  Returns whether it left them out: then this
        frame says nothing about the resolution.  total: milliseconds of the picture.  spent: those of the photographs."""
        target, share = self.target_ms - self._outside, SCALES[self._scale] ** 2
        if spent:
            self._photo_ms = spent / share
            if total > _SLOWER * target:
                self.photographs, self._no_photos = False, _PATIENCE
        elif not self.photographs and self._no_photos == 0:
            self.photographs = total + self._photo_ms * share < _FASTER * target
        return spent > 0 and not self.photographs

    def _fit_resolution(self, total: float, spent: float) -> bool:
        """Lowers or raises the internal resolution.  Returns whether it changed: then this frame says nothing about points.

        total: milliseconds of the picture.  spent: those of them that depend on points more than on pixels.
        """
        target = self.target_ms - self._outside
        pays = total - spent > _PIXELS_SHARE * total or (self._moving is not None and self._moving <= COARSEST)
        if total > _SLOWER * target and self._scale < len(SCALES) - 1 and pays:
            self._scale += 1
            self._no_scale, self._before = _PATIENCE, None
            return True
        if self._scale > 0 and self._no_scale == 0 and self._moving is None:
            larger = spent + (total - spent) * (SCALES[self._scale - 1] / SCALES[self._scale]) ** 2
            if larger < _FASTER * target:
                self._scale -= 1
                self._before = None
                return True
        return False

    def _fit_points(self, level: float | None, spent: float, target: float, points: int) -> None:
        before = self._before
        if before is not None and points < 0.7 * before[1] and spent > 0.8 * before[2]:
            self._floor, self._stay = before[0] or COARSEST, _PATIENCE  # the time does not depend on the points
            self._moving = before[0]
        elif spent > _OVER * target:
            halvings = min(max(round(log2(spent / target)), 1), 3)  # a large excess is corrected within few frames
            if level is None:
                self._no_all = _PATIENCE
            self._moving = FINEST if level is None else max(min(level / 2**halvings, FINEST), self._floor)
        elif self._moving is not None and spent < _SPARE * target:
            more = 2 * self._moving
            self._moving = more if more <= FINEST else FINEST if self._no_all else None
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
