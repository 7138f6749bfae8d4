"""Compiled loops: flatness of cells, and the place, axes and colour of a splat from the moments of cells.

Frame and moments: as in viewer.work.splats.splat_cell_loops.  Reference implementation: tests/unit/work/plain_splats.py.
"""

import math

import numpy as np

from ....model.common.jit import compiled
from ..comparing.cell_search import place_of
from ..comparing.local_plane import principal_axes
from .splat_cell_loops import COLOURS, MOMENTS, add_colours, add_places, gathered_bits, morton

FEWEST = 6
"""Points whose spread gives a splat its axes, at least (local_plane.FEWEST)."""
FLAT = 0.02
"""Share of a cell's area that the points' second axis must spread over, else they are taken for a line: a wider neighbourhood
decides."""
LEAST_WIDTH = 0.5
"""Width of a splat, at least, in the side of its cell, where its neighbourhood gives its size."""
STRAY = 4.0
"""Standard deviations of the points around off their plane, from which a place of few points is taken for a stray."""
FEW = 3
"""Points of a stray place, at most: mixed edges give single points."""
THIN = 0.05
"""Standard deviation across a splat's plane, at least, in that along it."""


@compiled(nogil=True)
def flatness(places, side, noise, relief, begin, end):
    """relief: (c,) float32, result for the cells begin..end: variance across the plane of the points beyond the noise's, in
    that of a cell that is filled, 0..1; 0 for fewer than 4 points."""
    matrix, axes = np.empty((3, 3)), np.empty((3, 3))
    full = side * side / 12
    for cell in range(begin, end):
        row = places[cell]
        if row[0] < 4:
            relief[cell] = 0.0
            continue
        n = row[0]
        matrix[0, 0], matrix[1, 1], matrix[2, 2] = row[4] / n, row[7] / n, row[9] / n
        matrix[0, 1] = matrix[1, 0] = row[5] / n
        matrix[0, 2] = matrix[2, 0] = row[6] / n
        matrix[1, 2] = matrix[2, 1] = row[8] / n
        principal_axes(matrix, axes)
        least = min(matrix[0, 0], matrix[1, 1], matrix[2, 2])
        relief[cell] = min(max(least - noise * noise, 0.0) / full, 1.0)


@compiled(nogil=True)
def shapes(cells, keys, side, places, colours, up, up_keys, up_side, up_places, up_colours, table, reach, noise, colour_noise,
           spread_of, lonely, done, faint, centre, axes_out, deviations, linear, begin, end):  # fmt: skip
    """Splats for the cells ``cells[begin:end]`` that are not ``done``, from the cells around each on a level above.

    cells: (k,) rows of their level, which keys, side, places and colours describe.  up: how many levels higher up_keys,
    up_places and up_colours are, 0 for the same; table: of up_keys.  reach: cells around that count, 0 for the cell alone.
    noise: of ranges, standard deviation.  colour_noise: (k,) of a point's luma.  spread_of: standard deviation of a splat in
    the width of the surface it stands for.  lonely: width, at most, where the points around give no plane.
    Results: done, (k,) bool, set where the points around give a plane and a colour; faint, (k,) bool, where they give none, or
    the cell's points are strays off it; centre, (k, 3) float64; axes_out, (k, 3, 3) float64, a rotation, whose columns are
    the axes; deviations, (k, 3) float64, along them, the last across the plane; linear, (k, 3) float64.
    """
    matrix, axes = np.empty((3, 3)), np.empty((3, 3))
    total, tint = np.empty(MOMENTS), np.empty(COLOURS)
    for at in range(begin, end):
        if done[at]:
            continue
        cell = cells[at]
        own, key = places[cell], keys[cell]
        kx, ky, kz = gathered_bits(key), gathered_bits(key >> 1), gathered_bits(key >> 2)
        px, py, pz = (kx + 0.5) * side + own[1], (ky + 0.5) * side + own[2], (kz + 0.5) * side + own[3]
        ux, uy, uz = kx >> up, ky >> up, kz >> up
        total[:], tint[:] = 0.0, 0.0
        for ix in range(max(ux - reach, 0), ux + reach + 1):
            for iy in range(max(uy - reach, 0), uy + reach + 1):
                for iz in range(max(uz - reach, 0), uz + reach + 1):
                    near = place_of(morton(ix, iy, iz), up_keys, table)
                    if near < 0:
                        continue
                    row = up_places[near]
                    add_places(total, row, (ix + 0.5) * up_side + row[1] - px, (iy + 0.5) * up_side + row[2] - py,
                               (iz + 0.5) * up_side + row[3] - pz)  # fmt: skip
                    add_colours(tint, up_colours[near])
        n, known = total[0], tint[0]
        matrix[0, 0], matrix[1, 1], matrix[2, 2] = total[4] / n, total[7] / n, total[9] / n
        matrix[0, 1] = matrix[1, 0] = total[5] / n
        matrix[0, 2] = matrix[2, 0] = total[6] / n
        matrix[1, 2] = matrix[2, 1] = total[8] / n
        principal_axes(matrix, axes)
        first = last = 0
        for k in range(1, 3):
            if matrix[k, k] > matrix[first, first]:
                first = k
            if matrix[k, k] <= matrix[last, last]:
                last = k
        if first == last:
            first, last = 0, 2
        second = 3 - first - last
        widest = (2 * reach + 1) * up_side
        done[at] = n >= FEWEST and known > 0 and matrix[second, second] >= FLAT / 12 * widest * widest
        alone = reach == 0
        # what the points around say about a colour that few points measured (Wiener)
        for channel in range(3):
            linear[at, channel] = colours[cell, 1 + channel]
        if known > 0:
            held = colours[cell, 0]
            tint_noise = colour_noise[at] * colour_noise[at] / max(held, 1.0)
            true = max(tint[7] / (3 * known) - colour_noise[at] * colour_noise[at], 0.0)
            weight = 0.0 if held == 0 else 1.0 if alone else true / max(true + tint_noise, 1e-12)
            for channel in range(3):
                linear[at, channel] = tint[1 + channel] + (linear[at, channel] - tint[1 + channel]) * weight
        faint[at] = not done[at]
        across = max(matrix[last, last] - noise * noise, 0.0)
        nx, ny, nz = axes[0, last], axes[1, last], axes[2, last]
        shift = 0.0
        if not alone:  # towards the plane of the points around, where the noise explains the way
            way = total[1] * nx + total[2] * ny + total[3] * nz
            if own[0] <= FEW and abs(way) > STRAY * math.sqrt(max(matrix[last, last], 0.0)):
                faint[at] = True
            if abs(way) < 3 * noise:
                shift = way * (1 - across / max(across + noise * noise / own[0], 1e-300))
        centre[at, 0], centre[at, 1], centre[at, 2] = px + shift * nx, py + shift * ny, pz + shift * nz
        wide, narrow = math.sqrt(12 * max(matrix[first, first], 0.0)), math.sqrt(12 * max(matrix[second, second], 0.0))
        if not alone:
            # the area that the own points stand for, where points around are as dense
            width = math.sqrt(wide * narrow * min(own[0] / n, 1.0)) if done[at] else wide * math.sqrt(own[0] / n)
            width = min(max(width, LEAST_WIDTH * side), lonely if faint[at] else widest)
            wide = narrow = width
        else:
            unbiased = math.sqrt(n / (n - 1.0)) if n > 1 else 1.0
            wide, narrow = wide * unbiased, max(narrow * unbiased, LEAST_WIDTH * side)
            wide = max(wide, narrow)
        deviations[at, 0], deviations[at, 1] = spread_of * wide, spread_of * narrow
        deviations[at, 2] = min(max(math.sqrt(across), THIN * spread_of * narrow), spread_of * narrow)
        for axis in range(3):
            axes_out[at, axis, 0] = axes[axis, first]
            axes_out[at, axis, 1] = axes[axis, second]
        axes_out[at, 0, 2] = axes[1, first] * axes[2, second] - axes[2, first] * axes[1, second]
        axes_out[at, 1, 2] = axes[2, first] * axes[0, second] - axes[0, first] * axes[2, second]
        axes_out[at, 2, 2] = axes[0, first] * axes[1, second] - axes[1, first] * axes[0, second]
