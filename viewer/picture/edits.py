"""Edits: what a document changes of the pictures of its scans.

Clips and what is hidden (stations, classes, regions, ghosts) remove points; the look colours them and develops the picture; the
lock keeps measured pixels in the neural view.  Plain values: viewer.render.raster.edit_block turns them into what shaders read.
Frame: clips and the up axis in file coordinates, float64.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field, fields, replace

from ..common.errors import InputError
from .clip import Clip, Vector, active
from .dates.date_comparison import DateComparison
from .json_values import UNLESS_DEFAULT
from .look import Look
from .meshes.mesh_layer import MOST_MESHES, MeshLayer
from .photographs.placed_photograph import MOST_PLACED, PlacedPhotograph
from .point_sets import NO_POINTS, PointLevels, PointSet
from .regions import LAST_CLASS, MOST_CHANGES, ClassChange, Region, hidden_regions
from .views import POINT_VIEWS

MOST_STATIONS = 1 << 20
"""Stations of a place, at most."""
GHOSTS = ("shown", "dimmed", "hidden")
"""What may be done with points that another station saw through."""
LITTLE = 0.01
"""Share of the points: someone who walked by, a tripod, a car.  Without them a room is as closed as before; a wall of a room
has more."""
UP_AXES: dict[str, Vector] = {
    "z": (0.0, 0.0, 1.0), "y": (0.0, 1.0, 0.0), "x": (1.0, 0.0, 0.0),
    "-z": (0.0, 0.0, -1.0), "-y": (0.0, -1.0, 0.0), "-x": (-1.0, 0.0, 0.0),
}  # fmt: skip
"""Directions of the file's frame that a person may call up."""


@dataclass(frozen=True, kw_only=True)
class Edits:
    """Everything besides camera and settings that changes a picture of the scans.

    hidden_stations: numbers of the scene's stations (as in Scene.meta.scans) that are not drawn.
    up: the direction that is up, unit vector of the file's frame, along which heights count.
    lock_measured: pixels that were measured are shown as measured in the neural view, too.
    ghosts: what is done with points that another station saw through (viewer.work.ghosts), one of GHOSTS; it applies where the
    scene's ghosts are marked (Scene.marked).
    hidden_classes: codes of the classes that are not drawn.  regions: named sets of points.  reclassified: points that have
    another class than in their file, each in one entry.  selection: points that are tinted.  comparison: of two dates, which
    colours points in place of the look, by changes: the levels of points made of it, never stored; None until they are made
    (viewer.work.comparing.scene_changes).  meshes: laid beside the points.  photographs: whose poses were found, which colour
    surfaces as those of the scan do.
    Raises InputError naming a bad value.
    """

    clips: tuple[Clip, ...] = ()
    hidden_stations: tuple[int, ...] = ()
    up: Vector = UP_AXES["z"]
    look: Look = field(default_factory=Look)
    lock_measured: bool = False
    ghosts: str = "shown"
    hidden_classes: tuple[int, ...] = field(default=(), metadata=UNLESS_DEFAULT)
    regions: tuple[Region, ...] = field(default=(), metadata=UNLESS_DEFAULT)
    reclassified: tuple[ClassChange, ...] = field(default=(), metadata=UNLESS_DEFAULT)
    selection: PointSet = field(default=NO_POINTS, metadata=UNLESS_DEFAULT)
    comparison: DateComparison | None = field(default=None, metadata=UNLESS_DEFAULT)
    changes: PointLevels | None = field(default=None, metadata={"not_stored": True})
    meshes: tuple[MeshLayer, ...] = field(default=(), metadata=UNLESS_DEFAULT)
    photographs: tuple[PlacedPhotograph, ...] = field(default=(), metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        if not abs(math.hypot(*self.up) - 1.0) <= 1e-6:  # hypot, because squares of what a file holds may overflow
            raise InputError("expected a unit vector", option="up", value=self.up)
        if not all(0 <= number < MOST_STATIONS for number in self.hidden_stations):
            raise InputError(f"hidden stations {list(self.hidden_stations)}: expected numbers from 0 to {MOST_STATIONS - 1}")
        if self.ghosts not in GHOSTS:
            raise InputError(f"expected one of {', '.join(GHOSTS)}", option="ghosts", value=self.ghosts)
        if not all(0 <= code <= LAST_CLASS for code in self.hidden_classes):
            raise InputError(f"hidden classes {list(self.hidden_classes)}: expected numbers from 0 to {LAST_CLASS}")

        given = [change.code for change in self.reclassified]
        if len(set(given)) != len(given):
            raise InputError(f"classes {given} given to points: each has one entry")
        if len(given) > MOST_CHANGES:
            raise InputError(f"points are given {len(given)} classes: {MOST_CHANGES} can be at once")
        if len(self.meshes) > MOST_MESHES:
            raise InputError(f"{len(self.meshes)} meshes: {MOST_MESHES} can be shown at once")
        if len(self.photographs) > MOST_PLACED:
            raise InputError(f"{len(self.photographs)} placed photographs: {MOST_PLACED} can be at once")

    @property
    def none(self) -> bool:
        """Whether pictures are as without any edit.  The up axis matters only to colours."""
        plain = Edits(up=self.up)
        return all(getattr(self, each.name) == getattr(plain, each.name) for each in fields(Edits))

    @property
    def drops(self) -> bool:
        """Whether some points may not be drawn."""
        hidden = self.hidden_stations or self.hidden_classes or hidden_regions(self.regions)
        left_out = self.changes is not None and self.changes.drops_any
        return bool(active(self.clips) or hidden or self.ghosts == "hidden" or left_out)

    def drops_much(self, count: int) -> bool:
        """Whether more may not be drawn than regions that together hold at most LITTLE of ``count`` points."""
        others = self.hidden_stations or self.hidden_classes or active(self.clips) or self.ghosts == "hidden" or (
            self.changes is not None and self.changes.drops_any)
        return bool(others) or sum(region.points.count for region in hidden_regions(self.regions)) > LITTLE * count

    @property
    def recolours(self) -> bool:
        """Whether points are coloured by an attribute."""
        return self.look.recolours or (self.changes is not None and self.changes.colours is not None)

    @property
    def changes_points(self) -> bool:
        """Whether some point is drawn differently, or not at all; the rest of the look develops the finished picture."""
        return self.drops or self.recolours or self.ghosts == "dimmed" or bool(self.selection) or self.changes is not None

    def shown_in(self, views: Iterable[str]) -> "Edits | None":
        """The edits of points that apply to a picture of these views, None where none does: hole fill and network use RGB
        only."""
        plain = self
        if not set(views) <= set(POINT_VIEWS):
            changes = None if self.changes is None else self.changes.uncoloured
            plain = replace(self, look=replace(self.look, colour_by="rgb"), changes=changes)
        return plain if plain.changes_points else None


NO_EDITS = Edits()
"""Of pictures without a document."""
