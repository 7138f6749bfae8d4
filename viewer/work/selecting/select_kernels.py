"""Compiled loops of selecting: which points of a scene lie inside an outline on a picture, or between planes.

Frames: cells in file coordinates relative to ``Scene.origin``, float64.  Each loop takes the runs ``base + first`` to
``base + last`` of ``Scene.offsets`` and writes ``hits`` of their points; several threads share the runs.
"""

import numpy as np

from ....model.common.jit import compiled
from ..places.pick_kernels import place_in_cell

OUTSIDE, INSIDE, EDGE = 0, 1, 2
"""Of a tile of the picture: outside the outline, inside it, or near its edge, where each point is tested."""


@compiled(nogil=True)
def in_outline(points, offsets, coords, size, shift, rotation, lens, parallel, possible, corner, tile, tiles, edges, hits, base,
               first, last):
    """Marks the points whose pixel lies in the outline.

    points: (N, 3) uint32 packed.  coords: (C, 3) int32.  size: of a cell.  shift: (3,) from the camera to the grid's origin.
    rotation: (3, 3) world to view.  lens: (4,) fx, fy, cx, cy.  parallel: of an orthographic camera, the depth at which the
    lens gives its scale; 0 of a pinhole.  possible: (C,) bool, cells that may have such points.
    corner: (2,) pixel of the first tile's corner.  tile: its side, pixels.  tiles: (rows, columns) uint8.
    edges: (K, 4) float64 x0, y0, x1, y1.  hits: (N,) bool.
    """
    cells, step = coords.shape[0], size / 65536.0
    for run in range(base + first, base + last):
        cell = run % cells
        if not possible[cell]:
            continue
        x0, y0, z0 = coords[cell, 0] * size + shift[0], coords[cell, 1] * size + shift[1], coords[cell, 2] * size + shift[2]
        for i in range(offsets[run], offsets[run + 1]):
            x, y, z = place_in_cell(points, i, step)
            x, y, z = x0 + x, y0 + y, z0 + z
            depth = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z
            if not depth > 0:
                continue
            by = parallel if parallel > 0.0 else depth
            u = lens[0] * (rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z) / by + lens[2]
            v = lens[1] * (rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z) / by + lens[3]
            column, row = np.floor((u - corner[0]) / tile), np.floor((v - corner[1]) / tile)
            if not (0 <= column < tiles.shape[1] and 0 <= row < tiles.shape[0]):
                continue
            kind = tiles[np.int64(row), np.int64(column)]
            hits[i] = kind == INSIDE or (kind == EDGE and _even_odd(edges, u, v))


@compiled(nogil=True)
def _even_odd(edges, u, v):
    """Whether a ray from a pixel to the left crosses an odd number of edges; numpy's form is select_points.inside_outline."""
    inside = False
    for k in range(edges.shape[0]):
        if (edges[k, 1] > v) != (edges[k, 3] > v):
            crossing = edges[k, 0] + (v - edges[k, 1]) / (edges[k, 3] - edges[k, 1]) * (edges[k, 2] - edges[k, 0])
            inside ^= u > crossing
    return inside


@compiled(nogil=True)
def between_planes(points, offsets, coords, size, shift, rows, low, high, hits, base, first, last):
    """Marks the points x of which ``low <= rows @ x <= high`` in all rows.

    shift: (3,) from the place to which ``rows`` refer to the grid's origin.  rows: (K, 3).  low, high: (K,).  hits: (N,) bool.
    """
    cells, step = coords.shape[0], size / 65536.0
    for run in range(base + first, base + last):
        cell = run % cells
        x0, y0, z0 = coords[cell, 0] * size + shift[0], coords[cell, 1] * size + shift[1], coords[cell, 2] * size + shift[2]
        for i in range(offsets[run], offsets[run + 1]):
            x, y, z = place_in_cell(points, i, step)
            x, y, z = x0 + x, y0 + y, z0 + z
            inside = True
            for k in range(rows.shape[0]):
                inside &= low[k] <= rows[k, 0] * x + rows[k, 1] * y + rows[k, 2] * z <= high[k]
            hits[i] = inside


@compiled(nogil=True)
def lowest_and_highest(points, offsets, coords, size, hits, ends, base, first, last):
    """(6,) float64 ``ends``: widens the lowest and highest coordinates of the marked points, relative to the grid's origin."""
    cells, step = coords.shape[0], size / 65536.0
    for run in range(base + first, base + last):
        cell = run % cells
        for i in range(offsets[run], offsets[run + 1]):
            if hits[i]:
                x, y, z = place_in_cell(points, i, step)
                x, y, z = coords[cell, 0] * size + x, coords[cell, 1] * size + y, coords[cell, 2] * size + z
                ends[0], ends[1], ends[2] = min(ends[0], x), min(ends[1], y), min(ends[2], z)
                ends[3], ends[4], ends[5] = max(ends[3], x), max(ends[4], y), max(ends[5], z)
