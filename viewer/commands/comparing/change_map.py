"""Distances seen through a scan: of every pixel the surface whose change exceeds its uncertainty most, along its line of view.

Orthographic along an axis of the file, so that a change inside a room is seen from outside.  Frame: file coordinates.
"""

from dataclasses import dataclass

import numpy as np

from ...work.comparing.distance_statistics import NO_COUNTERPART, colours_of

VIEWS = {"from above": (0, 1, 2), "front (looking along y)": (0, 2, 1), "side (looking along x)": (1, 2, 0)}
"""Title -> axes of the file to the right, upwards and along the line of view."""
_SIDE = 900
"""Pixels of the longer side, at most."""
_SPACINGS = 2.0
"""A pixel in point spacings, at least: four points of one surface."""
_SLICES = 128
"""Along the line of view at most; points of one slice of a pixel are taken for one surface."""
_STRAY = 0.0005
"""Share of the points beyond each edge of the map."""
_MOSTLY = 0.5
"""Share of a pixel's points without a counterpart from which it shows that."""
_BACKGROUND = (255, 255, 255)


@dataclass(frozen=True, eq=False)
class ChangeMap:
    """rgb: (H, W, 3) uint8, row 0 at the top.  left, right, bottom, top: file coordinates of its edges."""

    rgb: np.ndarray
    left: float
    right: float
    bottom: float
    top: float


def change_map(xyz: np.ndarray, distance: np.ndarray, uncertainty: np.ndarray, axes: tuple[int, int, int], spacing: float,
               limit: float) -> ChangeMap:  # fmt: skip
    """xyz: (n, 3).  distance, uncertainty: (n,), NaN without a counterpart.  axes: of VIEWS.  limit: where the colours end."""
    some = xyz[:: max(len(xyz) // 200_000, 1)]
    low, high = np.quantile(some, (_STRAY, 1 - _STRAY), axis=0)
    across, up, along = axes
    extent = np.maximum(high - low, 1e-12)
    pixel = max(float(max(extent[across], extent[up])) / _SIDE, _SPACINGS * spacing, 1e-12)
    width, height = (int(extent[axis] / pixel) + 1 for axis in (across, up))
    inside = ((xyz >= low) & (xyz <= high)).all(axis=1)
    xyz, distance, uncertainty = xyz[inside], distance[inside], uncertainty[inside]
    column = ((xyz[:, across] - low[across]) / pixel).astype(np.int64)
    row = height - 1 - ((xyz[:, up] - low[up]) / pixel).astype(np.int64)
    at = row * width + column
    known = np.isfinite(distance)
    everything, unknown = (np.bincount(at[mask], minlength=width * height) for mask in (slice(None), ~known))
    slices = int(np.clip(extent[along] / pixel, 1, _SLICES))
    deep = np.minimum((xyz[known, along] - low[along]) / extent[along] * slices, slices - 1).astype(np.int64)
    values = np.full((2, width * height), np.nan)
    _largest(at[known] * slices + deep, distance[known], uncertainty[known], slices, values)
    rgb = np.empty((width * height, 3), np.uint8)
    rgb[:] = _BACKGROUND
    shown = np.isfinite(values[0])
    rgb[shown] = colours_of(values[0, shown], values[1, shown], limit)
    rgb[unknown > _MOSTLY * np.maximum(everything, 1)] = NO_COUNTERPART
    return ChangeMap(rgb.reshape(height, width, 3), float(low[across]), float(low[across] + width * pixel), float(low[up]),
                     float(low[up] + height * pixel))  # fmt: skip


def _largest(key: np.ndarray, distance: np.ndarray, uncertainty: np.ndarray, slices: int, values: np.ndarray) -> None:
    """Sets ``values`` (2, pixels), mean distance and uncertainty, of each pixel, key // slices: those of the slice whose
    distance exceeds its uncertainty most, or, where none does, of the slice with the smallest uncertainty."""
    if not len(key):
        return
    order = np.argsort(key)
    key = key[order]
    first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]]))
    counts = np.diff(np.append(first, len(key)))
    mean, unsure = (np.add.reduceat(each[order], first) / counts for each in (distance, uncertainty))
    beyond = np.abs(mean) - unsure
    by_size = np.argsort(np.where(beyond > 0, beyond, -unsure), kind="stable")
    values[:, (key[first] // slices)[by_size]] = mean[by_size], unsure[by_size]  # the last one stays
