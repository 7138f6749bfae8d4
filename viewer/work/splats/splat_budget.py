"""Which cells of an octree become splats, for a budget.

A cell is divided where one splat would show it worst: by the variance of colour beyond the noise, by the scatter across its
plane beyond the noise of ranges, times its area as seen from the nearest place where a scanner stood.  The chosen cells
together hold every point once: no surface is left out, whatever the budget.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from ....model.common.process.processors import in_rows
from .shape_loops import flatness
from .splat_cell_loops import gathered_bits
from .splat_cells import Level

RELIEF = 0.01
"""Colour variance (sRGB 0..1) that a cell filled in all directions counts for, beyond its own.  With half and
twice of this and of PLAIN surfaces have no holes and the budget holds (tests/unit/work/test_splats.py)."""
PLAIN = 2e-4
"""Colour variance that every cell counts for, so that plain walls are divided too: 1.4 % of full scale."""
CHANNELS = 1.5
"""Variance of a channel's noise in that of luma: 1 where channels err alike, 2.2 where they err independently."""
NEAR = 0.5
"""Distance from a viewpoint, in the median distance of the cells, within which nearer counts for little more.  With 1
there are 2.4 times as many splats near as far in tests/unit/work/test_splats.py, with 0.5 and 0.25 over 3 times."""
TIES = 4.0
"""Factor within which errors are spread by a hash of the cell.  Alike cells, as of a plain wall, would be divided all at once,
and much of the budget be left over.  Where nothing else differs, a level has 4 times the error of the one below.  On five
registered rooms it changed PSNR by -0.06 to 0.08 dB."""
_LEAST_ROWS = 1 << 13
_BINS = 8192
"""Steps of a histogram of errors, by equal factors."""


@dataclass(frozen=True, eq=False)
class Chosen:
    """level: number of the level.  cells: (k,) int64 ascending, of that level."""

    level: int
    cells: np.ndarray


def gathered(keys: np.ndarray) -> np.ndarray:
    """(c,) int64 numbers along an axis, of Morton keys whose lowest bit is that axis'."""
    plain: Any = gathered_bits
    return plain.py_func(keys)


def centres_of(level: Level) -> np.ndarray:
    """(c, 3) float64 mean positions of the points of the cells."""
    numbers = np.stack([gathered(level.keys >> axis) for axis in range(3)], axis=1)
    return (numbers + 0.5) * level.side + level.places[:, 1:4]


def errors_of(level: Level, viewpoints: np.ndarray, reach: float, range_noise: float, colour_noise: np.ndarray) -> np.ndarray:
    """(c,) float32: how badly one splat would show each cell.

    viewpoints: (s, 3), where scanners stood; none: all cells count alike.  reach: distance within which nearer counts for
    little more.  range_noise: standard deviation across a surface.  colour_noise: (c,) standard deviation of a point's luma.
    """
    count, known = level.places[:, 0], level.colours[:, 0]
    colour = level.colours[:, 7] / (3 * np.maximum(known, 1)) - CHANNELS * colour_noise**2
    relief = np.zeros(len(level), np.float32)
    in_rows(len(level), _LEAST_ROWS, flatness, level.places, level.side, range_noise, relief)
    error = np.maximum(colour, 0) + RELIEF * relief + PLAIN
    error[count < 2] = PLAIN
    mixed = (level.keys.astype(np.uint64) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(40)
    uneven = TIES ** (mixed / 2.0**24)
    return (error * level.side**2 * seen_share(centres_of(level), viewpoints, reach) * uneven).astype(np.float32)


def seen_share(places: np.ndarray, viewpoints: np.ndarray, reach: float) -> np.ndarray:
    """(n,) weights 0..1: 1 near a viewpoint, falling with the square of the distance."""
    if len(viewpoints) == 0:
        return np.ones(len(places))
    return 1 / (1 + (distances(places, viewpoints) / reach) ** 2)


def distances(places: np.ndarray, viewpoints: np.ndarray) -> np.ndarray:
    """(n,) distances to the nearest of the viewpoints (s, 3)."""
    from scipy.spatial import KDTree

    return KDTree(viewpoints).query(places)[0]


def choose(levels: list[Level], errors: list[np.ndarray], budget: int) -> list[Chosen]:
    """At most ``budget`` cells, at least one, that together hold every point once.

    A cell is divided where its error, or that of a cell inside it, is above one threshold for all: the lowest that keeps the
    budget.  errors: of each level, (c,) > 0.
    """
    closed = [np.asarray(errors[0], np.float64)]
    for level, own in zip(levels[1:], errors[1:]):
        assert level.child is not None
        closed.append(np.maximum(own, np.maximum.reduceat(closed[-1], level.child[:-1])))
    above = [np.repeat(up, np.diff(level.child)) for level, up in zip(levels[1:], closed[1:]) if level.child is not None]
    above.append(np.array([np.inf]))
    threshold = _threshold(closed, above, budget)
    chosen = []
    for number, (own, up) in enumerate(zip(closed, above)):
        cells = np.flatnonzero((up > threshold) & ((own <= threshold) | (number == 0)))
        if len(cells):
            chosen.append(Chosen(number, cells))
    return chosen


def _threshold(closed: list[np.ndarray], above: list[np.ndarray], budget: int) -> float:
    """The lowest step of the histogram at which the number of chosen cells keeps the budget."""
    low, high = min(float(own.min()) for own in closed), float(closed[-1][0])
    edges = np.geomspace(low * 0.999, high * 1.001, _BINS + 1)
    count = np.zeros(_BINS + 1, np.int64)  # chosen cells where the threshold is an edge
    for number, (own, up) in enumerate(zip(closed, above)):
        # a cell is chosen for thresholds from its own error up to below that of the cell around it
        begins = np.zeros(len(own), np.int64) if number == 0 else np.searchsorted(edges, own, "left")
        ends = np.searchsorted(edges, up, "left")
        count += np.bincount(begins, minlength=_BINS + 1)
        count -= np.bincount(ends[ends <= _BINS], minlength=_BINS + 1)
    fits = np.flatnonzero(np.cumsum(count) <= budget)
    return float(edges[fits[0]])
