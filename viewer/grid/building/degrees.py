"""Whether x and y are degrees of longitude and latitude, although no file states it: by the look of the numbers.

A degree is 111 km, and heights are in metres or feet.  In degrees everything is therefore steep: heights rise by hundreds to
millions of units per unit of x and y.  On a scan in metres that holds for walls, masts and poles only, and there the
distance of neighbours in x and y is at least the noise of the scanner.
"""

from itertools import islice

import numpy as np

from ...readers.source import Source

_FAR, _STEEP = 50.0, 100.0
"""Distance from zero and extent of heights, in extents of x or y, from which both together mean degrees.  The
limits are below those of a flat site of 100 m in degrees, 10,000 and 500; an upright pole of 0.1 m and 9 m in metres has 90 for
the heights."""
_IMPOSSIBLE = 1000.0
"""Extent of heights in extents of x or y that no scan in metres has: an object of 1 cm would be 10 m high."""
_FLATTEST = 1.0
"""Extent of heights in degrees of extent below which no area is that flat: 1 m in 111 km.  Points are not looked at."""
_SLOPE = 200.0
"""Median rise between neighbours in a file from which x and y are degrees: between the 220 of 2 cm of roughness from point to
point 10 m apart, and the 50 of a mast of which a scanner with 1 mm of noise took a point each 50 mm."""
_SAMPLE, _RUN = 8192, 64
"""Points of a sample, and of its runs."""


def like_degrees(bounds: np.ndarray, source: Source | None) -> bool:
    """Whether numbers with these bounds, (2, 3), look like degrees and heights in another unit.

    source: of the points, or the first of several; a sample of it is read where the bounds alone do not tell.  None:
        there are no points, the bounds decide.
    """
    (x, y, _), (dx, dy, dz) = np.abs(bounds).max(axis=0), np.ptp(bounds, axis=0)
    side = max(dx, dy)
    swapped = x <= 90 < y <= 360  # latitude first
    if not (swapped or (x <= 360 and y <= 90)) or not side > 0:
        return False
    far = max(x, y) / side
    if far <= 1 or dz <= _FLATTEST * side:  # such as a room around zero
        return False
    if (far > _FAR and dz > _STEEP * side) or dz > _IMPOSSIBLE * side:
        return True
    return source is not None and median_slope(source) > _SLOPE


def median_slope(source: Source) -> float:
    """Median of the rise between points that follow each other in the file, in units of height per unit of x and y; 0 where
    there are no two such points at different places."""
    rises = []
    for chunk in source.sample(_SAMPLE, _RUN) or islice(source.chunks(), 1):
        with np.errstate(invalid="ignore", over="ignore"):
            steps = np.diff(chunk.xyz[: 4 * _SAMPLE], axis=0)
            across = np.hypot(steps[:, 0], steps[:, 1])
        usable = np.isfinite(steps).all(axis=1) & (across > 0)
        rises.append(np.abs(steps[usable, 2]) / across[usable])
    found = np.concatenate(rises) if rises else np.zeros(0)
    return float(np.median(found)) if len(found) else 0.0


def utm_of(place: np.ndarray) -> str:
    """The EPSG code of the UTM zone (WGS 84) of (longitude, latitude) in degrees."""
    return f"EPSG:{(32600 if place[1] >= 0 else 32700) + int((place[0] + 180) // 6) % 60 + 1}"
