"""Exposure compensation between the stations of all grids of a place.

Each grid's coarse layers are an even sample of its points; a sample of all grids is solved as for one grid
(model.appearance.exposure).  The gains are kept beside the grids, in the cache, and applied when points are read: no grid is
written again where a file comes or goes.  Within a file, exposures were compensated when its grid was built; so a place
differs from one grid in that flight lines and runs of points are compared within their file only, and in that a colour may
be rounded twice.
"""

import math
from collections.abc import Sequence

import numpy as np

from ...preprocess.exposure_compensation import LEAST_CHANGE, SAMPLE
from ...preprocess.point_colour import BLACK_TO_DARK, DARK_LEVEL
from ...preprocess.scan_description import ExposureSummary
from ..scene import Scene, unpack

OF_STATION = 16_384
"""Points of a station, about, that are compared: two that share a room of 6 x 5 x 2.8 m then share 800 voxels, with a
quarter of the points 200, fewer than are needed (model.appearance.exposure.SHARED_VOXELS)."""
MOST_SAMPLED = 6_000_000
"""Points of all stations at most: 250 MB."""


def station_counts(scenes: Sequence[Scene]) -> list[int]:
    """Of each grid the stations that have a gain of their own."""
    return [max(len(scene.meta.scans), 1) for scene in scenes]


def applied_gains(gains: np.ndarray, matched: int, stations: Sequence[int]) -> tuple[list[np.ndarray | None], ExposureSummary]:
    """For each grid (S, 3) gains, None where none is applied; and the summary.  gains: (sum of ``stations``, 3)."""
    applied = bool(np.abs(gains - 1).max() >= LEAST_CHANGE)
    summary = ExposureSummary(len(gains), matched, applied, float(gains.min()), float(gains.max()))
    parts = np.split(gains, np.cumsum(stations)[:-1])
    return [part if applied and np.abs(part - 1).max() >= LEAST_CHANGE else None for part in parts], summary


def solved_gains(scenes: Sequence[Scene], stations: Sequence[int]) -> tuple[np.ndarray, int]:
    """(sum of ``stations``, 3) factors of sRGB values, and of how many stations they could be found.  stations: of each
    grid."""
    from ....model.appearance.exposure import solve_exposures
    from ....model.appearance.spacing import median_spacing

    first, total = np.cumsum([0, *stations]), sum(scene.count for scene in scenes)
    wanted = max(SAMPLE, min(OF_STATION * sum(stations), MOST_SAMPLED))
    parts = []
    for scene, base, own in zip(scenes, first, stations):
        xyz, rgb, _, station = unpack(scene, _sample(scene, wanted * scene.count / total))
        parts.append((xyz, rgb, base + np.minimum(station.astype(np.int64), own - 1)))
    xyz, rgb, station = (np.concatenate([part[k] for part in parts]) for k in range(3))
    gains, found = np.ones((sum(stations), 3)), solve_exposures(xyz, rgb, station, median_spacing(xyz))
    gains[: len(found.gains)] = found.gains
    return gains, int(found.matched.sum())


def has_missing_black(scenes: Sequence[Scene]) -> list[bool]:
    """For each grid whether its black points have no colour.

    A grid decides that by itself where they are many (viewer.preprocess.point_colour).  Where another grid of the place has
    such points, a few suffice: they must only be as much more frequent than dark ones.
    """
    unlit = [scene.unlit for scene in scenes]
    if all(unlit) or not any(unlit):
        return unlit
    total = sum(scene.count for scene in scenes)
    return [known or _exceeds_dark(unpack(scene, _sample(scene, SAMPLE * scene.count / total))[1])
            for scene, known in zip(scenes, unlit)]


def _exceeds_dark(rgb: np.ndarray) -> bool:
    """Whether black points (n, 3) are so frequent among dark ones that black is no colour."""
    highest = rgb.max(axis=1, initial=0)
    black, dark = np.count_nonzero(highest == 0), np.count_nonzero((highest > 0) & (highest <= DARK_LEVEL))
    return bool(black > BLACK_TO_DARK * dark / DARK_LEVEL)


def _sample(scene: Scene, wanted: float) -> slice:
    """About ``wanted`` points, spread evenly: whole coarse layers, or each so many of them."""
    ends = np.asarray(scene.offsets)[:: len(scene.cell_coords)][1:]
    head = int(ends[min(int(np.searchsorted(ends, wanted)), len(ends) - 1)])
    return slice(0, head, max(1, math.ceil(head / max(wanted, 1))))
