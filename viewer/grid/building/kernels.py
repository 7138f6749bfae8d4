"""Compiled inner loops of the grid: find a point's cell, draw its layer, pack it, write it to its place.

They are serial and release the interpreter's lock.  Callers run them on slices in a thread pool, which needs no parallel
compilation and, unlike numba's own threads, is safe from any thread.  No result depends on the number of threads.

Cells are numbered from an integer base: cell = floor(p / cell_size) - base, with p / cell_size exact, because the
cell size is a power of two.
"""

import numpy as np

from ....model.common.jit import compiled
from ..cell_boxes import SHARE_BITS, SHARES
from ..density_layers import PART_EXTRA, PART_OF, PARTS, STEP

GEOMETRIC = 16
"""Number of values the seeded geometric variable takes: 0..15."""
_SEED = np.uint64(0x706F696E74676C61)  # arbitrary ("pointgla" in ASCII); fixed, so that a scan always gives the same layers
_ZEROS = np.array([0, 1, 2, 5, 3, 9, 6, 11, 15, 4, 8, 10, 14, 7, 13, 12])
"""Trailing zeros of 2**n, by de Bruijn's sequence 0x09AF."""
_BACK = _ZEROS // STEP  # layers back from the finest
_PART_BITS, _PART_MASK = PARTS.bit_length() - 1, PARTS - 1
_TO_SHARE = 16 - SHARE_BITS
_ROWS = 64
"""Points whose cells and packed positions are computed at a time: the arrays for them take 8 KB, so that they stay in the
first-level cache."""


_OUTSIDE = -(1 << 28)
"""In place of an index into a dense table, of at most 2**24 cells: it makes the sum of the three axes negative."""


@compiled(inline="always")
def _draw(index):
    """The index into _ZEROS for the trailing zeros of a seeded hash (splitmix64) of a point's running number."""
    z = np.uint64(index) * np.uint64(0x9E3779B97F4A7C15) + _SEED
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = (z ^ (z >> np.uint64(31))) | np.uint64(1 << (GEOMETRIC - 1))
    lowest = z & (~z + np.uint64(1))
    return (lowest * np.uint64(0x09AF) >> np.uint64(12)) & np.uint64(15)


@compiled(inline="always")
def geometric(index):
    """The trailing zeros of that hash: 0 for half of all points, 1 for a quarter, ..., at most GEOMETRIC - 1."""
    return _ZEROS[_draw(index)]


@compiled(inline="always")
def _hash(x, y, z):
    """The hash of a cell, of which a table takes as many of the lowest bits as it needs."""
    h = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(y) * np.uint64(0xC2B2AE3D27D4EB4F)
    return (h + np.uint64(z) * np.uint64(0x165667B19E3779F9)) >> np.uint64(36)


@compiled(inline="always")
def _slot_from(table, slot, x, y, z):
    """The row of cell (x, y, z), or the free row for it, in an open-addressing table (2**k, 4) int32: x, y, z, number (-1:
    free).  slot: uint64, the row that its hash gives."""
    mask = np.uint64(table.shape[0] - 1)
    while table[slot, 3] >= 0 and (table[slot, 0] != x or table[slot, 1] != y or table[slot, 2] != z):
        slot = (slot + np.uint64(1)) & mask
    return slot


@compiled(inline="always")
def _slot(table, x, y, z):
    """As _slot_from, from the cell's hash."""
    return _slot_from(table, _hash(x, y, z) & np.uint64(table.shape[0] - 1), x, y, z)


@compiled(nogil=True)
def occupied(xyz, inverse, limit, seen):
    """The number of cells that points xyz (n, 3) float64 occupy; stops counting beyond ``limit``.

    Cell numbers are float64 and not looked up by _slot: without a base they do not fit int32.
    inverse: 1 / cell size, such that cell numbers are finite.  seen: scratch, (2**k, 3) float64, more rows than ``limit``.
    """
    seen[:, 0] = np.nan  # free
    mask, found = np.uint64(seen.shape[0] - 1), 0
    for i in range(xyz.shape[0]):
        x, y, z = np.floor(xyz[i, 0] * inverse), np.floor(xyz[i, 1] * inverse), np.floor(xyz[i, 2] * inverse)
        h = np.uint64(0)
        for v in (x, y, z):
            h = (h ^ np.uint64(np.int64(min(max(v, -4e18), 4e18)))) * np.uint64(0x9E3779B97F4A7C15)
            h ^= h >> np.uint64(29)
        slot = h & mask
        while seen[slot, 0] == seen[slot, 0] and (seen[slot, 0] != x or seen[slot, 1] != y or seen[slot, 2] != z):
            slot = (slot + np.uint64(1)) & mask
        if seen[slot, 0] != seen[slot, 0]:
            seen[slot, 0], seen[slot, 1], seen[slot, 2] = x, y, z
            found += 1
            if found > limit:
                break
    return found


@compiled(nogil=True)
def fill_table(table, cells):
    """Enters cells (C, 3) int32, all different, into an empty table, each with its row number."""
    for i in range(cells.shape[0]):
        slot = _slot(table, cells[i, 0], cells[i, 1], cells[i, 2])
        table[slot, 0], table[slot, 1], table[slot, 2] = cells[i, 0], cells[i, 1], cells[i, 2]
        table[slot, 3] = i


@compiled(nogil=True)
def count_points(xyz, start, first, inverse, base, reach, table, counts, limit, tally, bounds):
    """Counts points by cell and geometric value, entering new cells, until ``limit`` cells are exceeded.

    xyz: (n, 3) float64.  start: point to begin with.  first: running number of xyz[0].  inverse: 1 / cell size.
    base: (3,) float64 whole numbers.  reach: (2, 3) float64 box outside which a point is not counted.
    counts: (limit, GEOMETRIC) int64.  tally: [cells used, not finite, out of reach], updated.  bounds: (2, 3), updated.
    Returns the number of points processed; less than n means that the next point needs a cell beyond the limit.
    """
    used, mask, coordinates = tally[0], np.uint64(table.shape[0] - 1), xyz.reshape(-1)
    low, high, lowest = np.empty(3 * _ROWS), np.empty(3 * _ROWS), np.empty(3 * _ROWS)
    least, most = np.empty(3 * _ROWS), np.empty(3 * _ROWS)
    for k in range(3 * _ROWS):
        axis = k % 3
        low[k], high[k], lowest[k] = reach[0, axis], reach[1, axis], base[axis]
        least[k], most[k] = bounds[0, axis], bounds[1, axis]
    at, value, number = np.empty(3 * _ROWS, np.int32), np.empty(_ROWS, np.int32), np.empty(_ROWS, np.int32)
    # _ROWS points at a time, in short loops, most of which compile to vector instructions
    for begin in range(start, xyz.shape[0], _ROWS):
        rows, lost = min(_ROWS, xyz.shape[0] - begin), 0
        part = coordinates[3 * begin : 3 * (begin + rows)]
        for k in range(3 * rows):
            inside = (part[k] >= low[k]) & (part[k] <= high[k])
            at[k] = np.int32(np.floor((part[k] if inside else low[k]) * inverse) - lowest[k])
            lost += not inside
        if lost == 0:
            for k in range(3 * rows):
                v = part[k]
                least[k], most[k] = v if v < least[k] else least[k], v if v > most[k] else most[k]
        for k in range(rows):
            value[k] = _draw(first + begin + k)
        for k in range(rows):
            value[k] = _ZEROS[value[k]]
        for k in range(rows):
            number[k] = np.int32(_hash(at[3 * k], at[3 * k + 1], at[3 * k + 2]) & mask)
        done = rows
        for k in range(rows):
            x, y, z = part[3 * k], part[3 * k + 1], part[3 * k + 2]
            if lost > 0:
                inside = (x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1]) & (z >= low[2]) & (z <= high[2])
                if not inside:
                    tally[2 if np.isfinite(x) and np.isfinite(y) and np.isfinite(z) else 1] += 1
                    number[k] = -1
                    continue
                least[0], least[1], least[2] = min(least[0], x), min(least[1], y), min(least[2], z)
                most[0], most[1], most[2] = max(most[0], x), max(most[1], y), max(most[2], z)
            slot = _slot_from(table, np.uint64(number[k]), at[3 * k], at[3 * k + 1], at[3 * k + 2])
            if table[slot, 3] < 0:
                if used == limit:
                    done = k
                    break
                table[slot, 0], table[slot, 1], table[slot, 2] = at[3 * k], at[3 * k + 1], at[3 * k + 2]
                table[slot, 3] = used
                used += 1
            number[k] = table[slot, 3]
        for k in range(done):
            if number[k] >= 0:
                counts[number[k], value[k]] += 1
        if done < rows:
            done += begin
            break
    else:
        done = xyz.shape[0]
    for k in range(3 * _ROWS):
        axis = k % 3
        bounds[0, axis], bounds[1, axis] = min(bounds[0, axis], least[k]), max(bounds[1, axis], most[k])
    tally[0] = used
    return done


@compiled(nogil=True)
def add_rows(counts, order, number, sums):
    """Adds row order[i] of counts (n, G) int64 to row number[i] of ``sums``."""
    for i in range(order.shape[0]):
        for value in range(counts.shape[1]):
            sums[number[i], value] += counts[order[i], value]


@compiled(nogil=True)
def pack_points(xyz, rgb, attributes, scan, first, inverse, base, reach, dense, table, cells, layers, groups, buckets, words,
                starts, marks):  # fmt: skip
    """Packs a slice of points, a piece at a time, and sorts each by the group of the points' buckets, layer * cells + cell.

    rgb: (n, 3) uint8.  attributes: (n,) uint16 (viewer.preprocess.point_attributes).  scan: (n,) uint8.  base: of the
    cells.  dense: (X, Y, Z) int32 cell numbers; where it is empty, they are looked up in ``table``.  groups: (buckets,) uint8
    group of each bucket.  Others as in count_points.
    marks: (C,) int64, one bit set for each sixteenth of a cell that holds a point (viewer.grid.cell_boxes).
    Writes, for the P pieces of S points that hold n, buckets (P, S) int32 and words (P, S, 4) uint32, the packed point and the
    lower 32 bits of its running number, by group and within a group in order; and starts (P, groups + 1) int32, where each
    group begins in a piece.  Points out of reach are left out.
    """
    direct, size = dense.size > 0, buckets.shape[1]
    outside = np.int32(_OUTSIDE if direct else -1)
    coordinates, numbers = xyz.reshape(-1), dense.reshape(-1)
    # _ROWS points at a time, in loops that compile to vector instructions over x, y, z, x, y, z, ... as stored
    low, high, lowest = np.empty(3 * _ROWS), np.empty(3 * _ROWS), np.empty(3 * _ROWS)
    sides, strides = np.empty(3 * _ROWS, np.int32), np.empty(3 * _ROWS, np.int32)
    for k in range(3 * _ROWS):
        axis = k % 3
        low[k], high[k], lowest[k] = reach[0, axis], reach[1, axis], base[axis]
        sides[k] = dense.shape[axis] if direct else 2**31 - 1
        strides[k] = 1 if axis == 2 or not direct else dense.shape[2] * (1 if axis == 1 else dense.shape[1])
    at, layer, cell = np.empty(3 * _ROWS, np.int32), np.empty(_ROWS, np.int32), np.empty(_ROWS, np.int32)
    steps, of_point, group_of = np.empty(3 * size, np.uint16), np.empty(size, np.int32), np.empty(size, np.uint8)
    free = np.empty(starts.shape[1], np.int32)
    for piece in range(buckets.shape[0]):
        begin = piece * size
        end, counts = min(begin + size, xyz.shape[0]), starts[piece]
        counts[:] = 0
        for start in range(begin, end, _ROWS):
            rows, done = min(_ROWS, end - start), start - begin
            part, packed = coordinates[3 * start : 3 * (start + rows)], steps[3 * done : 3 * (done + rows)]
            for k in range(3 * rows):
                inside = (part[k] >= low[k]) & (part[k] <= high[k])
                place = (part[k] if inside else low[k]) * inverse
                whole = np.floor(place)
                number = np.int32(whole - lowest[k])
                at[k] = number * strides[k] if inside & (number >= 0) & (number < sides[k]) else outside
                # the fraction of a tiny negative coordinate rounds up to 1, hence the clip
                packed[k] = min(np.int32((place - whole) * 65536.0), 65535)
            for k in range(rows):
                layer[k] = _draw(first + start + k)
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
                    cell[k] = table[_slot(table, x, y, z), 3] if (x >= 0) & (y >= 0) & (z >= 0) else -1
            for k in range(rows):
                bucket = layer[k] + cell[k] if cell[k] >= 0 else -1
                of_point[done + k], group_of[done + k] = bucket, groups[max(bucket, 0)]
            for k in range(rows):
                if cell[k] < 0:  # out of reach, or the file changed since pass 1, which the caller detects by the totals
                    continue
                counts[group_of[done + k] + 1] += 1
                x, y, z = packed[3 * k] >> _TO_SHARE, packed[3 * k + 1] >> _TO_SHARE, packed[3 * k + 2] >> _TO_SHARE
                marks[cell[k]] |= 1 << x | 1 << (SHARES + y) | 1 << (2 * SHARES + z)
        for group in range(1, starts.shape[1]):
            counts[group] += counts[group - 1]
        free[:] = counts
        for k in range(end - begin):
            if of_point[k] < 0:
                continue
            group, i = group_of[k], begin + k
            place = free[group]
            free[group] = place + 1
            buckets[piece, place] = of_point[k]
            words[piece, place, 0] = np.uint32(steps[3 * k]) | np.uint32(steps[3 * k + 1]) << np.uint32(16)
            words[piece, place, 1] = np.uint32(steps[3 * k + 2]) | np.uint32(attributes[i]) << np.uint32(16)
            colour = np.uint32(rgb[i, 0]) | np.uint32(rgb[i, 1]) << np.uint32(8) | np.uint32(rgb[i, 2]) << np.uint32(16)
            words[piece, place, 2] = colour | np.uint32(scan[i]) << np.uint32(24)
            words[piece, place, 3] = np.uint32(first + i)


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
