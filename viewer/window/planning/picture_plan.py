"""The picture on the screen: how it was made, how the next one is to be made, and whether it is still the right one.

No GL: the viewport asks for a plan and reports what was made.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...picture.spec import PictureSpec
from ...render.frame import FrameCost
from .adaptive_lod import AdaptiveLod


@dataclass(frozen=True)
class Plan:
    """How to make the next picture.  views: left first.  level: of detail.  hides: cells hidden in the last frame are left
    out.  moving: while the camera moves.  scale: of the internal resolution, 1 is the picture's own.
    deferred: the network runs on its own thread, and the filled view stands in until it has ended.
    contended: coarse while moving, because a network of an earlier picture runs on the processors that draw.
    network: the quality that the neural view is drawn with, None without one.
    keyframes: the quality of the network that runs beside the pictures where the filled view stands in for the neural one, so
    that what it made last can be moved; else None.  spare: whether pictures leave time for it.
    photographs: whether they colour surfaces."""

    views: tuple[str, ...]
    level: float | None
    hides: bool = False
    moving: bool = False
    scale: float = 1.0
    deferred: bool = False
    contended: bool = False
    network: str | None = None
    keyframes: str | None = None
    spare: bool = False
    photographs: bool = True


class RefinementState:
    """dirty: whether it must be made again.  made: how it was made, None where there is none.  spec: the description that was
    drawn, None before the first.  pending: the plan whose network is still running, or whose points are still arriving; None
    otherwise.
    moved: share of the pixels on the screen that were moved from an earlier neural picture, None where none was made for it.
    approximations: what of the picture is not exact.  cost: of it, or of the one before.
    adaptive_lod: what a picture may leave out.  contended: whether a network runs on the processors that draw."""

    def __init__(self) -> None:
        self.adaptive_lod = AdaptiveLod()
        self.contended = False
        self.dirty = True
        self.made: Plan | None = None
        self.spec: PictureSpec | None = None
        self.pending: Plan | None = None
        self.cost: FrameCost | None = None
        self.approximations: Sequence[str] = ()
        self.moved: float | None = None

    def begin(self, points: int) -> None:
        """A scene of so many points is shown now, and there is no picture of it yet."""
        self.adaptive_lod.begin(points)
        self.dirty, self.made, self.pending, self.cost, self.approximations = True, None, None, None, ()
        self.spec = None

    def renew(self) -> None:
        """The camera was moved at once, or the settings changed: refinement starts again."""
        self.dirty = True
        self.adaptive_lod.jump()

    def plan(self, views: Sequence[str], lod: float | None, networks: Sequence[str], *, moving: bool, resizing: bool = False
             ) -> Plan:
        """The picture to make now.  views, lod: as chosen.  networks: the quality chosen, then smaller networks for flight."""
        adaptive, contended = self.adaptive_lod, self.contended
        network = None
        if "neural" in views:
            network = adaptive.network(networks, moving=moving, resizing=resizing, contended=contended)
        drawn = tuple("filled" if view == "neural" and network is None else view for view in views)
        stands_in = "neural" in views and network is None and not resizing
        levels = [level for level in (lod, adaptive.level(moving=moving, contended=contended)) if level is not None]
        return Plan(drawn, min(levels) if levels else None, adaptive.hides(moving=moving), moving,
                    adaptive.scale(moving=moving, contended=contended), contended=contended,
                    deferred="neural" in drawn and not moving, network=network,
                    keyframes=networks[-1] if stands_in else None, spare=adaptive.spare,
                    photographs=not moving or not adaptive.keep_up or (adaptive.photographs and not contended))

    def lacks(self, plan: Plan) -> bool:
        """Whether something of ``plan`` is missing and nothing that is under way will bring it."""
        made = self.pending or self.made
        return (made is None or (made.views, made.level, made.scale, made.network, made.photographs)
                != (plan.views, plan.level, plan.scale, plan.network, plan.photographs)
                or (made.hides and not plan.hides))

    def drew(self, plan: Plan, *, hides: bool, approximations: Sequence[str], shown: tuple[str, ...] | None = None,
             pending: bool = False) -> None:
        """It was made as planned.  hides: hidden cells were left out indeed.  shown: the views on the screen, where they are
        not the planned ones.  pending: the planned views follow."""
        self.dirty, self.approximations = False, approximations
        self.made = replace(plan, hides=hides, views=shown or plan.views)
        self.pending = plan if pending else None

    def completed(self, cost: FrameCost) -> None:
        """The network of the pending picture has ended and its view is on the screen."""
        assert self.pending is not None
        self.made, self.pending = self.pending, None
        self.approximations, self.cost = cost.facts.approximations, cost
        if self.made.network is not None:
            self.adaptive_lod.ran_network(self.made.network, cost.stages["network"])

    def learn(self, plan: Plan, cost: FrameCost) -> None:
        """What a picture cost that was made as planned."""
        self.cost = cost
        if not (plan.moving and plan.contended):  # it says nothing of pictures that have the processors to themselves
            self.adaptive_lod.drew(plan.level, cost, moving=plan.moving, network=plan.network)
