"""Where a cylinder's fit begins: the best of many cylinders through two points and their normals, one of them at the click.

Method: random samples as in Schnabel, Wahl and Klein 2007, section 4.1, with one point near the click, at several sizes of
neighbourhood: a small one sees too little bend, a large one holds other things.
"""

from dataclasses import dataclass

import numpy as np

from .fit_loops import explained
from .surfaces import Cylinder

SAMPLES = 400
FLATTEST = 6.0
"""Largest radius, in half sides of the box: its points then show 20 degrees of bend."""
SCORED = 500
"""Points that each sample is compared with."""
_TURNED = np.cos(np.radians(30.0))
"""Normals may differ so far from the cylinder's, several times what noise does to them.  With 15 and 45 degrees the pipes of
tests/unit/work/test_fits.py are fitted within the same bounds."""
_BENT = np.sin(np.radians(12.0))
"""Two normals must differ by more than this, to tell an axis."""


@dataclass(frozen=True, eq=False)
class Start:
    """score: the share of points that the cylinder explains."""

    cylinder: Cylinder
    score: float


def cylinder_start(points: np.ndarray, normals: np.ndarray, near: np.ndarray, tolerance: float, half: float,
                   rng: np.random.Generator) -> Start | None:
    """The cylinder that explains most points, None where no sample makes one.

    points, normals: (n, 3).  near: numbers of the points at the click, which it must pass.  tolerance: distance from its
    surface within which points count.  half: half the side of the box that the points are from.
    """
    first = rng.choice(near, SAMPLES)
    second = rng.integers(0, len(points), SAMPLES)
    axis = np.cross(normals[first], normals[second])
    bend = np.linalg.norm(axis, axis=1)
    use = bend > _BENT
    if not use.any():
        return None
    first, second, axis = first[use], second[use], axis[use] / bend[use, None]
    # In the plane across the axis the two normals' lines p + t n meet in the centre.
    n, m = normals[first], normals[second]
    way = points[second] - points[first]
    way = way - np.einsum("si,si->s", way, axis)[:, None] * axis
    nn = np.einsum("si,si->s", n, m)
    sine = 1.0 - nn**2
    t = (np.einsum("si,si->s", way, n) - nn * np.einsum("si,si->s", way, m)) / sine
    s = (nn * np.einsum("si,si->s", way, n) - np.einsum("si,si->s", way, m)) / sine
    radius = 0.5 * (np.abs(t) + np.abs(s))
    alike = np.abs(np.abs(t) - np.abs(s)) < np.maximum(0.3 * radius, 3 * tolerance)
    alike &= (radius > tolerance) & (radius < FLATTEST * half)
    if not alike.any():
        return None
    centre, axis, radius = (points[first] + t[:, None] * n)[alike], axis[alike], radius[alike]
    some = rng.permutation(len(points))[:SCORED]
    counts = explained(points[some], normals[some], centre, axis, radius, tolerance, _TURNED)
    best = int(counts.argmax())
    return Start(Cylinder(centre[best], axis[best], float(radius[best])), float(counts[best] / len(some)))
