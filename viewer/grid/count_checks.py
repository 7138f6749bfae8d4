"""What a person must know about the points after pass 1: none valid, some dropped, coordinates too coarse.  Lengths in file
units."""

from collections.abc import Sequence
from shlex import quote

import numpy as np

from ..errors import InputError
from ..preprocess.valid_positions import FARTHEST
from ..readers.source import Source
from ..text import counted
from .count_points import CellCounts

_DEGREES_FAR, _DEGREES_STEEP = 50.0, 100.0
"""Distance from zero and extent of heights, in extents of x or y, from which x and y are taken for degrees.  Chosen by hand: a
flat site of 100 m in degrees has 10,000 and 500, an upright pole of 0.1 m and 9 m in metres 90 for the heights."""


def check_any_valid(sources: Sequence[Source], counts: CellCounts) -> None:
    """Raises InputError where no point is left."""
    if counts.count:
        return
    name = sources[0].path if len(sources) == 1 else f"{len(sources)} files"
    lost = sum(counts.dropped)
    if lost and lost == counts.dropped[1]:  # without any other point, the distance is counted from zero
        raise InputError(
            f"{name}: all of its {lost:,} points are too far from zero (beyond {FARTHEST:g}) to be places; export it again "
            "with coordinates in metres"
        )
    if lost:
        raise InputError(
            f"{name}: none of its {lost:,} points is valid (not finite, marked invalid or too far from zero); export it again"
        )
    raise InputError(f"{name}: holds no points; export it again")


def drop_warnings(counts: CellCounts) -> list[str]:
    """A warning for each reason for which points were left out."""
    nan, outside, invalid = counts.dropped
    reasons = [
        (nan, "point", "with coordinates that are not finite"),
        (invalid, "point", "marked invalid by the file"),
        (outside, "outlier point", "too far from the rest"),
    ]
    return [f"{counted(n, noun)} {how} left out" for n, noun, how in reasons if n]


def degree_warnings(sources: Sequence[Source], counts: CellCounts) -> list[str]:
    """A warning where x and y are degrees of longitude and latitude: stated by a file, or by the look of the numbers.

    Degrees have a place far from zero compared with an extent that is small compared with that of the heights, which are in
    metres or feet: a degree is 111 km.
    """
    place = counts.bounds.mean(axis=0)
    place = place[[1, 0]] if abs(place[1]) > 90 else place[:2]  # latitude may come first
    path = next((source.path for source in sources if source.units == "degree"), sources[0].path)
    command = f"pointglass export {quote(path.name)} --reproject {utm_of(place)} --out {quote(path.stem + '-utm.laz')}"
    remedy = f"lengths and shapes are wrong; reproject it to metres: {command}"
    stated = [source.path.name for source in sources if source.units == "degree"]
    if stated:
        return [f"{stated[0]}: coordinates in degrees: {remedy}"]
    if any(source.metres_per_unit or source.crs for source in sources) or not like_degrees(counts.bounds):
        return []
    around = ", ".join(f"{value:.4f}" for value in place)
    return [f"{sources[0].path.name}: x and y look like degrees of longitude and latitude (around {around}; heights do not): "
            f"{remedy}"]  # fmt: skip


def like_degrees(bounds: np.ndarray) -> bool:
    """Whether numbers with these bounds, (2, 3), look like degrees and heights in another unit (see degree_warnings)."""
    (x, y, _), (dx, dy, dz) = np.abs(bounds).max(axis=0), np.ptp(bounds, axis=0)
    side = max(dx, dy)
    swapped = x <= 90 < y <= 360  # latitude first
    return bool((swapped or (x <= 360 and y <= 90)) and max(x, y) > _DEGREES_FAR * side and dz > _DEGREES_STEEP * side > 0)


def utm_of(place: np.ndarray) -> str:
    """The EPSG code of the UTM zone (WGS 84) of (longitude, latitude) in degrees."""
    return f"EPSG:{(32600 if place[1] >= 0 else 32700) + int((place[0] + 180) // 6) % 60 + 1}"


def precision_warnings(sources: Sequence[Source], counts: CellCounts, spacing: float | None) -> list[str]:
    """Warnings about files whose coordinates are too large for the type they are stored in.  spacing: None where none could be
    measured because no two positions differ; then the spacing of points spread over the extent tells equal points from points
    that their coordinates cannot tell apart.

    Raises InputError where even float64 is too coarse.
    """
    if spacing is None:
        extent = float(np.ptp(counts.bounds, axis=0).max())
        spacing = float(extent / np.sqrt(counts.count)) if extent > 0 else np.inf
    largest = float(np.abs(counts.bounds).max())
    if counts.count > 1 and largest * 2.0**-52 > spacing / 4:
        raise InputError(
            f"{sources[0].path}: coordinates up to {largest:.3g} cannot hold a point spacing of {spacing:.3g}; "
            "subtract an offset from them first"
        )
    return [
        f"{source.path.name}: stored in too few digits for coordinates up to {largest:.3g}: positions jump by "
        f"{largest * 2 * source.precision:.2g}; export it with an offset or as double"
        for source in sources
        if largest * 2 * source.precision > spacing / 4
    ]
