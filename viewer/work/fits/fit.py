"""A plane, a pipe or a circle fitted to the measured points around a click: the value that is kept, shown and written.

Frame: file coordinates, file units, float64; angles in degrees.  Uncertainties are expanded to 95 %; errors of the registration
and of the instrument's scale are not in them.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError
from ...picture.clip import Vector, vector
from ...picture.json_values import UNLESS_DEFAULT

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ..places.pick import Kept
    from .grow import Grown
    from .measured import InBox

KINDS = ("plane", "pipe", "circle")
_LARGEST = 1e100  # of a number in a file; its square is finite
_ROUNDING = 1 / np.sqrt(12.0)  # standard deviation of a place that is rounded to steps of 1


@dataclass(frozen=True)
class Fit:
    """kind: one of KINDS.  place: on the axis, beside the click; of a plane, the middle of its piece.
    direction: along the axis, or the unit normal.  radius: 0 of a plane.
    low, high: how far the piece reaches along the axis from ``place``; of a plane, in all directions, about.
    seen: degrees of the circumference that hold points, 0 of a plane.  sigma: scatter of the points around the surface.
    count: of the points.  radius_uncertainty: file units.  tilt_uncertainty: of the direction, degrees; 0 of a circle, whose
    direction is that of the pipe.  offset_uncertainty: of a plane along its normal, at ``place``, file units; 0 of others.

    Raises InputError where these are no surface.
    """

    kind: str
    place: Vector
    direction: Vector
    radius: float
    low: float
    high: float
    seen: float
    sigma: float
    count: int
    radius_uncertainty: float
    tilt_uncertainty: float
    offset_uncertainty: float = field(default=0.0, metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError(f"a fit of kind {self.kind!r}: expected one of {', '.join(KINDS)}")
        values = (*self.place, *self.direction, self.radius, self.low, self.high, self.seen, self.sigma,
                  self.radius_uncertainty, self.tilt_uncertainty, self.offset_uncertainty)  # fmt: skip
        sizes = (self.radius, self.sigma, self.radius_uncertainty, self.tilt_uncertainty, self.offset_uncertainty)
        if not (np.abs(values) < _LARGEST).all() or min(sizes) < 0:
            raise InputError(f"a fit of kind {self.kind!r} has a value that is no finite number, too large, or below 0")
        if abs(float(np.linalg.norm(self.direction)) - 1.0) > 1e-6:
            raise InputError(f"a fit of kind {self.kind!r}: direction {self.direction!r}: expected a vector of length 1")

    def tilt(self, up: Vector) -> float:
        """Degrees between the plane and level, or between the axis and upright: 0..90."""
        cosine = abs(float(np.dot(self.direction, up))) / max(float(np.linalg.norm(up)), 1e-300)
        return float(np.degrees(np.arccos(min(cosine, 1.0))))


def fit_at(scene: "Scene", position: Vector, kind: str, kept: "Kept | None" = None) -> Fit:
    """The surface of a kind of KINDS at a measured point of a scene, file coordinates.  kept: which points are drawn; None:
    all.

    The grid's coordinates are taken: their rounding is in the least scatter, and below a hundredth of a millimetre in the scan
    of a building (Scene.step).  Raises viewer.work.fits.grow.NoFit, in one line, where there is none.
    """
    from ..places.pick import surface_around
    from .measured import in_scene

    place = np.asarray(position, np.float64)
    around = surface_around(scene, place)
    spacing = around.spacing if np.isfinite(around.spacing) else scene.spacing
    return fit_of(in_scene(scene, place, kept), place, kind, spacing, scene.step * _ROUNDING)


def fit_of(in_box: "InBox", place: np.ndarray, kind: str, spacing: float, rounding: float) -> Fit:
    """As fit_at, of points that ``in_box`` gives relative to ``place``.  spacing: of points there, about."""
    from .grow import circle_of, grown_cylinder, grown_plane
    from .measured import distinct

    in_box = distinct(in_box)
    if kind == "plane":
        return _value(kind, grown_plane(in_box, spacing, rounding), place)
    if kind == "circle":
        pipe = grown_cylinder(in_box, spacing, rounding, longest=4.0, loosest=np.inf)
        return _value(kind, circle_of(pipe), place)
    return _value(kind, grown_cylinder(in_box, spacing, rounding), place)


def _value(kind: str, grown: "Grown", click: np.ndarray) -> Fit:
    from .surfaces import Cylinder

    fit, surface, points = grown.fit, grown.fit.surface, grown.points.xyz
    if not isinstance(surface, Cylinder):
        foot = surface.place
        reach = float(np.quantile(np.linalg.norm(points - foot, axis=1), 0.9))
        low, high, radius, seen, unsure, offset = -reach, reach, 0.0, 0.0, 0.0, float(fit.expanded("offset"))
    else:
        foot = surface.place - (surface.place @ surface.direction) * surface.direction  # on the axis, nearest to the click
        along = (points - foot) @ surface.direction
        low, high, radius = float(along.min()), float(along.max()), float(surface.radius)
        seen, unsure = _seen(surface.unrolled(points)[:, 0] / surface.circumference), fit.expanded("radius")
        offset = 0.0
    tilt = float(np.degrees(fit.expanded("tilt"))) if "tilt" in surface.parameters else 0.0
    place, direction = vector(click + foot), vector(surface.direction)
    return Fit(kind, place, direction, radius, low, high, seen, float(fit.sigma), len(points), float(unsure), tilt,
               offset)


def _seen(turns: np.ndarray) -> float:
    """Degrees of a circumference that hold points, which lie at these shares of a turn.  Every five degrees with a quarter of
    the usual number count: the few points of something that touches the surface elsewhere do not."""
    counts = np.bincount((turns * 72).astype(np.int64) % 72, minlength=72)
    return 5.0 * float((counts > 0.25 * np.median(counts[counts > 0])).sum())
