"""Compiled inner loops of the grid: find a point's cell, draw its layer, count points; pack_kernels packs and places them.

They are serial and release the interpreter's lock.  Callers run them on slices in a thread pool, which needs no parallel
compilation and, unlike numba's own threads, is safe from any thread.  No result depends on the number of threads.

Cells are numbered from an integer base: cell = floor(p / cell_size) - base, with p / cell_size exact, because the
cell size is a power of two.
"""

import numpy as np

from ....model.common.jit import compiled

GEOMETRIC = 16
"""Number of values the seeded geometric variable takes: 0..15."""
_SEED = np.uint64(0x706F696E74676C61)  # arbitrary ("pointgla" in ASCII); fixed, so that a scan always gives the same layers
TRAILING_ZEROS = np.array([0, 1, 2, 5, 3, 9, 6, 11, 15, 4, 8, 10, 14, 7, 13, 12])
"""Trailing zeros of 2**n, by de Bruijn's sequence 0x09AF."""
ROWS = 64
"""Points whose cells and packed positions are computed at a time: the arrays for them take 8 KB, so that they stay in the
first-level cache."""


@compiled(inline="always")
def drawn_value(index):
    """The index into TRAILING_ZEROS for the geometric value of a point: the trailing zeros of a seeded hash (splitmix64) of its
    running number, 0 for half of all points, 1 for a quarter, ..., at most GEOMETRIC - 1."""
    z = np.uint64(index) * np.uint64(0x9E3779B97F4A7C15) + _SEED
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    z = (z ^ (z >> np.uint64(31))) | np.uint64(1 << (GEOMETRIC - 1))
    lowest = z & (~z + np.uint64(1))
    return (lowest * np.uint64(0x09AF) >> np.uint64(12)) & np.uint64(15)


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
def slot_of(table, x, y, z):
    """As _slot_from, from the cell's hash."""
    return _slot_from(table, _hash(x, y, z) & np.uint64(table.shape[0] - 1), x, y, z)


@compiled(nogil=True)
def occupied(xyz, inverse, limit, seen):
    """The number of cells that points xyz (n, 3) float64 occupy; stops counting beyond ``limit``.

    Cell numbers are float64 and not looked up by slot_of: without a base they do not fit int32.
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
        slot = slot_of(table, cells[i, 0], cells[i, 1], cells[i, 2])
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
    low, high, lowest = np.empty(3 * ROWS), np.empty(3 * ROWS), np.empty(3 * ROWS)
    least, most = np.empty(3 * ROWS), np.empty(3 * ROWS)
    for k in range(3 * ROWS):
        axis = k % 3
        low[k], high[k], lowest[k] = reach[0, axis], reach[1, axis], base[axis]
        least[k], most[k] = bounds[0, axis], bounds[1, axis]
    at, value, number = np.empty(3 * ROWS, np.int32), np.empty(ROWS, np.int32), np.empty(ROWS, np.int32)
    # ROWS points at a time, in short loops, most of which compile to vector instructions
    for begin in range(start, xyz.shape[0], ROWS):
        rows, lost = min(ROWS, xyz.shape[0] - begin), 0
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
            value[k] = drawn_value(first + begin + k)
        for k in range(rows):
            value[k] = TRAILING_ZEROS[value[k]]
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
    for k in range(3 * ROWS):
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
