"""The files that a scene was read from, which points are of each, and scenes whose points lie in places far apart.

Frame: file coordinates.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from ..grid.place.joined_points import JoinedPoints
from .places.standing_place import SceneSample

if TYPE_CHECKING:
    from ..grid.scene import Scene

Sample = TypeVar("Sample", bound=SceneSample)

LAST_NUMBER = 255
"""Number of a packed point that all later files and stations share, so that these cannot be told apart in the grid."""
_CELLS = 64
"""Cells along the longest side of a scene in which places are told apart: gaps of 1.6 % of its extent."""
_SMALL = 0.1
"""Extent of a place, as a share of the whole, below which the view begins there: of a picture of the whole, 720 rows high, it
would take 72.  Six scans are one place with this, half and twice of it: pieces of one survey do not come near the limit."""
_LEAST = 500
"""Points of the sample that make a place: a few control points are none."""
_MOST_READ = 4_000_000
"""Points, the coarsest layers first, among which those of one file are looked for."""


@dataclass(frozen=True)
class FilePart:
    """One file of a scene.  numbers: of its stations, as in ``Scene.meta.scans``.  has_grid: whether it has a grid of its own.
    apart: whether its points have numbers of their own in the grid.  can_hide: whether it can be hidden alone."""

    path: str
    numbers: range
    has_grid: bool = False

    @property
    def apart(self) -> bool:
        return len(self.numbers) > 0 and self.numbers[-1] < LAST_NUMBER

    @property
    def can_hide(self) -> bool:
        return self.apart or self.has_grid


def files_of(scene: "Scene") -> list[FilePart]:
    """The files of a scene, in order; empty where the grid does not say which points are of which."""
    sources, records = scene.meta.sources, scene.meta.records
    counts = () if records is None else records.scans
    if len(counts) != len(sources):
        counts = (1,) * len(sources) if len(scene.meta.scans) == len(sources) else ()
    ends = np.cumsum([0, *counts]).tolist()
    alone = isinstance(scene.points, JoinedPoints) and scene.points.table.grids == len(sources)
    return [FilePart(source, range(first, last), alone) for source, first, last in zip(sources, ends, ends[1:])]


def sample_of_file(scene: "Scene", seen: Sample, part: FilePart) -> Sample | None:
    """The sample with the points of one file only; None where the coarse layers hold too few of them."""
    from ..grid.scene import packed, scan_numbers, unpack

    some = slice(0, min(scene.count, _MOST_READ))
    number = scan_numbers(packed(scene, some))
    index = np.flatnonzero((number >= part.numbers[0]) & (number <= part.numbers[-1]))
    if len(index) < 8:
        return None
    points, rgb, _, _ = unpack(scene, index[:: max(1, len(index) // 100_000)])
    return _with_points(seen, points, rgb.max(axis=1).astype(np.float32) / 255)


def main_place(seen: Sample) -> tuple[Sample, int]:
    """The sample of the place with most points where the points lie in small places far apart, else ``seen``; and the number of
    places, 1 where they are not far apart."""
    from scipy import ndimage

    chosen, places = np.arange(len(seen.points)), 1
    for _ in range(3):
        points = seen.points[chosen]
        low, extent = points.min(axis=0), np.ptp(points, axis=0)
        if len(points) < _LEAST or extent.max() <= 0:
            break
        cells = np.minimum((points - low) / (extent.max() / _CELLS), _CELLS - 1).astype(np.int64)
        filled = np.zeros((_CELLS,) * 3, bool)
        filled[tuple(cells.T)] = True
        labels = np.empty(filled.shape, np.int32)
        ndimage.label(filled, np.ones((3, 3, 3)), output=labels)
        of_point = labels[tuple(cells.T)]
        counts = np.bincount(of_point)
        largest = np.flatnonzero(of_point == counts.argmax())
        small = np.linalg.norm(np.ptp(points[largest], axis=0)) < _SMALL * np.linalg.norm(extent)
        if len(largest) < _LEAST or not small:
            break
        places = max(places, int((counts >= _LEAST).sum()))
        chosen = chosen[largest]
    if len(chosen) == len(seen.points):
        return seen, 1
    return _with_points(seen, seen.points[chosen], seen.level[chosen]), places


def _with_points(seen: Sample, points: np.ndarray, level: np.ndarray) -> Sample:
    low, high = np.percentile(points, [1.0, 99.0], axis=0)
    diagonal = max(float(np.linalg.norm(high - low)), 10 * seen.spacing)
    return replace(seen, points=points, level=level, low=low, high=high, diagonal=diagonal)
