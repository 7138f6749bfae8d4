"""Where a section lies: a slab of space, and the orthographic view of it.

Frame: file coordinates, float64, file units.  A cut has an origin and three unit vectors at right angles: ``right`` and ``up``
span the paper, ``forward`` is the direction of view.  A point's paper coordinates are (right, up) relative to the origin and
its depth is along ``forward``.  A plan looks down, its paper axes are x and y of the file (for an up axis z).
"""

from dataclasses import dataclass, replace

import numpy as np

from ...common.errors import InputError, Option
from ...picture.clip import Vector, vector
from ...work.places.up_axis import upright_axes

KINDS = {"plan": "plan", "elevation": "elevation", "line": "section"}
"""Kind -> its name in titles."""


@dataclass(frozen=True)
class Cut:
    """origin: file coordinates.  right, up, forward: unit vectors, up = right x forward turned to a right-handed paper.

    near, far: depths between which points belong to the slab, both included; -inf and inf: everything.
    left, rightmost: paper coordinates along ``right`` between which points count (the ends of a line), or -inf and inf.
    kind: a key of KINDS.  text: where it lies, for the title.
    """

    origin: Vector
    right: Vector
    up: Vector
    forward: Vector
    near: float
    far: float
    kind: str
    text: str
    left: float = -np.inf
    rightmost: float = np.inf

    @property
    def axes(self) -> np.ndarray:
        """(3, 3) float64: rows right, up, forward."""
        return np.array([self.right, self.up, self.forward])

    def paper(self, xyz: np.ndarray) -> np.ndarray:
        """(n, 3) float64: paper coordinates right and up, and depth, of points (n, 3) in file coordinates."""
        return (np.asarray(xyz, np.float64) - np.array(self.origin)) @ self.axes.T

    def contains(self, paper: np.ndarray) -> np.ndarray:
        """(n,) bool of (n, 3) :meth:`paper` coordinates: which points belong to the slab."""
        return ((paper[:, 2] >= self.near) & (paper[:, 2] <= self.far)
                & (paper[:, 0] >= self.left) & (paper[:, 0] <= self.rightmost))


def plan(height: float, thickness: float, up: Vector = (0.0, 0.0, 1.0)) -> Cut:
    """The slab of ``thickness`` around ``height`` along the up axis, seen from above."""
    _check("--plan", height)
    axes = upright_axes(up)
    return Cut(vector(height * axes[:, 2]), vector(axes[:, 0]), vector(axes[:, 1]), vector(-axes[:, 2]),
               *_halves(thickness), "plan", f"at height {height:.10g}, thickness {thickness:g}")


def elevation(azimuth: float, thickness: float | None, bounds: np.ndarray, up: Vector = (0.0, 0.0, 1.0), *,
              begin: "float | tuple[float, float] | None" = None) -> Cut:
    """The scan seen from outside in a compass direction, or from a cut plane on.

    azimuth: degrees clockwise from the second level axis (y, grid north), in which one looks.  thickness: of the part nearest
    to the eye, None: everything.  bounds: (2, 3) of the scan.  begin: the upright cut plane, square to the direction of view;
    what lies in front of it is left out: its distance from the scan's nearest corner, or a place on it, two level coordinates.
    None: no cut plane.
    """
    _check("--elevation", azimuth)
    axes = upright_axes(up)
    angle = np.radians(azimuth)
    forward = np.sin(angle) * axes[:, 0] + np.cos(angle) * axes[:, 1]
    corners = np.array(np.meshgrid(*np.asarray(bounds, np.float64).T)).reshape(3, -1).T
    start = float((corners @ forward).min())
    if thickness is not None:
        _halves(thickness)
    what = "everything" if thickness is None else f"the nearest {thickness:g}"
    near, far = -np.inf, np.inf if thickness is None else thickness
    if begin is not None:
        _check("--from", *np.atleast_1d(begin))
        near = float(begin) if isinstance(begin, (int, float)) else float((axes[:, :2] @ np.array(begin)) @ forward) - start
        far = near + (np.inf if thickness is None else thickness)
        what = f"from {begin:g} behind its front on" if isinstance(begin, (int, float)) else f"from {_places(begin)} on"
        what += "" if thickness is None else f", depth {thickness:g}"
    return Cut(vector(start * forward), _right(forward, axes[:, 2]), vector(axes[:, 2]), vector(forward),
               near, far, "elevation", f"looking {azimuth % 360:g}\u00b0, {what}")


def along_line(first, second, thickness: float, up: Vector = (0.0, 0.0, 1.0)) -> Cut:
    """The upright slab of ``thickness`` around the line between two places, (2,) level coordinates each; ``first`` is left."""
    axes = upright_axes(up)
    ends = [np.asarray(end, np.float64) for end in (first, second)]
    for end in ends:
        _check("--line", *end)
    way = (ends[1] - ends[0]) @ axes[:, :2].T
    length = float(np.linalg.norm(way))
    if not length > 0:
        raise InputError("both ends are the same place", option="--line", remedy="give two different places, X1,Y1,X2,Y2")
    right = way / length
    forward = np.cross(axes[:, 2], right)
    near, far = _halves(thickness)
    places = " to ".join(_places(end) for end in ends)
    return Cut(vector(axes[:, :2] @ ends[0]), vector(right), vector(axes[:, 2]), vector(forward), near, far, "line",
               f"from {places}, thickness {thickness:g}", 0.0, length)


def cut_slab(cut: Cut, thickness: float) -> Cut:
    """The thin slab in which lines are traced: that of a plan or a section; of an elevation ``thickness`` (file units) behind
    its cut plane.  Raises InputError where an elevation has none: it cuts nothing."""
    if cut.kind != "elevation":
        return cut
    if not np.isfinite(cut.near):
        raise InputError("an elevation without a cut plane cuts nothing whose lines could be traced",
                         remedy=("give the plane with ", Option("--from")))
    return replace(cut, far=min(cut.far, cut.near + thickness))


def _right(forward: np.ndarray, up: np.ndarray) -> Vector:
    return vector(np.cross(forward, up))


def _places(place) -> str:
    return ",".join(f"{value:.10g}" for value in place)


def _halves(thickness: float) -> tuple[float, float]:
    if not (np.isfinite(thickness) and thickness > 0):
        raise InputError("expected a length above 0, in the scan's units", option="--thickness", value=thickness)
    return -thickness / 2, thickness / 2


def _check(option: str, *values: float) -> None:
    if not np.isfinite(values).all():
        raise InputError(f"{option} {','.join(map(str, values))}: expected finite numbers, in the scan's coordinates")
