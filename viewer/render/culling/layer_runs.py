"""Compiled loop of the level of detail: from cells in view to runs of their points, layer by layer.  Serial, without the
interpreter's lock, as viewer.render.culling.cull_kernels.
"""

from typing import NamedTuple

import numpy as np

from ....model.common.jit import compiled


class CellLayers(NamedTuple):
    """Where a scene's points lie.  offsets: (number * cells + 1,) int64 as in Scene.  extra: of
    viewer.grid.density_layers.part_extra; of a cell's last layer as many parts are drawn as are needed."""

    offsets: np.ndarray
    number: int
    cells: int
    extra: np.ndarray


class RunLists(NamedTuple):
    """first and size (int64) and slot (int32): first, count and slot of DrawList."""

    first: np.ndarray
    size: np.ndarray
    slot: np.ndarray


@compiled(nogil=True)
def list_runs(layers, cells, visible, lod, scratch, runs):
    """Runs of points of the visible cells, by ascending first: for each cell the fewest layers that hold the points wanted.

    layers: CellLayers.  cells: FoundCells, the first ``visible`` of them.  lod: 0 for all layers.  scratch: (C,) int64 and
    (C,) int32.  runs: RunLists, written as far as they are long enough.
    Returns (runs, points, room): all runs are written if the lists are ``room`` long.
    """
    held, active = scratch
    listed, points, live, room, parts = 0, 0, visible, 0, layers.extra.shape[0]
    for i in range(visible):
        held[i], active[i] = 0, i
    for layer in range(layers.number):
        base, kept = layer * layers.cells, 0
        room = max(room, listed + live)
        fits = room <= runs.first.shape[0]
        for i in range(live):  # few branches: whether a cell goes on, or holds anything, is not to be foreseen
            place = active[i]
            start = layers.offsets[base + cells.rows[place]]
            here = layers.offsets[base + cells.rows[place] + 1] - start
            if lod > 0.0:
                short = cells.wanted[place] - held[place]
                if here > short:
                    taken = max(int(np.ceil(parts * short / here)), 1)
                    here = (here // parts) * taken + layers.extra[here % parts, taken]
                held[place] += here
                active[kept] = place
                kept += not held[place] >= cells.wanted[place]
            if fits:
                runs.first[listed], runs.size[listed], runs.slot[listed] = start, here, place
            listed += here > 0
            points += here
        if lod > 0.0:
            live = kept
    return listed, points, room
