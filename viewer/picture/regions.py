"""Regions: sets of points that a person keeps by a name, and points that have been classified anew.

The files never change: a region is hidden in pictures and left out of exports, a class is written on export.
"""

from dataclasses import dataclass

from ..common.errors import InputError
from .point_sets import PointSet

LAST_CLASS = 255
"""Of LAS 1.4, point formats 6 to 10; earlier formats have classes up to 31."""

MOST_CHANGES = 126
"""Classes that points can be given at once: each takes two of the 256 marks of a point, selected or not."""


@dataclass(frozen=True)
class Region:
    """name: for people.  shown: whether its points are drawn, measured and exported.  A point of several regions is drawn where
    all of them are shown."""

    name: str
    points: PointSet
    shown: bool = True


@dataclass(frozen=True)
class ClassChange:
    """code: the class that the points have now, 0 to 255, of ASPRS LAS or the user's own.  Raises InputError for another."""

    code: int
    points: PointSet

    def __post_init__(self) -> None:
        if not 0 <= self.code <= LAST_CLASS:
            raise InputError(f"class {self.code}: expected a whole number from 0 to {LAST_CLASS}")


def hidden_regions(regions: tuple[Region, ...]) -> tuple[Region, ...]:
    """Those that are not shown."""
    return tuple(region for region in regions if not region.shown)
