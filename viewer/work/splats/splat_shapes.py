"""The splat of each chosen cell: its place, axes, deviations and colour.

A cell with enough points on a plane has the axes and widths of these.  Others look around: at the cells beside it, then at
those of twice and four times the side, until the points there give a plane; the width is then that of the area which the
cell's own points stand for.  Range noise is taken off across the plane, and noise of colours where the cells around show it.
"""

from dataclasses import dataclass

import numpy as np

from ....model.common.linear_light import to_srgb
from ....model.common.process.processors import in_rows
from ...common.progress import Progress
from .shape_loops import shapes
from .splat_budget import Chosen
from .splat_cells import Level

SPREAD = 0.8
"""Standard deviation of a splat in the width of the surface it stands for.  Of 0.6, 0.7 and 0.8 it gave the best PSNR and
SSIM on three registered rooms at a third of their points (kitchen, staircase2, living-room-2); 1 was worse on the last."""
OPACITY = 0.98
"""Opacity of a splat's centre: near 1, since surfaces were measured; at 1 logarithms of files would be infinite."""
FAINT = 0.6
"""Opacity where no plane was found, and of single points off their plane: mostly mixed edges of the scanner's beam."""
LONELY = 1.5
"""Width of such a splat, at most, in the spacing of the points."""
HIGHEST = 3
"""Levels above a cell on which its surroundings are looked at: cells of eight times its side."""
_LEAST_ROWS = 1 << 12
_BLOCK = 1 << 18
"""Splats between two reports of progress: about 0.3 s."""


@dataclass(frozen=True, eq=False)
class Shapes:
    """centre: (k, 3).  axes: (k, 3, 3), columns.  deviations: (k, 3), standard deviations along them.  rgb: (k, 3) sRGB 0..1.
    opacity: (k,) 0..1.  All float64."""

    centre: np.ndarray
    axes: np.ndarray
    deviations: np.ndarray
    rgb: np.ndarray
    opacity: np.ndarray


def shapes_of(levels: list[Level], chosen: Chosen, range_noise: float, colour_noise: np.ndarray, spacing: float,
              meter: Progress | None = None) -> Shapes:  # fmt: skip
    """The splats of the chosen cells of one level.

    range_noise: standard deviation across a surface.  colour_noise: (k,) of a point's luma.  spacing: of the points.
    """
    level, count = levels[chosen.level], len(chosen.cells)
    done, faint = np.zeros(count, bool), np.zeros(count, bool)
    centre, axes, deviations, linear = np.empty((count, 3)), np.empty((count, 3, 3)), np.empty((count, 3)), np.empty((count, 3))
    looks = [(0, 0), *((up, 1) for up in range(HIGHEST + 1) if chosen.level + up < len(levels))]
    for up, reach in looks:
        above = levels[chosen.level + up]
        table = above.table()
        for start in range(0, count, _BLOCK):
            stop = min(start + _BLOCK, count)
            some = slice(start, stop)
            if done[some].all():
                continue
            in_rows(stop - start, _LEAST_ROWS, shapes, chosen.cells[some], level.keys, level.side, level.places, level.colours,
                    up, above.keys, above.side, above.places, above.colours, table, reach, range_noise, colour_noise[some],
                    SPREAD, LONELY * spacing, done[some], faint[some], centre[some], axes[some], deviations[some],
                    linear[some])  # fmt: skip
            if meter is not None and up == 0 and reach == 0:
                meter.update(stop - start)
        if done.all():
            break
    return Shapes(centre, axes, deviations, to_srgb(linear), np.where(faint, FAINT, OPACITY))
