"""Compiled loops that sort points into cells and find cells again.

Cells are cubes; 8 x 8 x 8 of them are a block.  The key of a cell holds its block before its place in the block, so that the
cells of a block follow each other where keys are sorted.  Frame: relative to the lowest corner of the points, file units.
"""

import math

from ....model.common.jit import compiled

AXIS_BITS = 21
"""Bits of a cell's number along an axis: three of them fill the 63 bits of a positive key."""
_FREE = -1
"""Marks a place of a hash table that is not used."""


@compiled(inline="always")
def key_of(x, y, z):
    """Key of the cell with these numbers along the axes, each 0 <= number < 2**21."""
    block = (((x >> 3) << 18 | (y >> 3)) << 18) | (z >> 3)
    return block << 9 | (x & 7) << 6 | (y & 7) << 3 | (z & 7)


@compiled(inline="always")
def first_cell(low, side):
    """Number of the first cell that a range from ``low`` on meets."""
    return max(math.floor(low / side), 0)


@compiled(inline="always")
def end_cell(high, side, count):
    """Number of the last cell of ``count`` that a range up to ``high`` meets, and 1."""
    return min(math.floor(high / side) + 1, count)


@compiled(nogil=True)
def cell_keys(xyz, side, keys, begin, end):
    """keys: (n,) int64, result for the points begin..end of xyz (n, 3) float64, all >= 0."""
    for i in range(begin, end):
        keys[i] = key_of(int(xyz[i, 0] / side), int(xyz[i, 1] / side), int(xyz[i, 2] / side))


@compiled(nogil=True)
def gathered(xyz, order, sorted_xyz, begin, end):
    """Copies the points ``order[begin:end]`` to their places in sorted_xyz (n, 3)."""
    for i in range(begin, end):
        for axis in range(3):
            sorted_xyz[i, axis] = xyz[order[i], axis]


@compiled(nogil=True)
def order_in_cells(points, order, first, begin, end):
    """Sorts the points of the cells begin..end by x, y and z, and ``order`` with them (Shell's sort, in place).

    points: (n, 3) sorted by cell.  order: (n,).  first: where each cell begins.  What is computed from the points of a cell
    then depends on neither the order of a file nor that of a grid, to the last bit.
    """
    for cell in range(begin, end):
        low, high = first[cell], first[cell + 1]
        gap = 1
        while 3 * gap + 1 < high - low:
            gap = 3 * gap + 1  # Knuth's gaps
        while gap > 0:
            for i in range(low + gap, high):
                x, y, z, number = points[i, 0], points[i, 1], points[i, 2], order[i]
                j = i - gap
                while j >= low and (
                    points[j, 0] > x
                    or (points[j, 0] == x and (points[j, 1] > y or (points[j, 1] == y and points[j, 2] > z)))
                ):
                    for axis in range(3):
                        points[j + gap, axis] = points[j, axis]
                    order[j + gap] = order[j]
                    j -= gap
                points[j + gap, 0], points[j + gap, 1], points[j + gap, 2], order[j + gap] = x, y, z, number
            gap //= 3


@compiled(nogil=True)
def runs(keys, order, found, first):
    """The different values of keys[order], which ascend, and where each begins.

    found: int64, first: int64, results, long enough.  Returns how many there are; ``first`` gets one entry more, the end.
    """
    count = 0
    last = -1
    for i in range(order.shape[0]):
        key = keys[order[i]]
        if key != last:
            found[count] = key
            first[count] = i
            count += 1
            last = key
    first[count] = order.shape[0]
    return count


@compiled(inline="always")
def _home(key, mask):
    mixed = key * -7046029254386353131  # 2**64 divided by the golden ratio (Knuth)
    return (mixed ^ (mixed >> 29)) & mask


@compiled(nogil=True)
def fill_table(keys, table):
    """table: (2**k,) int32, result: places of keys by their hash, open addressing, -1 where free."""
    mask = table.shape[0] - 1
    for i in range(table.shape[0]):
        table[i] = _FREE
    for i in range(keys.shape[0]):
        at = _home(keys[i], mask)
        while table[at] != _FREE:
            at = (at + 1) & mask
        table[at] = i


@compiled(inline="always")
def place_of(key, keys, table):
    """Index of a key in ``keys``, -1 where it is not there."""
    mask = table.shape[0] - 1
    at = _home(key, mask)
    while table[at] != _FREE and keys[table[at]] != key:
        at = (at + 1) & mask
    return table[at]


@compiled(nogil=True)
def nearest_point(x, y, z, limit, side, sizes, points, keys, first, table, blocks, block_first, block_table):
    """Index of the point nearest to a place and within ``limit`` of it, -1 where there is none.

    sizes: (3,) int64, cells along the axes.  points: (n, 3) sorted.  keys, first, table: of the cells; blocks, block_first,
    block_table: of the blocks, whose entries are cells.
    """
    best, found = limit * limit, -1
    cx, cy, cz = math.floor(x / side), math.floor(y / side), math.floor(z / side)
    for ix in range(max(cx - 1, 0), min(cx + 2, sizes[0])):
        for iy in range(max(cy - 1, 0), min(cy + 2, sizes[1])):
            for iz in range(max(cz - 1, 0), min(cz + 2, sizes[2])):
                cell = place_of(key_of(ix, iy, iz), keys, table)
                if cell < 0:
                    continue
                for i in range(first[cell], first[cell + 1]):
                    away = (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 + (points[i, 2] - z) ** 2
                    if away <= best:
                        best, found = away, i
    if best <= side * side:
        return found  # every point within a side lies in these cells
    wide = 8 * side
    bx, by, bz = math.floor(x / wide), math.floor(y / wide), math.floor(z / wide)
    for ring in range(int(limit / wide) + 2):
        if ring > 1 and ((ring - 1) * wide) ** 2 > best:
            break
        for ix in range(max(bx - ring, 0), min(bx + ring, (sizes[0] - 1) >> 3) + 1):
            for iy in range(max(by - ring, 0), min(by + ring, (sizes[1] - 1) >> 3) + 1):
                inner = abs(ix - bx) < ring and abs(iy - by) < ring
                for iz in range(max(bz - ring, 0), min(bz + ring, (sizes[2] - 1) >> 3) + 1):
                    if inner and abs(iz - bz) < ring:
                        continue
                    if box_distance(x, y, z, ix * wide, iy * wide, iz * wide, wide) > best:
                        continue
                    block = place_of(key_of(ix << 3, iy << 3, iz << 3) >> 9, blocks, block_table)
                    if block < 0:
                        continue
                    for cell in range(block_first[block], block_first[block + 1]):
                        jx, jy, jz = cell_numbers(keys[cell])
                        if box_distance(x, y, z, jx * side, jy * side, jz * side, side) > best:
                            continue
                        for i in range(first[cell], first[cell + 1]):
                            away = (points[i, 0] - x) ** 2 + (points[i, 1] - y) ** 2 + (points[i, 2] - z) ** 2
                            if away <= best:
                                best, found = away, i
    return found


@compiled(inline="always")
def cell_numbers(key):
    """Numbers along the axes of the cell with this key."""
    return ((key >> 45 & 0x3FFFF) << 3 | (key >> 6 & 7), (key >> 27 & 0x3FFFF) << 3 | (key >> 3 & 7),
            (key >> 9 & 0x3FFFF) << 3 | (key & 7))  # fmt: skip


@compiled(inline="always")
def box_distance(x, y, z, left, front, low, side):
    """Squared distance of a place from a cube."""
    dx = max(left - x, 0.0, x - left - side)
    dy = max(front - y, 0.0, y - front - side)
    dz = max(low - z, 0.0, z - low - side)
    return dx * dx + dy * dy + dz * dz
