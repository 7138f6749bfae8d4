"""What a person must know about the points after pass 1: none valid, some dropped, coordinates too coarse.  Lengths in file
units."""

from collections.abc import Sequence
from shlex import quote

import numpy as np

from ...common.errors import InputError
from ...common.text import counted
from ...preprocess.scan_description import ScanWarning, WarningTopic
from ...preprocess.valid_positions import FARTHEST
from ...readers.source import Source
from .count_points import CellCounts
from .degrees import like_degrees, utm_of


def check_any_valid(sources: Sequence[Source], counts: CellCounts) -> None:
    """Raises InputError where no point is left."""
    if counts.count:
        return
    of = sources[0].path if len(sources) == 1 else f"{len(sources)} files"
    lost = sum(counts.dropped)
    if lost and lost == counts.dropped[1]:  # without any other point, the distance is counted from zero
        raise InputError(f"all of its {lost:,} points are too far from zero (beyond {FARTHEST:g}) to be places", file=of,
                         remedy="export it again with coordinates in metres")
    if lost:
        raise InputError(f"none of its {lost:,} points is valid (not finite, marked invalid or too far from zero)", file=of,
                         remedy="export it again")
    raise InputError("holds no points", file=of, remedy="export it again")


def drop_warnings(counts: CellCounts) -> list[str]:
    """A warning for each reason for which points were left out."""
    nan, outside, invalid = counts.dropped
    reasons = [
        (nan, "point", "with coordinates that are not finite"),
        (invalid, "point", "marked invalid by the file"),
        (outside, "outlier point", "too far from the rest"),
    ]
    return [f"{counted(n, noun)} {how} left out" for n, noun, how in reasons if n]


def degree_warnings(sources: Sequence[Source], counts: CellCounts) -> list[ScanWarning]:
    """A warning where x and y are degrees of longitude and latitude: stated by a file, or by the look of the numbers
    (viewer.grid.building.degrees)."""
    place = counts.bounds.mean(axis=0)
    place = place[[1, 0]] if abs(place[1]) > 90 else place[:2]  # latitude may come first
    path = next((source.path for source in sources if source.units == "degree"), sources[0].path)
    command = f"pointglass export {quote(path.name)} --reproject {utm_of(place)} --out {quote(path.stem + '-utm.laz')}"
    stated = [source.path.name for source in sources if source.units == "degree"]
    if stated:
        return [ScanWarning(command, WarningTopic.DEGREES, f"{stated[0]}: coordinates in degrees: ")]
    if any(source.metres_per_unit or source.crs for source in sources) or not like_degrees(counts.bounds, sources[0]):
        return []
    around = ", ".join(f"{value:.4f}" for value in place)
    seems = f"{sources[0].path.name}: x and y look like degrees of longitude and latitude (around {around}; heights do not): "
    return [ScanWarning(command, WarningTopic.DEGREES, seems)]


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
        raise InputError(f"coordinates up to {largest:.3g} cannot hold a point spacing of {spacing:.3g}", file=sources[0].path,
                         remedy="subtract an offset from them first")
    return [
        f"{source.path.name}: stored in too few digits for coordinates up to {largest:.3g}: positions jump by "
        f"{largest * 2 * source.precision_within(counts.bounds):.2g}; export it with an offset or as double"
        for source in sources
        if largest * 2 * source.precision_within(counts.bounds) > spacing / 4
    ]
