"""The compiled loops of picking and fitting: which points of a scene lie in a pixel's frustum, a ball, or an oriented box.

Frames: cells and balls in file coordinates relative to ``Scene.origin``, float64, so that nothing is lost at map coordinates.
"""

import numpy as np

from ....model.common.jit import compiled
from ..point_moments import add_point


@compiled(nogil=True)
def cells_in_box(coords, low, high):
    """Rows of the cells (C, 3) int32 whose coordinates lie in low..high, (3,) int64 each, both included."""
    found = 0
    for row in range(coords.shape[0]):
        found += inside(coords, row, low, high)
    rows = np.empty(found, np.int64)
    at = 0
    for row in range(coords.shape[0]):
        if inside(coords, row, low, high):
            rows[at] = row
            at += 1
    return rows


@compiled(inline="always")
def inside(coords, row, low, high):
    return (
        low[0] <= coords[row, 0] <= high[0] and low[1] <= coords[row, 1] <= high[1] and low[2] <= coords[row, 2] <= high[2]
    )


@compiled(inline="always")
def place_in_cell(points, i, step):
    """Place of a packed point relative to its cell's corner.  step: of the grid (Scene.step)."""
    return ((points[i, 0] & 0xFFFF) + 0.5) * step, ((points[i, 0] >> 16) + 0.5) * step, ((points[i, 1] & 0xFFFF) + 0.5) * step


@compiled(nogil=True)
def points_in_pixel(points, coords, offsets, layers, rows, size, shift, rotation, lens, parallel, pixel, near, far):
    """Points of the cells ``rows`` that project into a pixel: their running numbers, view depths and pixel positions.

    points: (N, 3) uint32 packed.  coords: (C, 3) int32.  offsets: as in Scene.  size: of a cell.  shift: (3,) from the camera
    to the grid's origin.  rotation: (3, 3) world to view.  lens: (4,) fx, fy, cx, cy.  parallel: of an orthographic
    camera, the depth at which the lens gives its scale; 0 of a pinhole.  pixel: (4,) left, right, top, bottom.
    near, far: view depths between which points count.
    """
    cells, step = coords.shape[0], size / 65536.0
    index, out, count = np.empty(64, np.int64), np.empty((64, 3), np.float64), 0
    for row in rows:
        x0 = coords[row, 0] * size + shift[0]
        y0 = coords[row, 1] * size + shift[1]
        z0 = coords[row, 2] * size + shift[2]
        for layer in range(layers):
            for i in range(offsets[layer * cells + row], offsets[layer * cells + row + 1]):
                x, y, z = place_in_cell(points, i, step)
                x, y, z = x0 + x, y0 + y, z0 + z
                depth = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z
                if not near <= depth <= far:
                    continue
                by = parallel if parallel > 0.0 else depth
                u = lens[0] * (rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z) / by + lens[2]
                v = lens[1] * (rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z) / by + lens[3]
                if not (pixel[0] <= u <= pixel[1] and pixel[2] <= v <= pixel[3]):
                    continue
                if count == len(index):
                    index = np.concatenate((index, np.empty_like(index)))
                    out = np.concatenate((out, np.empty_like(out)))
                index[count] = i
                out[count, 0], out[count, 1], out[count, 2] = depth, u, v
                count += 1
    return index[:count], out[:count]


@compiled(nogil=True)
def neighbourhood(points, coords, offsets, layers, rows, size, place, radius):
    """Moments of the points of the cells ``rows`` within ``radius`` of ``place`` (3,), relative to it: (10,) float64
    (viewer.work.point_moments)."""
    cells, step, sums = coords.shape[0], size / 65536.0, np.zeros(10)
    for row in rows:
        x0 = coords[row, 0] * size - place[0]
        y0 = coords[row, 1] * size - place[1]
        z0 = coords[row, 2] * size - place[2]
        for layer in range(layers):
            for i in range(offsets[layer * cells + row], offsets[layer * cells + row + 1]):
                x, y, z = place_in_cell(points, i, step)
                x, y, z = x0 + x, y0 + y, z0 + z
                if x * x + y * y + z * z > radius * radius:
                    continue
                add_point(sums, x, y, z)
    return sums


@compiled(nogil=True)
def points_by_layer(offsets, layers, cells, rows):
    """(layers,) int64: the points of the cells ``rows`` in each layer: no fewer than those in a box that meets these cells."""
    found = np.zeros(layers, np.int64)
    for layer in range(layers):
        for row in rows:
            found[layer] += offsets[layer * cells + row + 1] - offsets[layer * cells + row]
    return found


@compiled(nogil=True)
def points_in_box(points, coords, offsets, layers, every, rows, size, place, axes, half):
    """Running numbers and places, (n,) int64 and (n, 3) float64 relative to ``place``, of points of the first ``layers`` layers
    of the cells ``rows`` that lie in a box.

    every: of the last of these layers, points are looked at whose number is a multiple of it.
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
            stride = every if layer == layers - 1 else 1
            begin = (offsets[layer * cells + row] + stride - 1) // stride * stride
            for i in range(begin, offsets[layer * cells + row + 1], stride):
                x, y, z = place_in_cell(points, i, step)
                x, y, z = x0 + x, y0 + y, z0 + z
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
