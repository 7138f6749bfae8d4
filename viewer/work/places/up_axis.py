"""Which way is up: the axes of a world whose up is not the file's z, and whether a scan seems to lie on its side.

Graphics programs and depth cameras often store y as up or down; scanners store z.  A scan says so by its floor: flat slabs at
the ends of an axis hold much of what is measured, and the place is wider than it is tall.  The guess is only offered to a
person, never applied, and only where it is clear.
"""

from dataclasses import replace
from typing import TypeVar

import numpy as np

Z_UP = (0.0, 0.0, 1.0)
CELLS = 48
"""Cells along the longest side by which surfaces are counted, so that dense places count no more than others."""
SLAB = 0.05
"""Thickness of a slab at an end of an axis, as a share of the extent along it."""
END = 0.2
"""Share of the extent at either end of an axis in which a slab is looked for."""
LEAST_FLOOR = 0.1
"""Share of the surface that the larger slab of an offered axis holds at least."""
CLEARLY = 1.6
"""How many times as much of the surface lies in the slabs of an offered axis as in those of z."""
FLATTER = 0.75
"""Extent along an offered axis, at most, as a share of that along z: places are wider than tall."""
LONGEST = 3.0
"""Ratio of the two other extents above which a place is a corridor or a facade, whose walls are larger than its floor."""
THINNEST = 0.08
"""Extent along an offered axis, at least, as a share of the next larger one: a thinner scan may be a facade."""
UPSIDE_DOWN = 2.0
"""How many times as much of the surface the upper slab holds where the upper end is the floor: y up is far more common than y
down, and ceilings and roofs can hold more than a furnished floor."""
_FEW = 2_000
"""Points, at least, that a guess needs."""

Sample = TypeVar("Sample")


def upright_axes(up) -> np.ndarray:
    """(3, 3) rotation that turns a world whose z is up into the file's axes; its last column is ``up`` (3,), a unit vector."""
    z = np.asarray(up, np.float64)
    first = np.array([0.0, 1.0, 0.0]) if abs(z[0]) > 0.9 else np.array([1.0, 0.0, 0.0])
    x = first - (first @ z) * z
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def turned(seen: Sample, upright: np.ndarray) -> Sample:
    """A sample of a scene (viewer.work.places.standing_place.Sampled) in the upright world: its points and their range."""
    if np.array_equal(upright, np.eye(3)):
        return seen
    points = seen.points @ upright  # type: ignore[attr-defined]
    low, high = np.percentile(points, [1.0, 99.0], axis=0)
    return replace(seen, points=points, low=low, high=high)  # type: ignore[type-var]


def up_axis_offer(seen) -> str | None:
    """"y" or "-y" where that is clearly up, else None.  seen: a Sampled in file coordinates.

    """
    inside = ((seen.points >= seen.low) & (seen.points <= seen.high)).all(axis=1)
    extent = np.asarray(seen.high - seen.low, np.float64)
    if inside.sum() < _FEW or not (extent > 0).all():
        return None
    x, y, z = extent
    if not (y < FLATTER * z and y > THINNEST * min(x, z) and max(x, z) < LONGEST * min(x, z)):
        return None
    side = extent.max() / CELLS
    cells = np.unique(np.floor((seen.points[inside] - seen.low) / side).astype(np.int64), axis=0)
    centres = (cells + 0.5) * side / extent
    below, above = _slabs(centres[:, 1])
    if max(below, above) < LEAST_FLOOR or below + above < CLEARLY * sum(_slabs(centres[:, 2])):
        return None
    return "-y" if above > UPSIDE_DOWN * below else "y"


def _slabs(places: np.ndarray) -> tuple[float, float]:
    """Share of the surface in the fullest slab near either end of an axis, beyond what a slab of it holds in general (walls
    along the axis).  places: along it, 0 to 1."""
    counts, _ = np.histogram(places, bins=round(1 / SLAB), range=(0.0, 1.0))
    ends, general = max(1, round(END / SLAB)), float(np.median(counts))
    return max(counts[:ends].max() - general, 0.0) / len(places), max(counts[-ends:].max() - general, 0.0) / len(places)
