"""Compiled loops of the processor's rasteriser (viewer.render.raster.raster_cpu): the same operations as
shaders/common_project.glsl, raster_depth.comp, raster_colour.comp, common_sums.glsl and resolve.comp, in the same order and in
float32.

Each loop is called once by every thread; they share the work by a counter, and pixels by atomic operations.  Words of points,
planes of pixels and tables are flat arrays of their own, because LLVM vectorises loops over those only: rows of a 2-D array
have a stride that is known at run time (projection took 7 ns per point instead of 1.5).
"""

from typing import NamedTuple

import numpy as np

from ....model.common.atomics import atomic_add, atomic_max
from ....model.common.jit import compiled
from ....model.reference.soft_z import MAX_AVERAGED
from ..device.shader import BATCH
from .point_loops import dropped, point_weight, recoloured

_F, _U, _W = np.float32, np.uint32, np.uint64
_TAKEN = 32
"""Batches, or rows of pixels, that a thread takes at a time: neighbours in the picture stay with one thread."""
_FIELD, _CARRIES = _W(0xFFFF), _W(0x0001000100010000)
_EMPTY = _U(0x7F800000)  # +inf


class View(NamedTuple):
    """How points become pixels.  axes: (3, 4) float32, view x, y, z per step along a cell's axes; the fourth of the second row
    is 1 / the depth at which an orthographic camera has its scale, 0 of a pinhole.  lens: (4,) float32 fx, fy,
    cx, cy.  corner: 0.5 where pixel coordinates are rounded, else 0.  relative, absolute: the soft z-buffer's limits."""

    axes: np.ndarray
    lens: np.ndarray
    width: int
    height: int
    corner: np.float32
    relative: np.float32
    absolute: np.float32


class Drawn(NamedTuple):
    """Batches of one page.  table: (B, 4) uint32 first, count, cell, -.  start, stop: rows of it.  cells: (C, 4) float32, view
    position of each cell's first step.  words: (3 N,) uint32.  taken: (1,) int64 counter, 0 before.  marks: (N,) uint8 of each
    point, rows of Edited.marks; (0,) where none is marked."""

    table: np.ndarray
    start: int
    stop: int
    cells: np.ndarray
    words: np.ndarray
    taken: np.ndarray
    marks: np.ndarray


class Sums(NamedTuple):
    """keys: (P,) uint32 nearest depth of each pixel as inverted bits, 0 where empty.  sums: (P,) uint64, 16 bits each of red,
    green, blue and weight, lowest first.  carries: (4 P,) uint32, in units of 2^16.  carried: (1,) uint32, not 0 where there
    are any.

    Where a sum overflows, its carry also arrives in the next field; ``resolve_pixels`` subtracts it there.
    """

    keys: np.ndarray
    sums: np.ndarray
    carries: np.ndarray
    carried: np.ndarray


@compiled(nogil=True)
def _project(drawn, number, view, pixel, x, y, z):
    """Pixels of the points of a batch, -1 outside the picture, and their view positions.  Returns its words, (3 n,)."""
    start, count = np.int64(drawn.table[number, 0]), np.int64(drawn.table[number, 1])
    words, cell = drawn.words[3 * start : 3 * (start + count)], drawn.cells[drawn.table[number, 2]]
    xx, xy, xz = view.axes[0, 0], view.axes[0, 1], view.axes[0, 2]
    yx, yy, yz = view.axes[1, 0], view.axes[1, 1], view.axes[1, 2]
    zx, zy, zz = view.axes[2, 0], view.axes[2, 1], view.axes[2, 2]
    fx, fy, cx, cy = view.lens[0], view.lens[1], view.lens[2], view.lens[3]
    x0, y0, z0, corner, parallel = cell[0], cell[1], cell[2], view.corner, view.axes[1, 3]
    width, height, row = _F(view.width), _F(view.height), np.int32(view.width)
    for i in range(count):
        first, second = words[3 * i], words[3 * i + 1]
        qx = _F(np.int32(first & _U(0xFFFF)))
        qy = _F(np.int32(first >> _U(16)))
        qz = _F(np.int32(second & _U(0xFFFF)))
        x[i] = px = x0 + ((xx * qx + xy * qy) + xz * qz)
        y[i] = py = y0 + ((yx * qx + yy * qy) + yz * qz)
        z[i] = pz = z0 + ((zx * qx + zy * qy) + zz * qz)
        inverse = parallel if parallel > _F(0.0) else _F(1.0) / pz
        u = fx * (px * inverse) + cx
        v = fy * (py * inverse) + cy
        u += corner
        v += corner
        # no branches, which prevent vectorisation; NaN and infinity fail every comparison
        inside = (pz > _F(0.0)) & (u >= _F(0.0)) & (u < width) & (v >= _F(0.0)) & (v < height)
        pixel[i] = np.int32(v) * row + np.int32(u) if inside else np.int32(-1)
    return words


@compiled(nogil=True)
def _mark(drawn, edits, number, i):
    """What the mark of point ``i`` of a batch says."""
    return edits.marks[drawn.marks[drawn.table[number, 0] + i]] if len(drawn.marks) > 0 else _U(0)


@compiled(nogil=True)
def nearest_depths(drawn, view, keys, edits):
    """First pass: the nearest depth of each pixel.  edits: of point_loops, empty where nothing is edited."""
    pixel, x, y, z = np.empty(BATCH, np.int32), np.empty(BATCH, _F), np.empty(BATCH, _F), np.empty(BATCH, _F)
    bits = z.view(np.uint32)
    while True:
        first = drawn.start + _TAKEN * atomic_add(drawn.taken, 0, 1)
        if first >= drawn.stop:
            return
        for number in range(first, min(first + _TAKEN, drawn.stop)):
            words = _project(drawn, number, view, pixel, x, y, z)
            for i in range(len(words) // 3):
                at = pixel[i]
                if at < 0:
                    continue
                key = ~bits[i]
                if keys[at] >= key:  # the plain read saves most atomic operations
                    continue
                if len(edits.clip_rows) > 0:
                    mark = _mark(drawn, edits, number, i)
                    if dropped(edits, x[i], y[i], z[i], words[3 * i + 1], words[3 * i + 2] >> _U(24), mark):
                        continue
                atomic_max(keys, at, key)


@compiled(nogil=True)
def colour_sums(drawn, view, made, to_linear, unlit, stations, edits):
    """Second pass: sums of the colours and weights of the points within the soft z-buffer's tolerance.

    to_linear: (256,) uint64.  unlit: whether black points have no colour.  stations: of point_loops.point_weight;
    (0, 4) where all points weigh the same.
    """
    pixel, x, y, z = np.empty(BATCH, np.int32), np.empty(BATCH, _F), np.empty(BATCH, _F), np.empty(BATCH, _F)
    key = np.empty(1, np.uint32)
    nearest = key.view(np.float32)
    while True:
        first = drawn.start + _TAKEN * atomic_add(drawn.taken, 0, 1)
        if first >= drawn.stop:
            return
        for number in range(first, min(first + _TAKEN, drawn.stop)):
            words = _project(drawn, number, view, pixel, x, y, z)
            for i in range(len(words) // 3):
                at = pixel[i]
                if at < 0:
                    continue
                key[0] = ~made.keys[at]
                if z[i] > max(nearest[0] * view.relative, nearest[0] + view.absolute):
                    continue
                word = words[3 * i + 2]
                if len(edits.clip_rows) > 0:
                    mark = _mark(drawn, edits, number, i)
                    if dropped(edits, x[i], y[i], z[i], words[3 * i + 1], word >> _U(24), mark):
                        continue
                    word = recoloured(edits, words[3 * i + 1], word, x[i], y[i], z[i], mark)
                if unlit and word & _U(0xFFFFFF) == 0:
                    continue
                weight = _W(1)
                if len(stations) > 0:
                    weight = _W(point_weight(stations, x[i], y[i], z[i], word >> _U(24)))
                _add(made, at, weight * to_linear[word & _U(0xFF)], weight * to_linear[word >> _U(8) & _U(0xFF)],
                     weight * to_linear[word >> _U(16) & _U(0xFF)], weight)  # fmt: skip


@compiled(nogil=True)
def _add(made, at, red, green, blue, weight):
    """Adds to the four sums of a pixel with one atomic operation.  Each addend is below 2^16."""
    more = red | green << _W(16) | blue << _W(32) | weight << _W(48)
    before = atomic_add(made.sums, at, more)
    after = before + more
    if (before ^ more ^ after) & _CARRIES == _W(0) and after >= before:  # nothing carried out of any field
        return
    over = (before & _FIELD) + red >> _W(16)
    if over:
        atomic_add(made.carries, 4 * at, _U(1))
    over_green = (before >> _W(16) & _FIELD) + green + over >> _W(16)
    if over_green:
        atomic_add(made.carries, 4 * at + 1, _U(1))
    over_blue = (before >> _W(32) & _FIELD) + blue + over_green >> _W(16)
    if over_blue:
        atomic_add(made.carries, 4 * at + 2, _U(1))
    over_weight = (before >> _W(48)) + weight + over_blue >> _W(16)
    if over_weight:
        atomic_add(made.carries, 4 * at + 3, _U(1))
    if over | over_green | over_blue | over_weight:
        made.carried[0] = _U(1)  # every writer writes the same


@compiled(nogil=True)
def _resolve_row(words, to_srgb, means, colour, weight):
    """Pixels of which no sum overflowed.  words: (2 n,) uint32, red and green, blue and weight, which are zero afterwards.
    means: scratch, (3, n) int32.  colour, weight: as below."""
    red, green, blue = means[0], means[1], means[2]
    for x in range(len(colour)):
        low, high = words[2 * x], words[2 * x + 1]
        count = high >> _U(16)
        # A mean rounded half up, of whole numbers below 2^17: with another half float32 cannot err across a whole number.
        # It is vectorised, and divisions of integers are not.
        half, by = _F(np.int32(count >> _U(1))) + _F(0.5), _F(max(np.int32(count), np.int32(1)))
        red[x] = np.int32((_F(np.int32(low & _U(0xFFFF))) + half) / by)
        green[x] = np.int32((_F(np.int32(low >> _U(16))) + half) / by)
        blue[x] = np.int32((_F(np.int32(high & _U(0xFFFF))) + half) / by)
    for x in range(len(colour)):
        count = words[2 * x + 1] >> _U(16)
        shown = _U(to_srgb[red[x]]) | _U(to_srgb[green[x]]) << _U(8) | _U(to_srgb[blue[x]]) << _U(16) | _U(0xFF000000)
        colour[x] = shown if count > _U(0) else _U(0)
        weight[x] = min(count, _U(MAX_AVERAGED))
    words[:] = _U(0)


@compiled(nogil=True)
def _resolve_carried(made, start, stop, to_srgb, colour, weight):
    """Pixels ``start`` to ``stop``, of which some sums overflowed."""
    for at in range(start, stop):
        word, over = made.sums[at], made.carries[4 * at : 4 * at + 4]
        red, green, blue, count = word & _FIELD, word >> _W(16) & _FIELD, word >> _W(32) & _FIELD, word >> _W(48)
        count = (count | _W(over[3]) << _W(16)) - _W(over[2])
        blue = (blue | _W(over[2]) << _W(16)) - _W(over[1])
        green = (green | _W(over[1]) << _W(16)) - _W(over[0])
        red |= _W(over[0]) << _W(16)
        over[:] = 0
        made.sums[at] = 0
        weight[at] = min(count, _W(MAX_AVERAGED))
        if count == 0:
            colour[at] = 0
            continue
        half = count >> _W(1)  # rounded half up
        red, green, blue = (red + half) // count, (green + half) // count, (blue + half) // count
        colour[at] = _U(to_srgb[red]) | _U(to_srgb[green]) << _U(8) | _U(to_srgb[blue]) << _U(16) | _U(0xFF000000)


@compiled(nogil=True)
def resolve_pixels(made, taken, width, to_srgb, colour, depth, weight):
    """The raw picture from sums and keys, which are zero afterwards, as are the carries.

    taken: (1,) int64 counter, 0 before.  to_srgb: (4096,) uint8.  colour: (P,) uint32 RGBA8.  depth: (P,) uint32, bits of
    float32 view-space z, +inf where empty.  weight: (P,) uint8.
    """
    words, means = made.sums.view(np.uint32), np.empty((3, width), np.int32)
    while True:
        first = _TAKEN * width * atomic_add(taken, 0, 1)
        if first >= len(colour):
            return
        for start in range(first, min(first + _TAKEN * width, len(colour)), width):
            stop = start + width
            keys, far = made.keys[start:stop], depth[start:stop]
            for x in range(width):
                far[x] = ~keys[x] if keys[x] > _U(0) else _EMPTY
            keys[:] = _U(0)
            if made.carried[0] > 0:
                _resolve_carried(made, start, stop, to_srgb, colour, weight)
            else:
                _resolve_row(words[2 * start : 2 * stop], to_srgb, means, colour[start:stop], weight[start:stop])
