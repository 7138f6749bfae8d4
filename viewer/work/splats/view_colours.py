"""How the colour of splats changes with the direction they are seen from, by what several stations saw.

In cells of a lattice, wider than splats are, the mean colours of the stations are fitted by a linear function of the direction
from the station, a ridge regression; between the middles of cells its values are interpolated.  Where one station alone saw a
surface, nothing changes.  Frame: file coordinates, file units; directions are unit vectors from the eye to the splat, as
spherical harmonics take them.
"""

from dataclasses import dataclass

import numpy as np

CELL = 20.0
"""Side of the cells, in the spacing of the points."""
PRIOR = 0.05
"""Standard deviation of the slope, sRGB 0..1 by unit of the direction, that the ridge regression expects.  0.1 gained 0.3 dB
more on kitchen and cost more SSIM on bathroom."""
FLOOR = 0.02
"""Standard deviation of a station's mean colour beyond its noise: two stations hit other points of a texture."""
FEWEST = 4
"""Points of a station in a cell, at least, for it to count."""
MOST_POINTS = 6_000_000
"""Points that are looked at: 500 bytes of memory each at worst."""
_BLOCK = 1 << 18
"""Splats whose cells are looked up at a time."""


@dataclass(frozen=True, eq=False)
class ViewColours:
    """slope: (n, 3, 3) float32, [axis, channel], change of sRGB 0..1 by direction.  offset: (n, 3) float32, that change in the
    mean of the directions in which the stations saw the place."""

    slope: np.ndarray
    offset: np.ndarray


def view_colours(xyz: np.ndarray, coloured: np.ndarray, station: np.ndarray, places: np.ndarray, side: float,
                 centres: np.ndarray) -> ViewColours | None:  # fmt: skip
    """The change of colour at ``centres`` (n, 3); None where fewer than two stations are known.

    xyz: (N, 3).  coloured: (N, 4) uint8, sRGB and 1 where the point has a colour.  station: (N,) rows of ``places`` (S, 3), NaN
    where unknown.  side: of the cells.
    """
    known = np.asarray(np.isfinite(places).all(axis=1))
    if known.sum() < 2:
        return None
    step = -(-len(xyz) // MOST_POINTS)
    xyz, coloured, station = xyz[::step], coloured[::step], station[::step].astype(np.int64)
    kept = (station < len(places)) & (coloured[:, 3] > 0)
    kept[kept] &= known[station[kept]]
    xyz, station, srgb = xyz[kept], station[kept], coloured[kept, :3] / 255.0
    if len(np.unique(station)) < 2:
        return None
    lattice = _Lattice(xyz.min(axis=0) - side, side, np.floor(np.ptp(xyz, axis=0) / side).astype(np.int64) + 4)
    pairs, pair = np.unique(lattice.keys(lattice.numbers(xyz)) * len(places) + station, return_inverse=True)

    def summed(values: np.ndarray, rows: np.ndarray, count: int) -> np.ndarray:
        columns = values.reshape(len(values), -1)
        found = np.stack([np.bincount(rows, columns[:, k], minlength=count) for k in range(columns.shape[1])], axis=1)
        return found.reshape(count, *values.shape[1:])

    held = np.bincount(pair).astype(np.float64)
    colour, place = summed(srgb, pair, len(pairs)), summed(xyz, pair, len(pairs))
    squares = summed((srgb**2).sum(axis=1), pair, len(pairs))
    cells, cell = np.unique(pairs // len(places), return_inverse=True)
    count = len(cells)
    total = summed(held, cell, count)
    middle, mean = summed(place, cell, count) / total[:, None], summed(colour, cell, count) / total[:, None]
    variance = np.maximum(summed(squares, cell, count) / total - (mean**2).sum(axis=1), 0) / 3
    direction = middle[cell] - places[pairs % len(places)]
    direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-12)
    weight = np.where(held >= FEWEST, 1 / (variance[cell] / held + FLOOR**2), 0.0)
    whole = np.maximum(summed(weight, cell, count), 1e-12)[:, None]
    off = direction - (summed(weight[:, None] * direction, cell, count) / whole)[cell]
    colour /= held[:, None]
    change = colour - (summed(weight[:, None] * colour, cell, count) / whole)[cell]
    weighed = weight[:, None] * off
    matrix = summed(weighed[:, :, None] * off[:, None], cell, count) + np.eye(3) / PRIOR**2
    slope = np.linalg.solve(matrix, summed(weighed[:, :, None] * change[:, None], cell, count))
    seen = summed(held[:, None] * direction, cell, count) / total[:, None]
    values = np.concatenate([slope.reshape(count, 9), np.einsum("ca,cak->ck", seen, slope)], axis=1)
    found = np.concatenate([lattice.interpolated(cells, values, centres[start : start + _BLOCK])
                            for start in range(0, len(centres), _BLOCK)])  # fmt: skip
    return ViewColours(found[:, :9].reshape(-1, 3, 3), found[:, 9:])


@dataclass(frozen=True, eq=False)
class _Lattice:
    """Cells of one ``side`` from ``low`` on, ``shape`` of them along the axes."""

    low: np.ndarray
    side: float
    shape: np.ndarray

    def numbers(self, xyz: np.ndarray) -> np.ndarray:
        return np.floor((xyz - self.low) / self.side).astype(np.int64)

    def keys(self, numbers: np.ndarray) -> np.ndarray:
        return (numbers[:, 0] * self.shape[1] + numbers[:, 1]) * self.shape[2] + numbers[:, 2]

    def interpolated(self, cells: np.ndarray, values: np.ndarray, centres: np.ndarray) -> np.ndarray:
        """(n, k) float32: of values (c, k) in the middles of cells, keys ascending; missing cells do not count."""
        whole = np.floor((centres - self.low) / self.side - 0.5).astype(np.int64)
        share = (centres - self.low) / self.side - 0.5 - whole
        total, found = np.zeros(len(centres)), np.zeros((len(centres), values.shape[1]))
        for corner in np.ndindex(2, 2, 2):
            numbers = whole + corner
            key = self.keys(numbers)
            at = np.minimum(np.searchsorted(cells, key), len(cells) - 1)
            weight = np.where(corner, share, 1 - share).prod(axis=1)
            weight *= (cells[at] == key) & ((numbers >= 0) & (numbers < self.shape)).all(axis=1)
            total += weight
            found += weight[:, None] * values[at]
        return (found / np.maximum(total, 1e-9)[:, None]).astype(np.float32)
