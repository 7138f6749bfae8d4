"""Compiled loops over the cells of splats: Morton keys, moments of cells, and their merging into cells of twice the side.

Frame: relative to the lowest corner of the points, file units.  Moments of a cell: number of points, mean relative to the
centre of the cell, and sums of products relative to the mean (xx, xy, xz, yy, yz, zz); of the points with a colour their
number, mean in linear light, and the sum of squared deviations of sRGB from its mean, over the three channels.
Reference implementation: tests/unit/work/plain_splats.py.
"""

from ....model.common.jit import compiled

MOMENTS = 10
"""Columns of the moments of places: number, mean, products."""
COLOURS = 8
"""Columns of the moments of colours: number, mean in linear light, mean in sRGB, squared deviations."""


@compiled(inline="always")
def spread(value):
    """The lowest 21 bits of a value, each followed by two bits 0."""
    value = value & 0x1FFFFF
    value = (value | value << 32) & 0x1F00000000FFFF
    value = (value | value << 16) & 0x1F0000FF0000FF
    value = (value | value << 8) & 0x100F00F00F00F00F
    value = (value | value << 4) & 0x10C30C30C30C30C3
    return (value | value << 2) & 0x1249249249249249


@compiled(inline="always")
def gathered_bits(value):
    """Every third bit of a value: the inverse of ``spread``."""
    value = value & 0x1249249249249249
    value = (value | value >> 2) & 0x10C30C30C30C30C3
    value = (value | value >> 4) & 0x100F00F00F00F00F
    value = (value | value >> 8) & 0x1F0000FF0000FF
    value = (value | value >> 16) & 0x1F00000000FFFF
    return (value | value >> 32) & 0x1FFFFF


@compiled(inline="always")
def morton(x, y, z):
    """Key of the cell with these numbers along the axes, each 0 <= number < 2**21."""
    return spread(x) | spread(y) << 1 | spread(z) << 2


@compiled(nogil=True)
def morton_keys(xyz, side, keys, begin, end):
    """keys: (n,) int64, result for the points begin..end of xyz (n, 3) float64, all >= 0."""
    for i in range(begin, end):
        keys[i] = morton(int(xyz[i, 0] / side), int(xyz[i, 1] / side), int(xyz[i, 2] / side))


@compiled(nogil=True)
def cell_moments(xyz, linear, srgb, coloured, order, first, keys, side, places, colours, begin, end):
    """Moments of the cells begin..end.

    xyz: (n, 3) float64.  linear, srgb: (256,) float64, values of a channel's codes.  coloured: (n, 4) uint8, red, green, blue,
    and 1 where the point has a colour.  order: (n,) points sorted by key.  first: (c + 1,) where each cell begins in it.
    keys: (c,).  places: (c, MOMENTS) float32 and colours: (c, COLOURS) float32, results.
    """
    for cell in range(begin, end):
        key = keys[cell]
        cx = (gathered_bits(key) + 0.5) * side
        cy = (gathered_bits(key >> 1) + 0.5) * side
        cz = (gathered_bits(key >> 2) + 0.5) * side
        count = first[cell + 1] - first[cell]
        mx = my = mz = 0.0
        known = 0
        lr = lg = lb = sr = sg = sb = 0.0
        for at in range(first[cell], first[cell + 1]):
            i = order[at]
            mx += xyz[i, 0] - cx
            my += xyz[i, 1] - cy
            mz += xyz[i, 2] - cz
            if coloured[i, 3]:
                known += 1
                lr += linear[coloured[i, 0]]
                lg += linear[coloured[i, 1]]
                lb += linear[coloured[i, 2]]
                sr += srgb[coloured[i, 0]]
                sg += srgb[coloured[i, 1]]
                sb += srgb[coloured[i, 2]]
        mx, my, mz = mx / count, my / count, mz / count
        many = max(known, 1)
        sr, sg, sb = sr / many, sg / many, sb / many
        xx = xy = xz = yy = yz = zz = squares = 0.0
        for at in range(first[cell], first[cell + 1]):
            i = order[at]
            dx, dy, dz = xyz[i, 0] - cx - mx, xyz[i, 1] - cy - my, xyz[i, 2] - cz - mz
            xx += dx * dx
            xy += dx * dy
            xz += dx * dz
            yy += dy * dy
            yz += dy * dz
            zz += dz * dz
            if coloured[i, 3]:
                squares += ((srgb[coloured[i, 0]] - sr) ** 2 + (srgb[coloured[i, 1]] - sg) ** 2
                            + (srgb[coloured[i, 2]] - sb) ** 2)  # fmt: skip
        row = places[cell]
        row[0], row[1], row[2], row[3], row[4] = count, mx, my, mz, xx
        row[5], row[6], row[7], row[8], row[9] = xy, xz, yy, yz, zz
        tint = colours[cell]
        tint[0], tint[1], tint[2], tint[3] = known, lr / many, lg / many, lb / many
        tint[4], tint[5], tint[6], tint[7] = sr, sg, sb, squares


@compiled(inline="always")
def add_places(total, row, x, y, z):
    """Adds to the moments of places ``total`` those of a cell, whose mean is at (x, y, z) in the frame of ``total``
    (Chan et al. 1979)."""
    n, m = total[0], row[0]
    dx, dy, dz = x - total[1], y - total[2], z - total[3]
    part = n * m / (n + m)
    total[4] += row[4] + dx * dx * part
    total[5] += row[5] + dx * dy * part
    total[6] += row[6] + dx * dz * part
    total[7] += row[7] + dy * dy * part
    total[8] += row[8] + dy * dz * part
    total[9] += row[9] + dz * dz * part
    total[0] = n + m
    total[1] += dx * m / (n + m)
    total[2] += dy * m / (n + m)
    total[3] += dz * m / (n + m)


@compiled(inline="always")
def add_colours(total, tint):
    """Adds to the moments of colours ``total`` those of a cell."""
    known, k = total[0], tint[0]
    if k > 0:
        dr, dg, db = tint[4] - total[4], tint[5] - total[5], tint[6] - total[6]
        total[7] += tint[7] + (dr * dr + dg * dg + db * db) * known * k / (known + k)
        total[0] = known + k
        share = k / (known + k)
        for channel in range(1, 7):
            total[channel] += (tint[channel] - total[channel]) * share


@compiled(nogil=True)
def merged_moments(keys, side, places, colours, child, up_keys, up_places, up_colours, begin, end):
    """Moments of the cells begin..end of twice the side, from those of their up to eight cells (Chan et al. 1979).

    child: (u + 1,) where the cells of each begin.  side: of the smaller cells.
    """
    for up in range(begin, end):
        cx = (gathered_bits(up_keys[up]) + 0.5) * (2 * side)
        cy = (gathered_bits(up_keys[up] >> 1) + 0.5) * (2 * side)
        cz = (gathered_bits(up_keys[up] >> 2) + 0.5) * (2 * side)
        total, hue = up_places[up], up_colours[up]
        total[:], hue[:] = 0.0, 0.0
        for cell in range(child[up], child[up + 1]):
            key, row = keys[cell], places[cell]
            x = (gathered_bits(key) + 0.5) * side - cx + row[1]
            y = (gathered_bits(key >> 1) + 0.5) * side - cy + row[2]
            z = (gathered_bits(key >> 2) + 0.5) * side - cz + row[3]
            add_places(total, row, x, y, z)
            add_colours(hue, colours[cell])
