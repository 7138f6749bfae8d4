"""The height profile of the measured points in a strip along a line.

A station is a piece of the line.  Its height is the median of the topmost connected surface in it: what a surveyor expects of
terrain, and single wrong points do not move it.  The lowest point would be that below a table, the highest a wrong one.  What
hangs above another surface and does not touch the line between the two ends, as a ceiling, is left out.
Frame: relative to a place, axes of the file, file units; heights along the up axis.
"""

from dataclasses import dataclass

import numpy as np

from ...common.errors import InputError
from ...common.progress import progress
from ..fits.measured import InBox
from .hanging_surfaces import hanging
from .height_grid import Grid

WIDTH = 4.0
"""Width of the strip in point spacings: about ten points a station."""
_STEP = 2.5
"""Length of a station in point spacings."""
_STATIONS = 2_000
"""Stations at most."""
_GAP = 3.0
"""Steps in the heights of a station that are larger than so many stations are long lie between two surfaces."""
_LARGEST = 1e100  # of a number in a file; its square is finite


@dataclass(frozen=True)
class Profile:
    """width: of the strip.  step: length of a station, level.  stations: (n) from the first end, level, their middles.
    heights: (n) along the up axis, file coordinates.  counts: (n) of the points in each.  Stations without points are left out.

    Raises InputError where these do not belong together.
    """

    width: float
    step: float
    stations: tuple[float, ...]
    heights: tuple[float, ...]
    counts: tuple[int, ...]

    def __post_init__(self) -> None:
        if not len(self.stations) == len(self.heights) == len(self.counts) > 0:
            raise InputError(f"a profile of {len(self.stations)} stations and {len(self.heights)} heights")
        values = (self.width, self.step, *self.stations, *self.heights, *self.counts)
        if not (np.abs(values) < _LARGEST).all() or self.width <= 0 or self.step <= 0:
            raise InputError("a profile has a value that is no finite number, too large, or below 0")


def measured_profile(in_box: InBox, ends: np.ndarray, spacing: float, up: np.ndarray, width: float | None = None) -> Profile:
    """The profile between two ends, (2, 3) relative to the place of ``in_box``; heights relative to it, too.

    spacing: of the points there.  up: (3,) unit vector.  width: of the strip; None: WIDTH spacings.
    Reports progress, and can be cancelled.  Raises InputError, in one line, where the ends lie above each other, or no points
    lie in the strip.
    """
    way = ends[1] - ends[0]
    along = way - (way @ up) * up
    length = float(np.linalg.norm(along))
    if length <= spacing:
        raise InputError("both ends of this profile lie above each other")
    along /= length
    across = np.cross(up, along)
    width = WIDTH * spacing if width is None else width
    count = int(np.clip(np.ceil(length / max(_STEP * spacing, 1e-9 * length)), 1, _STATIONS))
    step = length / count
    with progress(2, "measuring a profile") as steps:
        half = np.array([length / 2, width / 2, 100 * length])
        xyz = in_box(ends.mean(axis=0), np.array([along, across, up]), half).xyz
        steps.update(1)
        at = np.floor((xyz - ends[0]) @ along / step).astype(np.int64)
        used = (at >= 0) & (at < count)
        at, heights = at[used], xyz[used] @ up
        if len(at) == 0:
            raise InputError("no measured points lie in the strip along this line")
        grid = Grid((count, 1), np.zeros(2), step, np.ones((count, 1)))
        line = ends[0] @ up + (at + 0.5) / count * (way @ up)
        standing = ~hanging(at, heights - line, grid)
        at, heights = at[standing], heights[standing]
        order = np.lexsort((-heights, at))
        at, heights = at[order], heights[order]
        numbers, first = np.unique(at, return_index=True)
        medians, counts = [], []
        for own in np.split(heights, first[1:]):  # from the highest
            steep = np.flatnonzero(-np.diff(own) > _GAP * max(step, width))
            own = own[: steep[0] + 1] if len(steep) else own
            medians.append(float(np.median(own)))
            counts.append(len(own))
        steps.update(1)
    return Profile(width, step, tuple(((numbers + 0.5) * step).tolist()), tuple(medians), tuple(counts))
