"""Clips: boxes and slabs that limit which points of a scan are drawn, measured and exported.

A clip lies in file coordinates (float64) and is oriented freely.  It keeps the points inside it, or removes them.  Several
clips combine as a person expects of a clip box and sections:

- a point must be inside at least one of the boxes that keep, if there are any;
- and inside at least one of the slabs that keep, if there are any;
- and outside every box and every slab that removes.

Faces belong to the inside.  Clips that are not active do nothing.
"""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..common.errors import InputError

Vector = tuple[float, float, float]
Axes = tuple[Vector, Vector, Vector]

WORLD_AXES: Axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
MOST_CLIPS = 16
"""Active at once; the size of the table that shaders read (viewer.render.clip)."""
FARTHEST = 1e12
"""Largest coordinate and size of a clip, file units.  Geocentric coordinates in millimetres reach 6.4e9."""
_ORTHONORMAL = 1e-6
"""Largest error of an entry of axes @ axes.T: axes come back from JSON with 17 digits, from a gizmo with 7."""


@dataclass(frozen=True)
class Box:
    """An oriented box.  centre: file coordinates.  half: half its extent along each of ``axes`` (unit vectors in the file's
    frame), file units, above 0.  removes: hides what is inside, not what is outside.  Raises InputError naming a bad value."""

    centre: Vector
    half: Vector
    axes: Axes = WORLD_AXES
    removes: bool = False
    active: bool = True
    name: str = "Box"

    def __post_init__(self) -> None:
        _check(self.name, self.centre, "centre", 3)
        _check(self.name, self.half, "half size", 3, positive=True)
        _check(self.name, self.axes, "axes", 9)
        axes = np.array(self.axes, np.float64)
        # sizes first: the product of large numbers overflows
        if np.abs(axes).max() > 1 + _ORTHONORMAL or np.abs(axes @ axes.T - np.eye(3)).max() > _ORTHONORMAL:
            raise InputError(f"clip {self.name!r}: axes must be three unit vectors at right angles to each other")

    @property
    def corners(self) -> np.ndarray:
        """(8, 3) float64 file coordinates; corner i lies at +half along axis k where bit k of i is set, else at -half."""
        sign = np.array([[1.0 if i >> k & 1 else -1.0 for k in range(3)] for i in range(8)])
        return np.array(self.centre) + (sign * self.half) @ np.array(self.axes)


@dataclass(frozen=True)
class Slab:
    """The space between two parallel planes.  centre: a file coordinate midway.  normal: unit vector.  thickness: file units,
    above 0.  removes: hides what is between the planes.  Raises InputError naming a bad value."""

    centre: Vector
    normal: Vector
    thickness: float
    removes: bool = False
    active: bool = True
    name: str = "Slab"

    def __post_init__(self) -> None:
        _check(self.name, self.centre, "centre", 3)
        _check(self.name, self.normal, "normal", 3)
        _check(self.name, (self.thickness,), "thickness", 1, positive=True)
        if max(map(abs, self.normal)) > 1 + _ORTHONORMAL or abs(np.linalg.norm(self.normal) - 1.0) > _ORTHONORMAL:
            raise InputError(f"clip {self.name!r}: normal {self.normal!r} is no unit vector", remedy="divide it by its length")


Clip = Box | Slab


def _check(name: str, values: object, what: str, count: int, *, positive: bool = False) -> None:
    """Raises InputError unless ``values`` are ``count`` numbers within FARTHEST, above 0 if asked."""
    try:
        array = np.array(values, np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    # written so that NaN is refused, too
    if array.size != count or not (np.abs(array) <= FARTHEST).all() or (positive and not (array > 0).all()):
        kind = f"above 0 and up to {FARTHEST:g}" if positive else f"{-FARTHEST:g} to {FARTHEST:g}"
        raise InputError(f"clip {name!r}: {what} {values!r}: expected {count} number{'s' * (count > 1)}, {kind}")


def normals(clip: Clip) -> np.ndarray:
    """(3, 3) float64: x is inside exactly where ``abs(normals @ (x - centre)) <= 1`` in all rows; of a slab two rows are 0."""
    if isinstance(clip, Slab):
        return np.vstack([2.0 * np.array(clip.normal) / clip.thickness, np.zeros((2, 3))])
    return np.array(clip.axes) / np.array(clip.half)[:, None]


def active(clips: Iterable[Clip]) -> tuple[Clip, ...]:
    """The clips that have an effect.  Raises InputError where more than MOST_CLIPS do."""
    found = tuple(clip for clip in clips if clip.active)
    if len(found) > MOST_CLIPS:
        raise InputError(f"{len(found)} clips are active at once: {MOST_CLIPS} can be", remedy="turn some off")
    return found


def group(clip: Clip) -> int:
    """0: a box that keeps, 1: a slab that keeps, 2: removes."""
    return 2 if clip.removes else int(isinstance(clip, Slab))


def contains(clips: Iterable[Clip], xyz: np.ndarray) -> np.ndarray:
    """Which points are left by the clips.  xyz: (n, 3) float64 file coordinates.  Returns (n,) bool."""
    xyz = np.asarray(xyz, np.float64)
    kept = np.ones(len(xyz), bool)
    inside_any: dict[int, np.ndarray] = {}
    for clip in active(clips):
        inside = np.all(np.abs((xyz - np.array(clip.centre)) @ normals(clip).T) <= 1.0, axis=1)
        kind = group(clip)
        inside_any[kind] = inside_any[kind] | inside if kind in inside_any else inside
    for kind, inside in inside_any.items():
        kept &= ~inside if kind == 2 else inside
    return kept


def may_contain(clips: Iterable[Clip], centre: np.ndarray, half: float) -> np.ndarray:
    """Which axis-aligned cubes may hold a point that the clips leave: conservative, for culling.

    centre: (C, 3) float64 file coordinates.  half: half a side, file units.  Returns (C,) bool; False only where none can.
    """
    possible = np.ones(len(centre), bool)
    any_inside: dict[int, np.ndarray] = {}
    for clip in active(clips):
        rows = normals(clip)
        way, reach = np.abs((centre - np.array(clip.centre)) @ rows.T), np.abs(rows).sum(axis=1) * half
        if clip.removes:
            possible &= ~(way + reach <= 1.0).all(axis=1)
            continue
        touches = np.all(way - reach <= 1.0, axis=1)
        kind = group(clip)
        any_inside[kind] = any_inside[kind] | touches if kind in any_inside else touches
    for touches in any_inside.values():
        possible &= touches
    return possible


def box_around(low: np.ndarray, high: np.ndarray, name: str = "Box") -> Box:
    """The axis-aligned box with two opposite corners, (3,) file coordinates each."""
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    return Box(vector((low + high) / 2), vector((high - low) / 2), name=name)


def vector(values: np.ndarray) -> Vector:
    """Three numbers of an array as plain floats."""
    x, y, z = (float(value) for value in values)
    return x, y, z
