"""What is on the screen against what was asked for: the picture to make next, whether more follows, and what is not exact."""

from collections.abc import Callable

from ...picture.camera import Camera
from ...picture.spec import PictureSpec
from ..flight.flight import Flight
from ..planning.picture_plan import Plan, RefinementState
from ..planning.view_settings import ViewSettings
from ..planning.window_area import WindowArea
from .shown_scan import ShownScan


class ScreenState:
    """Answers from the parts of a session; it has no state of its own.  spec: the picture that is asked for."""

    def __init__(self, picture: RefinementState, view_settings: ViewSettings, flight: Flight, shown_scan: ShownScan,
                 area: WindowArea, spec: Callable[[], PictureSpec]):
        self._picture, self._view_settings, self._flight = picture, view_settings, flight
        self._shown_scan, self._area = shown_scan, area
        self._spec = spec

    @property
    def camera(self) -> Camera:
        """The camera of the picture on the screen; of the one asked for where there is none."""
        return (self._picture.spec or self._spec()).camera

    @property
    def plan(self) -> Plan:
        """The picture to make now."""
        chosen = self._view_settings
        return self._picture.plan(chosen.sides, chosen.settings.lod, chosen.networks, moving=self._flight.moving,
                                  resizing=self._area.settles_in > 0)

    @property
    def full_plan(self) -> Plan:
        """The picture as the settings have it, however long it takes."""
        chosen = self._view_settings
        network = chosen.settings.quality if "neural" in chosen.sides else None
        return Plan(chosen.sides, chosen.settings.lod, network=network)

    @property
    def needs_picture(self) -> bool:
        """Whether the picture on the screen is not the one to be shown."""
        if self._shown_scan.scene is None or not self._area.visible:
            return False
        picture = self._picture
        return picture.dirty or picture.lacks(self.plan) or not self._spec().renders_as(picture.spec)

    @property
    def exact(self) -> bool:
        """Whether the picture on the screen is what the settings ask for, with nothing left out."""
        made, full = self._picture.made, self.full_plan
        return (made is not None and not self.refining and not made.hides
                and (made.views, made.level, made.scale, made.network) == (full.views, full.level, full.scale, full.network)
                and not (self._picture.cost is not None and self._picture.cost.facts.points_missing))

    @property
    def refining(self) -> bool:
        """Whether a better picture than that on the screen will follow by itself."""
        if self._shown_scan.scene is None or not self._area.visible:
            return False
        coming = self._picture.pending is not None or self.drawn != self._view_settings.sides
        return coming or self._flight.moving or self.needs_picture

    @property
    def drawn(self) -> tuple[str, ...]:
        """The views on the screen, left first; those to come where there is no picture yet."""
        made, sides = self._picture.made, self._view_settings.sides
        return made.views if made is not None and len(made.views) == len(sides) else sides

    @property
    def smaller_network(self) -> str | None:
        """The network that the picture on the screen was drawn with, where it is not the one asked for; else None."""
        made = self._picture.made
        drawn = made.network if made is not None and "neural" in self.drawn else None
        return None if drawn == self._view_settings.settings.quality else drawn

    @property
    def approximations(self) -> list[str]:
        """Everything about the picture on the screen that is not exact, in words."""
        made = list(self._picture.approximations)
        picture = self._picture.made
        if picture is not None and picture.scale < 1.0:
            made.append(f"internal resolution {100 * picture.scale:.0f} %")
        if picture is not None and not picture.photographs and self._picture.adaptive_lod.knows_photographs:
            made.append("no colours of photographs while moving")
        if (smaller := self.smaller_network) is not None:
            made.append(f"the {smaller} network while moving")
        if self.drawn != self._view_settings.sides and "neural" in self._view_settings.sides:
            resizing = "while resizing" if self._area.settles_in > 0 else "until the network has run"
            when, moved = "while moving" if self._flight.moving else resizing, self._picture.moved
            made.append(f"filled {when}" if moved is None else
                        f"{100 * moved:.0f} % moved from the last neural picture, the rest filled {when}")
        elif self._picture.pending is not None:
            made.append("network running: this picture has the settings before")
        return made
