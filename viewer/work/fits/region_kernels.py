"""The compiled loops of fitting: the points of a grid that lie in an oriented box.

Frames as in viewer.work.places.pick_kernels: relative to a place, float64, so that nothing is lost at map coordinates.
"""

import numpy as np

from ....model.common.jit import compiled


@compiled(nogil=True)
def points_by_layer(offsets, layers, cells, rows):
    """(layers,) int64: the points of the cells ``rows`` in each layer: no fewer than those in a box that meets these cells."""
    found = np.zeros(layers, np.int64)
    for layer in range(layers):
        for row in rows:
            found[layer] += offsets[layer * cells + row + 1] - offsets[layer * cells + row]
    return found


@compiled(nogil=True)
def points_in_box(points, coords, offsets, layers, rows, size, place, axes, half):
    """Running numbers and places, (n,) int64 and (n, 3) float64 relative to ``place``, of points of the first ``layers`` layers
    of the cells ``rows`` that lie in a box.

    place: (3,) its centre, relative to the grid's origin.  axes: (3, 3) rows, unit vectors.  half: (3,) half lengths along
    them.
    """
    cells, step = coords.shape[0], size / 65536.0
    index, out, count = np.empty(1024, np.int64), np.empty((1024, 3), np.float64), 0
    for row in rows:
        x0 = coords[row, 0] * size - place[0]
        y0 = coords[row, 1] * size - place[1]
        z0 = coords[row, 2] * size - place[2]
        for layer in range(layers):
            for i in range(offsets[layer * cells + row], offsets[layer * cells + row + 1]):
                x = x0 + ((points[i, 0] & 0xFFFF) + 0.5) * step
                y = y0 + ((points[i, 0] >> 16) + 0.5) * step
                z = z0 + ((points[i, 1] & 0xFFFF) + 0.5) * step
                if abs(axes[0, 0] * x + axes[0, 1] * y + axes[0, 2] * z) > half[0]:
                    continue
                if abs(axes[1, 0] * x + axes[1, 1] * y + axes[1, 2] * z) > half[1]:
                    continue
                if abs(axes[2, 0] * x + axes[2, 1] * y + axes[2, 2] * z) > half[2]:
                    continue
                if count == len(index):
                    index = np.concatenate((index, np.empty_like(index)))
                    out = np.concatenate((out, np.empty_like(out)))
                index[count] = i
                out[count, 0], out[count, 1], out[count, 2] = x, y, z
                count += 1
    return index[:count], out[:count]
