"""Spacing and noise of a cloud, and the sizes that a comparison derives from them.

Frame: as viewer.work.comparing.point_cells, file units.
"""

from dataclasses import dataclass

import numpy as np

from ..fits.local import noise_of
from .point_cells import cells_of

_PLACES = 200
"""At which spacing and noise are measured, drawn by area."""
_MIX = ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB), (31, 1))
"""Of :func:`_drawn`: shifts and factors of splitmix64 (Steele, Lea and Flood 2014)."""
_SIZE_STEPS = 10
"""Sizes of a comparison between one and its double: 7 % apart.  Coordinates rounded to the steps of a grid move the estimates
by 0.1 %, and another 0.1 % of a diameter puts every core point elsewhere."""
_NEIGHBOURS = 40
"""Of a place: its density is theirs, and its noise the scatter about a quadric through them."""
_DENSE = 0.2
"""Share of the area in which the points lie dense: scans of one station have most of their points there."""
_EVEN = 1.15
"""Factor by which the median spacing of an even cloud may exceed that of its densest fifth: the scatter of 40 neighbours."""
_FULL = 8
"""Points that a cell of the first, coarse grid holds on the average, at least."""
_MOST = 20_000
"""Points around a place that are looked at: more are thinned by choosing a smaller part of the space."""
POINTS = 31
"""In a cylinder: with as many of each cloud the level of detection is half the noise, 1.96 sqrt(2 / 31)."""
WIDTHS_PER_SCALE = 2.0
"""Diameters of a cylinder in the diameter of the ball that gives its normal, at least: the ball has four times as many points,
so that the error of the normal adds little."""
NOISES_PER_SCALE = 25.0
"""The ball's diameter in units of the noise, at least (Lague et al. 2013, 20 to 25 times the roughness)."""
SCALES_PER_DEPTH = 5.0
"""How far a counterpart is looked for, in diameters of the ball: 0.3 m for scans with 5 mm spacing.  Half and twice
find the changes of tests/unit/work/test_compare.py within the same uncertainty."""
RADIUS_PER_SPACING = 3.0
"""Radius of the points that make a plane for cloud-to-cloud distances, in spacings: 28 points."""


@dataclass(frozen=True)
class CloudScale:
    """spacing: 1 / sqrt(points per area), the median over the area.  noise: standard deviation across the surface, the median
    over the denser half of the area.  fine: spacing where the points lie dense; 0: as ``spacing``.  File units."""

    spacing: float
    noise: float
    fine: float = 0.0


@dataclass(frozen=True)
class Sizes:
    """Of a comparison, file units.  scale: diameter of the ball that gives a normal (D).  diameter: of the cylinder (d).
    depth: how far a counterpart is looked for.  radius: of the points that make a plane (cloud to cloud)."""

    scale: float
    diameter: float
    depth: float
    radius: float


def scale_of(xyz: np.ndarray) -> CloudScale:
    """Spacing and noise of (n, 3) float64 points, none below 0."""
    from scipy.spatial import KDTree

    longest = float(xyz.max())
    if not longest > 0:
        return CloudScale(0.0, 0.0)
    side = 2.0 ** np.floor(np.log2(longest / 128))  # the same where the coordinates were rounded
    cells = cells_of(xyz, side)
    while len(cells.keys) * _FULL > len(xyz) and len(cells.keys) > 8:
        side *= 2
        cells = cells_of(xyz, side)
    spacings, noises = [], []
    for cell in _drawn(cells.keys):
        inside = cells.points[cells.first[cell] : cells.first[cell + 1]]
        place = inside[((inside - inside.mean(axis=0)) ** 2).sum(axis=1).argmin()]
        near = cells.around(place)
        if len(near) < _NEIGHBOURS + 1:
            continue
        if len(near) > _MOST:
            away = np.abs(near - place).max(axis=1)
            near = near[away <= np.partition(away, _MOST)[_MOST]]
        tree = KDTree(near)
        reach = float(np.max(tree.query(place, _NEIGHBOURS + 1)[0]))
        if reach > 0:
            spacings.append(reach * np.sqrt(np.pi / _NEIGHBOURS))
            noises.append(noise_of(near, tree, place[None]))
    if not spacings:
        area = len(cells.keys) * side * side
        return CloudScale(float(np.sqrt(area / len(xyz))), 0.0)
    spacing = float(np.median(spacings))
    dense = np.array(noises)[np.array(spacings) <= spacing]
    fine = min(spacing, _EVEN * float(np.quantile(spacings, _DENSE)))
    return CloudScale(spacing, float(np.median(dense)), fine)


def _drawn(keys: np.ndarray) -> np.ndarray:
    """(_PLACES,) numbers of cells, fewer where there are fewer, by mixing the bits of their keys (c,): where coordinates are
    rounded otherwise, a cell more or less leaves the others drawn."""
    mixed = keys.astype(np.uint64)
    for shift, factor in _MIX:
        mixed = (mixed ^ (mixed >> np.uint64(shift))) * np.uint64(factor)
    return np.argsort(mixed)[:_PLACES]


def sizes_for(*scales: CloudScale) -> Sizes:
    """Default sizes for clouds of these scales: the coarser spacing and the larger noise count.  Cylinders suit the dense
    parts, they are widened in the others; planes suit the median.  Sizes are rounded (_SIZE_STEPS)."""
    spacing, noise = max(scale.spacing for scale in scales), max(scale.noise for scale in scales)
    diameter = _rounded(2 * float(np.sqrt(POINTS / np.pi)) * max(scale.fine or scale.spacing for scale in scales))
    scale = max(WIDTHS_PER_SCALE * diameter, _rounded(NOISES_PER_SCALE * noise))
    return Sizes(scale, diameter, SCALES_PER_DEPTH * scale, _rounded(RADIUS_PER_SPACING * spacing))


def _rounded(size: float) -> float:
    """The nearest of the sizes that are used, by ratio."""
    return float(2.0 ** (round(_SIZE_STEPS * np.log2(size)) / _SIZE_STEPS)) if size > 0 else size
