"""Compiled loops of a grid's second pass: pack points, sorted by where they go, then write them to their places.  Serial,
without the interpreter's lock, as viewer.grid.building.kernels.
"""

from typing import NamedTuple

import numpy as np

from ....model.common.jit import compiled
from ..cell_boxes import SHARE_BITS, SHARES
from ..density_layers import PART_EXTRA, PART_OF, PARTS, STEP
from .kernels import ROWS, TRAILING_ZEROS, drawn_value, slot_of

_BACK = TRAILING_ZEROS // STEP  # layers back from the finest
_PART_BITS, _PART_MASK = PARTS.bit_length() - 1, PARTS - 1
_TO_SHARE = 16 - SHARE_BITS
_OUTSIDE = -(1 << 28)
"""In place of an index into a dense table, of at most 2**24 cells: it makes the sum of the three axes negative."""


class ReadPoints(NamedTuple):
    """Points as they were read.  xyz: (n, 3) float64.  rgb: (n, 3) uint8.  attributes: (n,) uint16
    (viewer.preprocess.point_attributes).  scan: (n,) uint8.  first: running number of the first."""

    xyz: np.ndarray
    rgb: np.ndarray
    attributes: np.ndarray
    scan: np.ndarray
    first: int


class Buckets(NamedTuple):
    """Where points go: a bucket for each layer and cell, number layer * cells + cell.

    inverse: 1 / cell size.  base: (3,) float64 whole numbers, of the cells.  reach: (2, 3) float64 box outside which a point is
    left out.  dense: (X, Y, Z) int32 cell numbers; where it is empty, they are looked up in ``table`` (slot_of).
    group_of: (layers * cells,) uint8 group of each bucket.
    """

    inverse: float
    base: np.ndarray
    reach: np.ndarray
    dense: np.ndarray
    table: np.ndarray
    cells: int
    layers: int
    group_of: np.ndarray


class Pieces(NamedTuple):
    """P pieces of S packed points, each by group and within a group in order.  buckets: (P, S) int32.  words: (P, S, 4) uint32,
    the packed point and the lower 32 bits of its running number.  starts: (P, groups + 1) int32, where each group begins."""

    buckets: np.ndarray
    words: np.ndarray
    starts: np.ndarray


class _Axes(NamedTuple):
    """What holds for x, y, z, x, y, z, ..., of ROWS points, so that loops over coordinates as they are stored compile to vector
    instructions: the reach, the base, how many cells there are, and the stride of the dense table; without one, 1."""

    low: np.ndarray
    high: np.ndarray
    base: np.ndarray
    cells: np.ndarray
    strides: np.ndarray


class _Piece(NamedTuple):
    """Room for one piece in the order of the file: (3 S,) uint16 positions in cells, (S,) int32 buckets, -1 of points that are
    left out, and (S,) uint8 groups."""

    positions: np.ndarray
    bucket: np.ndarray
    group: np.ndarray


@compiled(nogil=True)
def _axes_of(buckets):
    direct, dense, count = buckets.dense.size > 0, buckets.dense.shape, 3 * ROWS
    low, high, base = np.empty(count), np.empty(count), np.empty(count)
    cells, strides = np.empty(count, np.int32), np.empty(count, np.int32)
    for k in range(count):
        axis = k % 3
        low[k], high[k], base[k] = buckets.reach[0, axis], buckets.reach[1, axis], buckets.base[axis]
        cells[k] = dense[axis] if direct else 2**31 - 1
        strides[k] = 1 if axis == 2 or not direct else dense[2] * (1 if axis == 1 else dense[1])
    return _Axes(low, high, base, cells, strides)


@compiled(nogil=True)
def _find_buckets(coordinates, first, buckets, axes, piece, counts, marks):
    """Positions, buckets and groups of the points of a piece, in ``piece``.  coordinates: (3 n,), as they are stored.  first:
    running number.  counts: of the groups, one entry late.

    One function for all ROWS points at a time: numba counts references to each array that is handed on, by atomic operations,
    which took an eighth of the time where each of the loops was a function.
    """
    low, high, base, sides, strides = axes.low, axes.high, axes.base, axes.cells, axes.strides
    numbers, table, group_of, inverse = buckets.dense.reshape(-1), buckets.table, buckets.group_of, buckets.inverse
    direct, layers, cells = numbers.size > 0, buckets.layers, buckets.cells
    outside = np.int32(_OUTSIDE if direct else -1)
    all_positions, bucket_of, group = piece.positions, piece.bucket, piece.group
    at, layer, cell = np.empty(3 * ROWS, np.int32), np.empty(ROWS, np.int32), np.empty(ROWS, np.int32)
    for start in range(0, len(coordinates) // 3, ROWS):
        rows = min(ROWS, len(coordinates) // 3 - start)
        part, positions = coordinates[3 * start : 3 * (start + rows)], all_positions[3 * start : 3 * (start + rows)]
        for k in range(3 * rows):
            inside = (part[k] >= low[k]) & (part[k] <= high[k])
            place = (part[k] if inside else low[k]) * inverse
            whole = np.floor(place)
            number = np.int32(whole - base[k])
            at[k] = number * strides[k] if inside & (number >= 0) & (number < sides[k]) else outside
            # the fraction of a tiny negative coordinate rounds up to 1, hence the clip
            positions[k] = min(np.int32((place - whole) * 65536.0), 65535)
        for k in range(rows):
            layer[k] = drawn_value(first + start + k)
        for k in range(rows):
            layer[k] = max(layers - 1 - _BACK[layer[k]], 0) * cells
        if direct:
            for k in range(rows):
                place = at[3 * k] + at[3 * k + 1] + at[3 * k + 2]
                number = numbers[max(place, 0)]
                cell[k] = number if place >= 0 else -1
        else:
            for k in range(rows):
                x, y, z = at[3 * k], at[3 * k + 1], at[3 * k + 2]
                cell[k] = table[slot_of(table, x, y, z), 3] if (x >= 0) & (y >= 0) & (z >= 0) else -1
        for k in range(rows):
            bucket = layer[k] + cell[k] if cell[k] >= 0 else -1
            bucket_of[start + k], group[start + k] = bucket, group_of[max(bucket, 0)]
        for k in range(rows):
            if cell[k] < 0:  # out of reach, or the file changed since pass 1, which the caller detects by the totals
                continue
            counts[group[start + k] + 1] += 1
            x, y, z = positions[3 * k] >> _TO_SHARE, positions[3 * k + 1] >> _TO_SHARE, positions[3 * k + 2] >> _TO_SHARE
            marks[cell[k]] |= 1 << x | 1 << (SHARES + y) | 1 << (2 * SHARES + z)


@compiled(nogil=True)
def _write_sorted(points, begin, piece, free, buckets, words):
    """Packs the points of a piece, from row ``begin`` on, by group.  free: where each group begins; advanced."""
    rgb, attributes, scan, positions = points.rgb, points.attributes, points.scan, piece.positions
    bucket_of, group_of, first = piece.bucket, piece.group, points.first
    for k in range(min(len(bucket_of), len(rgb) - begin)):
        if bucket_of[k] < 0:
            continue
        group, i = group_of[k], begin + k
        place = free[group]
        free[group] = place + 1
        buckets[place] = bucket_of[k]
        words[place, 0] = np.uint32(positions[3 * k]) | np.uint32(positions[3 * k + 1]) << np.uint32(16)
        words[place, 1] = np.uint32(positions[3 * k + 2]) | np.uint32(attributes[i]) << np.uint32(16)
        colour = np.uint32(rgb[i, 0]) | np.uint32(rgb[i, 1]) << np.uint32(8) | np.uint32(rgb[i, 2]) << np.uint32(16)
        words[place, 2] = colour | np.uint32(scan[i]) << np.uint32(24)
        words[place, 3] = np.uint32(first + i)


@compiled(nogil=True)
def pack_points(points, buckets, pieces, marks):
    """Packs ReadPoints into Pieces, in the order of the file, and sorts each piece by the group of the points' Buckets.

    pieces: as many as hold the points.  Points out of reach are left out.
    marks: (C,) int64, one bit set for each sixteenth of a cell that holds a point (viewer.grid.cell_boxes).
    """
    size, axes, coordinates = pieces.buckets.shape[1], _axes_of(buckets), points.xyz.reshape(-1)
    piece = _Piece(np.empty(3 * size, np.uint16), np.empty(size, np.int32), np.empty(size, np.uint8))
    for number in range(pieces.buckets.shape[0]):
        begin, starts = number * size, pieces.starts[number]
        starts[:] = 0
        _find_buckets(coordinates[3 * begin : 3 * (begin + size)], points.first + begin, buckets, axes, piece, starts, marks)
        for group in range(1, len(starts)):
            starts[group] += starts[group - 1]
        _write_sorted(points, begin, piece, starts.copy(), pieces.buckets[number], pieces.words[number])


@compiled(nogil=True)
def place_points(buckets, words, starts, numbered, begin, end, runs, points, records, high):
    """Moves the packed points of groups ``begin`` to before ``end``, of all pieces, to their places in their buckets' runs.

    buckets, words, starts: as pack_points writes them.  numbered: (P,) int64, running number of each piece's first point.
    runs: (buckets + 1, 2) int64, where each begins and how many of its points are placed, updated; side by side, since both
    are looked up at random.
    records, high: (N,) uint32 and uint8, receive bits 0 to 31 and 32 to 39 of each point's running number; ``high`` is empty
    where 32 bits suffice.
    """
    wide = high.size > 0
    for group in range(begin, end):
        for piece in range(starts.shape[0]):
            upper, lower = np.uint8(numbered[piece] >> 32), np.uint32(numbered[piece] & 0xFFFFFFFF)
            for i in range(starts[piece, group], starts[piece, group + 1]):
                bucket = buckets[piece, i]
                first, number = runs[bucket, 0], runs[bucket, 1]
                size = runs[bucket + 1, 0] - first
                runs[bucket, 1] = number + 1
                if number < size:
                    part = PART_OF[number & _PART_MASK]
                    place = first + (size >> _PART_BITS) * part + PART_EXTRA[size & _PART_MASK, part] + (number >> _PART_BITS)
                    points[place, 0], points[place, 1] = words[piece, i, 0], words[piece, i, 1]
                    points[place, 2], records[place] = words[piece, i, 2], words[piece, i, 3]
                    if wide:
                        high[place] = upper + np.uint8(words[piece, i, 3] < lower)  # a piece is far shorter than 2**32 points
