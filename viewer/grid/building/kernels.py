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
_SIDE_BIT = 4
"""The bit of a bucket's number that selects which of two threads places its points.  Not the lowest: the counters of
neighbouring buckets share a cache line (false sharing), and two threads that write to it are slower together than one alone."""


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
def _slot(table, x, y, z):
    """The row of cell (x, y, z), or the free row for it, in an open-addressing table (2**k, 4) int32: x, y, z, number (-1:
    free)."""
    mask = np.uint64(table.shape[0] - 1)
    h = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(y) * np.uint64(0xC2B2AE3D27D4EB4F)
    h += np.uint64(z) * np.uint64(0x165667B19E3779F9)
    slot = (h >> np.uint64(36)) & mask
    while table[slot, 3] >= 0 and (table[slot, 0] != x or table[slot, 1] != y or table[slot, 2] != z):
        slot = (slot + np.uint64(1)) & mask
    return slot


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
    used = tally[0]
    x0, y0, z0, x1, y1, z1 = bounds[0, 0], bounds[0, 1], bounds[0, 2], bounds[1, 0], bounds[1, 1], bounds[1, 2]
    bx, by, bz = base
    done = xyz.shape[0]
    px, py, pz, cell = 0, 0, 0, -1
    for i in range(start, xyz.shape[0]):
        x, y, z = xyz[i, 0], xyz[i, 1], xyz[i, 2]
        inside = (x >= reach[0, 0]) & (x <= reach[1, 0]) & (y >= reach[0, 1]) & (y <= reach[1, 1])
        inside &= (z >= reach[0, 2]) & (z <= reach[1, 2])
        if not inside:
            tally[2 if np.isfinite(x) and np.isfinite(y) and np.isfinite(z) else 1] += 1
            continue
        cx = np.int32(np.floor(x * inverse) - bx)
        cy = np.int32(np.floor(y * inverse) - by)
        cz = np.int32(np.floor(z * inverse) - bz)
        if cell < 0 or cx != px or cy != py or cz != pz:
            slot = _slot(table, cx, cy, cz)
            if table[slot, 3] < 0:
                if used == limit:
                    done = i
                    break
                table[slot, 0], table[slot, 1], table[slot, 2], table[slot, 3] = cx, cy, cz, used
                used += 1
            px, py, pz, cell = cx, cy, cz, table[slot, 3]
        counts[cell, geometric(first + i)] += 1
        x0, y0, z0 = x if x < x0 else x0, y if y < y0 else y0, z if z < z0 else z0
        x1, y1, z1 = x if x > x1 else x1, y if y > y1 else y1, z if z > z1 else z1
    bounds[0, 0], bounds[0, 1], bounds[0, 2], bounds[1, 0], bounds[1, 1], bounds[1, 2] = x0, y0, z0, x1, y1, z1
    tally[0] = used
    return done


@compiled(nogil=True)
def add_rows(counts, order, number, sums):
    """Adds row order[i] of counts (n, G) int64 to row number[i] of ``sums``."""
    for i in range(order.shape[0]):
        for value in range(counts.shape[1]):
            sums[number[i], value] += counts[order[i], value]


@compiled(nogil=True)
def pack_points(xyz, rgb, attributes, scan, first, inverse, base, reach, dense, table, cells, layers, buckets, words, marks):
    """Packs a slice of points and computes the bucket of each, layer * cells + cell.

    rgb: (n, 3) uint8.  attributes: (n,) uint16 (viewer.preprocess.point_attributes).  scan: (n,) uint8.  base: of the
    cells.  dense: (X, Y, Z) int32 cell numbers; where it is empty, they are looked up in ``table``.  Others as in count_points.
    marks: (C,) int64, one bit set for each sixteenth of a cell that holds a point (viewer.grid.cell_boxes).
    Writes buckets (n,) int32 and words (n, 4) uint32, the packed point and the lower 32 bits of its running number: points of
    one half of the buckets from the front in order, those of the other half from the back in reverse, so that two threads can
    place them.
    Returns (points at the front, points at the back); points out of reach are left out.
    """
    n, direct = xyz.shape[0], dense.size > 0
    front, back = 0, n - 1
    coordinates, numbers = xyz.reshape(-1), dense.reshape(-1)
    # _ROWS points at a time, in loops that compile to vector instructions over x, y, z, x, y, z, ... as stored
    low, high, lowest = np.empty(3 * _ROWS), np.empty(3 * _ROWS), np.empty(3 * _ROWS)
    sides, strides = np.empty(3 * _ROWS, np.int32), np.empty(3 * _ROWS, np.int32)
    for k in range(3 * _ROWS):
        axis = k % 3
        low[k], high[k], lowest[k] = reach[0, axis], reach[1, axis], base[axis]
        sides[k] = dense.shape[axis] if direct else 2**31 - 1
        strides[k] = 1 if axis == 2 or not direct else dense.shape[2] * (1 if axis == 1 else dense.shape[1])
    held, at, steps = np.empty(3 * _ROWS, np.bool_), np.empty(3 * _ROWS, np.int32), np.empty(3 * _ROWS, np.int32)
    layer = np.empty(_ROWS, np.int32)
    for start in range(0, n, _ROWS):
        rows = min(_ROWS, n - start)
        part = coordinates[3 * start : 3 * (start + rows)]
        for k in range(3 * rows):
            inside = (part[k] >= low[k]) & (part[k] <= high[k])
            place = (part[k] if inside else low[k]) * inverse
            whole = np.floor(place)
            number = np.int32(whole - lowest[k])
            held[k] = inside & (number >= 0) & (number < sides[k])
            at[k] = number * strides[k]
            # the fraction of a tiny negative coordinate rounds up to 1, hence the clip
            steps[k] = min(np.int32((place - whole) * 65536.0), 65535)
        for k in range(rows):
            layer[k] = _draw(first + start + k)
        for k in range(rows):
            layer[k] = max(layers - 1 - _BACK[layer[k]], 0)
        for k in range(rows):
            x, y, z = 3 * k, 3 * k + 1, 3 * k + 2
            if not (held[x] & held[y] & held[z]):
                continue
            cell = numbers[at[x] + at[y] + at[z]] if direct else table[_slot(table, at[x], at[y], at[z]), 3]
            if cell < 0:  # only where the file changed since pass 1, which the caller detects by the totals
                continue
            qx, qy, qz = np.uint32(steps[x]), np.uint32(steps[y]), np.uint32(steps[z])
            marks[cell] |= 1 << (qx >> _TO_SHARE) | 1 << (SHARES + (qy >> _TO_SHARE)) | 1 << (2 * SHARES + (qz >> _TO_SHARE))
            i, bucket = start + k, layer[k] * cells + cell
            behind = bucket >> _SIDE_BIT & 1  # without a branch, which could not be predicted
            place = front + (back - front) * behind
            front += 1 - behind
            back -= behind
            buckets[place] = bucket
            words[place, 0] = qx | qy << np.uint32(16)
            words[place, 1] = qz | np.uint32(attributes[i]) << np.uint32(16)
            colour = np.uint32(rgb[i, 0]) | np.uint32(rgb[i, 1]) << np.uint32(8) | np.uint32(rgb[i, 2]) << np.uint32(16)
            words[place, 2] = colour | np.uint32(scan[i]) << np.uint32(24)
            words[place, 3] = np.uint32(first + i)
    return front, n - 1 - back


@compiled(nogil=True)
def place_points(buckets, words, start, stop, stride, runs, points, numbered, records, high):
    """Moves packed points start, start + stride, ... before ``stop`` to their places in the runs of their buckets.

    runs: (buckets + 1, 2) int64, where each begins and how many of its points are placed, updated; side by side, since both
    are looked up at random.  numbered: running number of the block's first point.
    records, high: (N,) uint32 and uint8, receive bits 0 to 31 and 32 to 39 of each point's running number; ``high`` is empty
    where 32 bits suffice.
    """
    wide, upper, lower = high.size > 0, np.uint8(numbered >> 32), np.uint32(numbered & 0xFFFFFFFF)
    for i in range(start, stop, stride):
        bucket = buckets[i]
        first, number = runs[bucket, 0], runs[bucket, 1]
        size = runs[bucket + 1, 0] - first
        runs[bucket, 1] = number + 1
        if number < size:
            part = PART_OF[number & _PART_MASK]
            place = first + (size >> _PART_BITS) * part + PART_EXTRA[size & _PART_MASK, part] + (number >> _PART_BITS)
            points[place, 0], points[place, 1], points[place, 2] = words[i, 0], words[i, 1], words[i, 2]
            records[place] = words[i, 3]
            if wide:
                high[place] = upper + np.uint8(words[i, 3] < lower)  # a block is far shorter than 2**32 points


@compiled(nogil=True)
def gather_steps(points, starts, sizes, xyz):
    """Unpacks the positions within their cell of the points of some runs, until ``xyz`` is full.

    points: (N, 3) uint32 as in Scene.  starts, sizes: (R,) int64.  Writes xyz (3, n) float64, in packed steps.
    """
    done = 0
    for run in range(starts.shape[0]):
        for i in range(starts[run], starts[run] + min(sizes[run], xyz.shape[1] - done)):
            xyz[0, done], xyz[1, done] = points[i, 0] & 0xFFFF, points[i, 0] >> 16
            xyz[2, done] = points[i, 1] & 0xFFFF
            done += 1
    return done


@compiled(nogil=True)
def neighbour_distances(xyz, queries, k, squared, out, tallies):
    """Squared distance from each query (a column of xyz) to the k-th nearest position of other points, by exhaustive search.
    Points at the same position count once: duplicated points do not reduce the spacing.

    xyz: (3, n) float64, n > k, one row per axis, so that the first loop compiles to vector instructions.  queries: (m,) int64.
    squared: scratch, (n,) float64.  out: (m,) float64, to the last position where there are fewer than k, 0 where there is
    none.
    tallies: (m, 3) int64: other points at the query's position, positions found, and points at these.
    """
    xs, ys, zs = xyz[0], xyz[1], xyz[2]
    nearest, which = np.empty(k), np.empty(k, np.int64)
    for j in range(queries.shape[0]):
        nearest[:] = np.inf
        q = queries[j]
        x, y, z = xs[q], ys[q], zs[q]
        for i in range(xs.shape[0]):
            dx, dy, dz = xs[i] - x, ys[i] - y, zs[i] - z
            squared[i] = (dx * dx + dy * dy) + dz * dz
        worst, found, same, repeated = np.inf, 0, 0, False
        for i in range(xs.shape[0]):
            d = squared[i]
            if d < worst:
                if d == 0.0:
                    same += 1
                    continue
                at, again = min(found, k - 1), False
                for n in range(found):
                    if nearest[n] == d:
                        m = which[n]
                        again |= (xs[m] == xs[i]) & (ys[m] == ys[i]) & (zs[m] == zs[i])
                if again:
                    repeated = True
                    continue
                while at > 0 and nearest[at - 1] > d:
                    nearest[at], which[at] = nearest[at - 1], which[at - 1]
                    at -= 1
                nearest[at], which[at] = d, i
                found = min(found + 1, k)
                worst = nearest[k - 1]
        out[j] = nearest[found - 1] if found else 0.0
        held = found
        if repeated:
            held = -same
            for i in range(xs.shape[0]):
                held += squared[i] <= out[j]
        tallies[j, 0], tallies[j, 1], tallies[j, 2] = same - 1, found, held
