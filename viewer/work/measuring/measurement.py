"""What can be measured, in one table, and a measurement: its kind and the points that it was made from.

Frame: file coordinates, file units; angles in degrees.
"""

from dataclasses import dataclass, field

import numpy as np

from ...common.errors import InputError
from ...picture.clip import Vector
from ...picture.json_values import UNLESS_DEFAULT
from ..fits.fit import Fit
from .profile import Profile
from .volume import Volume


@dataclass(frozen=True)
class Kind:
    """What can be measured.  name: as a person reads it.  fewest, most: points, None for any number.  power: of the length unit
    in the value, 0: degrees, None: the value is a place.  what: is measured, in a few words.  clicks: what each click is to
    hit, where that is not just the next point.  before: is written before a value.  surfaces: what is fitted at each point, a
    kind of viewer.work.fits.fit.KINDS; None: nothing; () at none."""

    name: str
    fewest: int
    most: int | None
    power: int | None
    what: str
    clicks: tuple[str, ...] = ()
    before: str = ""
    surfaces: tuple[str | None, ...] = ()

    def click(self, number: int) -> str:
        """What the click of this number, from 0, is to hit."""
        return self.clicks[number] if number < len(self.clicks) else "the next point" if number else "the first point"

    def surface(self, number: int) -> str | None:
        """What is fitted at the point of this number, from 0."""
        return self.surfaces[number] if number < len(self.surfaces) else None


_POINT, _NEXT, _FLAT, _OTHER = "the first point", "the second point", "a flat surface", "another flat surface"
KINDS = {
    "distance": Kind("Distance", 2, 2, 1, "straight line between two points", (_POINT, _NEXT)),
    "polyline": Kind("Polyline", 2, None, 1, "length along several points"),
    "height": Kind("Height", 2, 2, 1, "difference of two points along the up axis", (_POINT, _NEXT)),
    "angle": Kind("Angle", 3, 3, 0, "at the second of three points", (_POINT, "the corner", "the end of the other side")),
    "area": Kind("Area", 3, None, 2, "of a polygon, projected on the plane that fits its corners best"),
    "volume": Kind("Volume", 3, None, 3, "of what lies above and below a base, inside a polygon seen along the up axis",
                   ("a corner on the ground", *("the next corner, around what is measured",) * 2)),
    "profile": Kind("Profile", 2, 2, 1, "heights of what is measured along a line; its value is the level length of that line",
                    ("the first end", "the other end")),
    "plane": Kind("Plane", 1, 1, 0, "slope of the flat surface at a point, fitted to all of it that is measured",
                  (_FLAT,), "slope ", ("plane",)),
    "pipe": Kind("Pipe", 1, 1, 1, "diameter of the pipe, column or tank at a point, fitted to all of it that is measured",
                 ("a pipe, a column or a tank",), "Ø ", ("pipe",)),
    "circle": Kind("Circle", 1, 1, 1, "diameter of the cross-section at a point, of what tapers or is bent",
                   ("what is round",), "Ø ", ("circle",)),
    "point to plane": Kind("Point to plane", 2, 2, 1, "distance of a point from a flat surface, or from where that would go on",
                           (_FLAT, "the point"), "", ("plane", None)),
    "plane to plane": Kind("Plane to plane", 2, 2, 1, "distance of a flat surface, where it is clicked, from another one",
                           (_FLAT, "the opposite one"), "", ("plane", "plane")),
    "edge": Kind("Angle of planes", 2, 2, 0, "between two flat surfaces, on the side of the points clicked",
                 (_FLAT, _OTHER), "", ("plane", "plane")),
    "corner": Kind("Corner", 3, 3, None, "the place where three flat surfaces meet, or would meet",
                   (_FLAT, _OTHER, "the third one"), "", ("plane",) * 3),
}  # fmt: skip
"""Each kind in one row."""

LEAST_CORNER = 0.02
"""The least volume that three unit normals may span for a corner: below, it would lie 50 times as far off as a plane does."""


@dataclass(frozen=True)
class MeasuredPoint:
    """A point of a measurement.  position: file coordinates of a measured point, as in the file; the grid's
    (viewer.work.places.pick) until that has been read, and where it cannot be.  spacing, noise: of the points around it, file
    units; noise is the standard deviation from the local plane.  scan: where it is from, for the list.
    fit: the surface at the point, of a measurement that fits one.  beyond: of a point on a silhouette, from it to where the
    contour of its surface may lie (viewer.work.fits.silhouette), file units."""

    position: Vector
    spacing: float = 0.0
    noise: float = 0.0
    scan: str = ""
    fit: Fit | None = field(default=None, metadata=UNLESS_DEFAULT)
    beyond: Vector | None = field(default=None, metadata=UNLESS_DEFAULT)

    @property
    def variance(self) -> float:
        """Of one coordinate, file units squared."""
        return self.spacing**2 / 12 + self.noise**2


@dataclass(frozen=True)
class Measurement:
    """kind: a key of KINDS.  points: in the order in which they were set.  up: the up axis when it was made, for heights.
    volume, profile: what was found inside the polygon, or along the line, of these kinds.

    Raises InputError where the kind, the number of points or what is fitted is wrong.
    """

    kind: str
    points: tuple[MeasuredPoint, ...]
    name: str = ""
    up: Vector = (0.0, 0.0, 1.0)
    volume: Volume | None = field(default=None, metadata=UNLESS_DEFAULT)
    profile: Profile | None = field(default=None, metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"measurement {self.name!r}: kind {self.kind!r}: expected one of {', '.join(KINDS)}")
        fewest, most = KINDS[self.kind].fewest, KINDS[self.kind].most
        if len(self.points) < fewest or (most is not None and len(self.points) > most):
            raise InputError(f"measurement {self.name!r}: {len(self.points)} points; a measurement of {self.kind} has {fewest}"
                             f"{'' if most == fewest else ' or more'}")
        _check_surfaces(self.kind, self.points, f"measurement {self.name!r}")
        for kind, found in (("volume", self.volume), ("profile", self.profile)):
            if (self.kind == kind) != (found is not None):
                raise InputError(f"measurement {self.name!r}: a measurement of {self.kind} has "
                                 f"{'a' if self.kind == kind else 'no'} {kind}")
        if self.kind == "corner" and abs(np.linalg.det([fit.direction for fit in self.fits])) < LEAST_CORNER:
            raise InputError(f"measurement {self.name!r}: two of these surfaces are parallel, or all three go along one line: "
                             "they have no corner")

    @property
    def fits(self) -> list[Fit]:
        """The fitted surfaces, in the order of the points."""
        return [point.fit for point in self.points if point.fit is not None]

    @property
    def fit(self) -> Fit | None:
        """The fitted surface of a kind that is one."""
        return self.points[0].fit if KINDS[self.kind].most == 1 else None


@dataclass(frozen=True)
class Begun:
    """A measurement that is not ended yet: its kind and the points set so far.  Raises InputError where the kind is unknown, or
    something else was fitted."""

    kind: str
    points: tuple[MeasuredPoint, ...]

    def __post_init__(self) -> None:
        kinds = [kind for kind in KINDS if KINDS[kind].most != 1]
        if self.kind not in kinds:
            raise InputError(f"a measurement not ended: kind {self.kind!r}: expected one of {', '.join(kinds)}")
        _check_surfaces(self.kind, self.points, "a measurement not ended")


def _check_surfaces(kind: str, points: tuple[MeasuredPoint, ...], what: str) -> None:
    for number, point in enumerate(points):
        wanted, found = KINDS[kind].surface(number), None if point.fit is None else point.fit.kind
        if found != wanted:
            raise InputError(f"{what}: point {number + 1} of a measurement of {kind} has "
                             f"{'no fit' if found is None else f'a fit of a {found}'}; expected "
                             f"{'none' if wanted is None else f'that of a {wanted}'}")
