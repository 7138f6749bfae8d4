"""Compiled loops of the photographs on the processor; reference implementation: model/reference/photo_colours.py.

The picture is worked on in tiles; of each tile those photographs are looked at whose frustum meets the tile's depths, which
changes no pixel.  Planes are (H, W); records are those of viewer.render.photographs.photo_pool.
"""

import numpy as np

from ....model.common.jit import compiled
from ....model.reference.photo_colours import (
    AGREES,
    AT_BORDER,
    BLOCK,
    BORDER,
    COARSE,
    GRAZING,
    HIDDEN,
    LEAST_ANGLE,
    MOST,
    NORMAL_AT,
    PINHOLE,
    POINTS_VOTE,
    SPARSE,
    SPHERICAL,
)
from .photo_pool import AROUND, GAINS, HEIGHT, KIND, LENS, LEVEL, LEVELS, MAP, MAP_HEIGHT, MAP_WIDTH, SHIFT, TURN, WIDTH

TILE = 16
"""Pixels along a side of a tile; a multiple of BLOCK."""
HALVES = (np.arange(256) / 255).astype(np.float16).view(np.uint16).astype(np.uint32)
"""Half-precision bits of a level 0..255 as the network takes it."""
_ONE = np.uint32(0x3C00)  # 1.0 in half precision
_F = np.float32


@compiled(nogil=True)
def _candidates(num, whole, lens, left, top, right, bottom, near, far, found):
    """Writes to ``found`` the photographs whose frustum a block of the view frustum may meet, and returns how many."""
    count = 0
    for photo in range(len(num)):
        if whole[photo, KIND] == PINHOLE:
            outside = 31  # of five planes: in front, and the four sides
            for corner in range(8):
                z = near if corner & 1 else far
                u = ((right if corner & 2 else left) - lens[2]) / lens[0] * z
                v = ((bottom if corner & 4 else top) - lens[3]) / lens[1] * z
                x = num[photo, TURN] * u + num[photo, TURN + 1] * v + num[photo, TURN + 2] * z + num[photo, SHIFT]
                y = num[photo, TURN + 3] * u + num[photo, TURN + 4] * v + num[photo, TURN + 5] * z + num[photo, SHIFT + 1]
                d = -(num[photo, TURN + 6] * u + num[photo, TURN + 7] * v + num[photo, TURN + 8] * z + num[photo, SHIFT + 2])
                fx, fy, cx, cy = num[photo, LENS], num[photo, LENS + 1], num[photo, LENS + 2], num[photo, LENS + 3]
                out = (1 if d <= 0 else 0) + (2 if cx * d + fx * x < 0 else 0) + (8 if cy * d - fy * y < 0 else 0)
                out += 4 if (whole[photo, WIDTH] - cx) * d - fx * x < 0 else 0
                out += 16 if (whole[photo, HEIGHT] - cy) * d + fy * y < 0 else 0
                outside &= out
            if outside:
                continue
        found[count] = photo
        count += 1
    return count


@compiled(nogil=True)
def _sample(words, num, whole, photo, level, column, row, colours, k):
    """Bilinear colour times gains into colours[k]; False where a texel holds nothing."""
    width, height, start = whole[photo, WIDTH], whole[photo, HEIGHT], whole[photo, LEVEL + level]
    for _ in range(level):
        width, height = (width + 1) // 2, (height + 1) // 2
    a, b = column * (_F(width) / _F(whole[photo, WIDTH])) - _F(0.5), row * (_F(height) / _F(whole[photo, HEIGHT])) - _F(0.5)
    left, top = int(np.floor(a)), int(np.floor(b))
    s, t = a - _F(left), b - _F(top)
    right, below, top = left + 1, min(top + 1, height - 1), max(top, 0)
    if whole[photo, AROUND]:
        left, right = left % width, right % width
    else:
        left, right = max(left, 0), min(right, width - 1)
    one, two = words[start + top * width + left], words[start + top * width + right]
    three, four = words[start + below * width + left], words[start + below * width + right]
    if (one & two & three & four) >> 24 != 255:
        return False
    for c in range(3):
        shift = 8 * c
        upper = _F((one >> shift) & 255) * (_F(1.0) - s) + _F((two >> shift) & 255) * s
        lower = _F((three >> shift) & 255) * (_F(1.0) - s) + _F((four >> shift) & 255) * s
        colours[k, c] = (upper * (_F(1.0) - t) + lower * t) * num[photo, GAINS + c]
    return True


@compiled(nogil=True)
def _vote(colours, weights, count, base, out):
    """The mean of ``count`` colours, those that disagree outvoted, into out (3,).  weights[0] is the largest."""
    if count == 1:  # the points alone do not outvote it
        for c in range(3):
            out[c] = min(colours[0, c], _F(255.0))
        return
    best, middle = _F(np.inf), 0
    own = _F(POINTS_VOTE) * weights[0]
    for j in range(count + 1):
        cost = _F(0.0)
        for i in range(count + 1):
            apart = _F(0.0)
            for c in range(3):
                apart += abs((colours[i, c] if i < count else base[c]) - (colours[j, c] if j < count else base[c]))
            cost += (weights[i] if i < count else own) * apart
        if cost < best:
            best, middle = cost, j
    total = _F(0.0)
    out[:] = _F(0.0)
    for i in range(count):
        apart = _F(0.0)
        for c in range(3):
            apart = max(apart, abs(colours[i, c] - (colours[middle, c] if middle < count else base[c])))
        apart *= _F(1.0 / AGREES)
        agrees = _F(1.0) + apart * apart
        share = weights[i] / (agrees * agrees)
        total += share
        for c in range(3):
            out[c] += share * colours[i, c]
    for c in range(3):
        out[c] = min(max(out[c] / total, _F(0.0)), _F(255.0))


@compiled(nogil=True)
def photograph_rows(filled, depth, certain, grid, lens, numbers, places, words, network, made, share, first, last):
    """Colours made (H, W, 4) uint8, a copy of ``filled``, and share (H, W) uint8, zeros, in tile rows ``first`` to ``last``.

    filled: (H, W, 4) uint8.  certain: of least_rows.  grid: of count_measured.  lens: (4,) float32.
    words: uint32 of the pool.  network: (H, W, 4) uint32, the network's input, changed where photographs colour; (0, 0, 4):
    none.
    """
    height, width = depth.shape
    ranges = words.view(np.float32)
    found, weights, confident = np.empty(len(numbers), np.int64), np.empty(MOST, np.float32), np.empty(MOST, np.float32)
    who, where = np.empty(MOST, np.int64), np.empty((MOST, 3), np.float32)
    colours, out, base = np.empty((MOST, 3), np.float32), np.empty(3, np.float32), np.empty(3, np.float32)
    for top in range(first * TILE, min(last * TILE, height), TILE):
        bottom = min(top + TILE, height)
        for left in range(0, width, TILE):
            right = min(left + TILE, width)
            near, far = _F(np.inf), _F(0.0)
            for y in range(top, bottom):
                for x in range(left, right):
                    z = depth[y, x]
                    near, far = min(near, z if z > _F(0.0) else near), max(far, z)
            if not far > _F(0.0):
                continue
            count = _candidates(numbers, places, lens, left, top, right, bottom, near, far, found)
            if count == 0:
                continue
            for y in range(top, bottom):
                for x in range(left, right):
                    sure = certain[y, x]
                    if sure <= _F(0.0):
                        continue
                    kept = _best(depth, grid, lens, numbers, places, ranges, x, y, sure, found, count, weights, confident, who,
                                 where)
                    most, used = _F(0.0), 0
                    for k in range(kept):
                        if _sample(words, numbers, places, who[k], int(where[k, 2]), where[k, 0], where[k, 1], colours, used):
                            weights[used] = weights[k]
                            most, used = max(most, confident[k]), used + 1
                    if used == 0:
                        continue
                    for c in range(3):
                        base[c] = _F(filled[y, x, c])
                    _vote(colours, weights, used, base, out)
                    for c in range(3):
                        made[y, x, c] = np.uint8(base[c] + (out[c] - base[c]) * most + _F(0.5))
                    share[y, x] = np.uint8(most * _F(255.0) + _F(0.5))
                    if len(network) > 0:
                        _tell_network(network, y, x, made, share[y, x])


@compiled(nogil=True)
def _tell_network(network, y, x, made, share):
    """Sets the colour in the network's input; where the photograph prevails, measured without noise."""
    network[y, x, 0] = HALVES[made[y, x, 0]] | HALVES[made[y, x, 1]] << np.uint32(16)
    if share > 127:
        network[y, x, 1] = HALVES[made[y, x, 2]] | _ONE << np.uint32(16)
        network[y, x, 2] = network[y, x, 2] & np.uint32(0xFFFF)
    else:
        network[y, x, 1] = HALVES[made[y, x, 2]] | (network[y, x, 1] & np.uint32(0xFFFF0000))


@compiled(nogil=True)
def _best(depth, grid, lens, num, whole, ranges, x, y, sure, found, count, weights, confident, who, where):
    """The best photographs of a pixel: their weight, confidence, number, and column, row and mip level.  Returns how many."""
    height, width = depth.shape
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    z = depth[y, x]
    px, py = (_F(x) + _F(0.5) - cx) / fx, (_F(y) + _F(0.5) - cy) / fy
    length = np.sqrt(px * px + py * py + _F(1.0))
    vx, vy, vz = px / length, py / length, _F(1.0) / length
    px, py = px * z, py * z
    left, right = max(x - NORMAL_AT, 0), min(x + NORMAL_AT, width - 1)
    up, down = max(y - NORMAL_AT, 0), min(y + NORMAL_AT, height - 1)
    zl, zr, zu, zd = depth[y, left], depth[y, right], depth[up, x], depth[down, x]
    u, v = (_F(x) + _F(0.5) - cx) / fx, (_F(y) + _F(0.5) - cy) / fy
    ax = (_F(right) + _F(0.5) - cx) / fx * zr - (_F(left) + _F(0.5) - cx) / fx * zl
    ay, az = v * (zr - zl), zr - zl
    by = (_F(down) + _F(0.5) - cy) / fy * zd - (_F(up) + _F(0.5) - cy) / fy * zu
    bx, bz = u * (zd - zu), zd - zu
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    size = np.sqrt(nx * nx + ny * ny + nz * nz)
    if not size > _F(0.0):
        return 0
    nx, ny, nz = nx / size, ny / size, nz / size
    spacing = _between(grid, (_F(x) + _F(0.5)) * _F(1.0 / BLOCK) - _F(0.5), (_F(y) + _F(0.5)) * _F(1.0 / BLOCK) - _F(0.5))
    sure *= min((_F(SPARSE[1]) - spacing) * _F(1.0 / (SPARSE[1] - SPARSE[0])), _F(1.0))
    if not sure > _F(0.0):
        return 0
    kept = 0
    for k in range(count):
        photo = found[k]
        qx = num[photo, TURN] * px + num[photo, TURN + 1] * py + num[photo, TURN + 2] * z + num[photo, SHIFT]
        qy = num[photo, TURN + 3] * px + num[photo, TURN + 4] * py + num[photo, TURN + 5] * z + num[photo, SHIFT + 1]
        qz = num[photo, TURN + 6] * px + num[photo, TURN + 7] * py + num[photo, TURN + 8] * z + num[photo, SHIFT + 2]
        wide, high = whole[photo, WIDTH], whole[photo, HEIGHT]
        if whole[photo, KIND] == PINHOLE:
            if not qz < _F(0.0):
                continue
            column = num[photo, LENS + 2] - qx / qz * num[photo, LENS]
            row = num[photo, LENS + 3] + qy / qz * num[photo, LENS + 1]
        else:
            flat = np.sqrt(qx * qx + qy * qy)
            if not flat > _F(0.0):
                continue
            rise = np.arctan2(qz, flat) if whole[photo, KIND] == SPHERICAL else qz / flat
            column = num[photo, LENS + 2] - np.arctan2(qy, qx) * num[photo, LENS]
            row = num[photo, LENS + 3] - rise * num[photo, LENS + 1]
            if whole[photo, AROUND]:
                column -= np.floor(column / _F(wide)) * _F(wide)
        if not (_F(0.0) <= column < _F(wide) and _F(0.0) <= row < _F(high)):
            continue
        far = np.sqrt(qx * qx + qy * qy + qz * qz)
        across = min(int(column * (_F(whole[photo, MAP_WIDTH]) / _F(wide))), whole[photo, MAP_WIDTH] - 1)
        along = min(int(row * (_F(whole[photo, MAP_HEIGHT]) / _F(high))), whole[photo, MAP_HEIGHT] - 1)
        nearest = ranges[whole[photo, MAP] + along * whole[photo, MAP_WIDTH] + across]
        visible = min(max(_F(2.0) - (far / nearest - _F(1.0)) * _F(1.0 / HIDDEN), _F(0.0)), _F(1.0))
        footprint = far / num[photo, LENS] * fx / z
        fine = min(max((_F(COARSE[1]) - footprint / spacing) * _F(1.0 / (COARSE[1] - COARSE[0])), _F(0.0)), _F(1.0))
        if visible * fine <= _F(0.0):
            continue
        rx = (num[photo, TURN] * qx + num[photo, TURN + 3] * qy + num[photo, TURN + 6] * qz) / far
        ry = (num[photo, TURN + 1] * qx + num[photo, TURN + 4] * qy + num[photo, TURN + 7] * qz) / far
        rz = (num[photo, TURN + 2] * qx + num[photo, TURN + 5] * qy + num[photo, TURN + 8] * qz) / far
        facing = abs(rx * nx + ry * ny + rz * nz)
        steep = min(max((facing - _F(GRAZING[0])) * _F(1.0 / (GRAZING[1] - GRAZING[0])), _F(0.0)), _F(1.0))
        confidence = sure * visible * fine * steep
        border = min(row, _F(high) - row)
        if not whole[photo, AROUND]:
            border = min(border, min(column, _F(wide) - column))
        apart = _F(1.0) - min(max(rx * vx + ry * vy + rz * vz, _F(-1.0)), _F(1.0))
        weight = confidence * facing / ((_F(LEAST_ANGLE) + apart) * footprint)
        weight *= _F(AT_BORDER) + _F(1.0 - AT_BORDER) * min(border / (_F(BORDER) * _F(wide)), _F(1.0))
        if not weight > _F(0.0) or (kept == MOST and weight <= weights[MOST - 1]):
            continue
        level = min(max(np.floor(np.log2(_F(1.0) / footprint) + _F(0.5)), _F(0.0)), _F(whole[photo, LEVELS] - 1))
        place = min(kept, MOST - 1)
        while place > 0 and weights[place - 1] < weight:
            weights[place], confident[place], who[place] = weights[place - 1], confident[place - 1], who[place - 1]
            where[place, 0], where[place, 1], where[place, 2] = where[place - 1, 0], where[place - 1, 1], where[place - 1, 2]
            place -= 1
        weights[place], confident[place], who[place] = weight, confidence, photo
        where[place, 0], where[place, 1], where[place, 2] = column, row, level
        kept = min(kept + 1, MOST)
    return kept


@compiled(nogil=True)
def _between(grid, x, y):
    """A grid between the middles of its cells, its border repeated."""
    rows, columns = grid.shape
    left, top = int(np.floor(x)), int(np.floor(y))
    s, t = x - _F(left), y - _F(top)
    one, two = min(max(left, 0), columns - 1), min(max(left + 1, 0), columns - 1)
    first, second = min(max(top, 0), rows - 1), min(max(top + 1, 0), rows - 1)
    upper = grid[first, one] * (_F(1.0) - s) + grid[first, two] * s
    return upper * (_F(1.0) - t) + (grid[second, one] * (_F(1.0) - s) + grid[second, two] * s) * t
