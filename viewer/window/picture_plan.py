"""The picture on the screen: how it was made, how the next one is to be made, and whether it is still the right one.

No GL: whoever draws asks for a plan and says what came of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from viewer.window.adaptive_lod import AdaptiveLod


@dataclass(frozen=True)
class Plan:
    """How to make the next picture.  views: left first.  level: of detail.  hides: cells that the last frame hid are left
    out.  moving: while the camera moves."""

    views: tuple[str, ...]
    level: float | None
    hides: bool = False
    moving: bool = False


class Picture:
    """dirty: whether it must be made again, as it is or otherwise.  made: how it was made, None where there is none.
    approximations: what of it is not exact.  stats: what it, or the one before it, cost, as ``Frame.stats``.
    pace: what a picture may leave out."""

    def __init__(self) -> None:
        self.adaptive_lod = AdaptiveLod()
        self.dirty = True
        self.made: Plan | None = None
        self.stats: dict | None = None
        self.approximations: Sequence[str] = ()

    def begin(self, points: int) -> None:
        """A scene of so many points is shown now, and there is no picture of it yet."""
        self.adaptive_lod.begin(points)
        self.dirty, self.made, self.stats, self.approximations = True, None, None, ()

    def renew(self) -> None:
        """The camera is elsewhere, or the settings are others: what was refined at rest is of no use."""
        self.dirty = True
        self.adaptive_lod.jump()

    def plan(self, views: Sequence[str], lod: float | None, *, moving: bool, resizing: bool = False) -> Plan:
        """The picture to make now.  views, lod: as chosen."""
        stand_ins = tuple(self.adaptive_lod.stand_in(view, moving=moving, resizing=resizing) for view in views)
        levels = [level for level in (lod, self.adaptive_lod.level(moving=moving)) if level is not None]
        return Plan(stand_ins, min(levels) if levels else None, self.adaptive_lod.hides(moving=moving), moving)

    def lacks(self, plan: Plan) -> bool:
        """Whether something of ``plan`` is missing, or the view is another."""
        made = self.made
        return made is None or (made.views, made.level) != (plan.views, plan.level) or (made.hides and not plan.hides)

    def drew(self, plan: Plan, *, hides: bool, approximations: Sequence[str]) -> None:
        """It was made as planned.  hides: hidden cells were left out indeed."""
        self.dirty, self.made, self.approximations = False, replace(plan, hides=hides), approximations

    def learn(self, plan: Plan, stats: dict) -> None:
        """What a picture cost that was made as planned; ``stats`` as ``Frame.stats``."""
        self.stats = stats
        self.adaptive_lod.drew(plan.level, stats, moving=plan.moving)
