"""Exposure compensation between the stations of all grids of a place.

What is compared is measured once for each grid (viewer.grid.place.station_colours).  The gains are kept beside the grids, in
the cache, and applied when points are read: no grid is written again where a file comes or goes.  Within a file, exposures were
compensated when its grid was built; so a place differs from one grid in that flight lines and runs of points are compared
within their file only, and in that a colour may be rounded twice.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...preprocess.exposure_compensation import LEAST_CHANGE
from ...preprocess.scan_description import ExposureSummary
from ..scene import Scene
from .station_colours import station_colours


def station_counts(scenes: Sequence[Scene]) -> list[int]:
    """Of each grid the stations that have a gain of their own."""
    return [max(len(scene.meta.scans), 1) for scene in scenes]


def applied_gains(gains: np.ndarray, matched: int, stations: Sequence[int]) -> tuple[list[np.ndarray | None], ExposureSummary]:
    """For each grid (S, 3) gains, None where none is applied; and the summary.  gains: (sum of ``stations``, 3)."""
    applied = bool(np.abs(gains - 1).max() >= LEAST_CHANGE)
    summary = ExposureSummary(len(gains), matched, applied, float(gains.min()), float(gains.max()))
    parts = np.split(gains, np.cumsum(stations)[:-1])
    return [part if applied and np.abs(part - 1).max() >= LEAST_CHANGE else None for part in parts], summary


def solved_gains(scenes: Sequence[Scene], folders: Sequence[Path], stations: Sequence[int]) -> tuple[np.ndarray, int]:
    """(sum of ``stations``, 3) factors of sRGB values, and of how many stations they could be found.  stations: of each
    grid."""
    from ....model.appearance.exposure import solve_stations

    found = station_colours(scenes, folders, stations)
    gains, matched = solve_stations([station for grid in found for station in grid.stations()])
    return gains, int(matched.sum())


def has_missing_black(scenes: Sequence[Scene], folders: Sequence[Path]) -> list[bool]:
    """For each grid whether its black points have no colour.

    A grid decides that by itself where they are many (viewer.preprocess.point_colour).  Where another grid of the place has
    such points, a few suffice: they must only be as much more frequent than dark ones.
    """
    unlit = [scene.unlit for scene in scenes]
    if all(unlit) or not any(unlit):
        return unlit
    found = station_colours(scenes, folders, station_counts(scenes))
    return [known or grid.frequent_black for known, grid in zip(unlit, found)]
