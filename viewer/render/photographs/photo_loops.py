"""Compiled loops of the photographs on the processor; reference implementation: model/reference/photo_colours.py.
Its constants and those of photo_tile_loops are compiled in.

The picture is worked on in tiles (photo_tile_loops).  Of each tile those photographs are looked at whose frustum meets the
tile's depths and whose pixels are fine enough: the one that could weigh most first, until no further one could be among the
best of any pixel.  This changes no pixel.  Planes are (H, W); records are those of viewer.render.photographs.photo_pool.
"""

import numpy as np

from ....model.common.jit import compiled
from ....model.reference.photo_colours import COARSE, GRAZING, LEAST_ANGLE, MOST, PINHOLE
from .photo_pool import HEIGHT, KIND, LENS, SHIFT, TURN, WIDTH
from .photo_surface_loops import SURROUNDINGS, surface
from .photo_texel_loops import TEXEL_PLANES, locate, sample
from .photo_tile_loops import (
    BLUE,
    GREEN,
    MEAN_BLUE,
    MEAN_GREEN,
    MEAN_RED,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    PIXELS,
    PLANE,
    PLANES,
    RED,
    SHARE,
    SLOT_PLANES,
    SPACING,
    SURE,
    TILE,
    VIEW_X,
    VIEW_Y,
    VIEW_Z,
    WEIGHT,
    WORD_PLANES,
    Z,
    among_best,
    could_improve,
    orient,
    project,
    rank,
    ranked,
    vote,
    weigh,
)

_ROUNDED, _SLACK = 1.001, 0.002  # bounds are computed in float32; radians
_F = np.float32


@compiled(nogil=True, fastmath={"nnan", "nsz"})
def _extent(s):
    """Nearest and farthest depth and the largest spacing of a tile's certain pixels; a farthest depth of 0 where there are
    none."""
    near, far, widest = _F(np.inf), _F(0.0), _F(0.0)
    for i in range(PIXELS):
        sure = s[SURE + i] > _F(0.0)
        near, far = min(near, s[Z + i] if sure else near), max(far, s[Z + i] if sure else far)
        widest = max(widest, s[SPACING + i] if sure else widest)
    return near, far, widest


@compiled(nogil=True, fastmath={"nnan", "nsz", "reassoc"})  # of bounds only
def _normals(s):
    """The mean unit normal of a tile's certain pixels, and the largest angle from it; its sign means nothing."""
    x, y, z, count = _F(0.0), _F(0.0), _F(0.0), _F(0.0)
    for i in range(PIXELS):
        towards = s[NORMAL_X + i] * s[VIEW_X + i] + s[NORMAL_Y + i] * s[VIEW_Y + i] + s[NORMAL_Z + i] * s[VIEW_Z + i]
        share = (_F(1.0) if towards > _F(0.0) else _F(-1.0)) if s[SURE + i] > _F(0.0) else _F(0.0)
        x, y, z = x + share * s[NORMAL_X + i], y + share * s[NORMAL_Y + i], z + share * s[NORMAL_Z + i]
        count += abs(share)
    size = np.sqrt(x * x + y * y + z * z)
    if not size > _F(0.5) * count:
        return _F(0.0), _F(0.0), _F(1.0), _F(np.pi)
    x, y, z, least = x / size, y / size, z / size, _F(1.0)
    for i in range(PIXELS):
        alike = abs(s[NORMAL_X + i] * x + s[NORMAL_Y + i] * y + s[NORMAL_Z + i] * z)
        least = min(least, alike if s[SURE + i] > _F(0.0) else _F(1.0))
    return x, y, z, np.arccos(least)


@compiled(nogil=True)
def _candidates(num, whole, lens, left, top, near, far, widest, normal, found, bounds):
    """Writes to ``found`` the photographs that may colour a tile, and to ``bounds`` what they weigh at most, the largest first.
    normal: as of _normals.  Returns how many."""
    u, v = np.empty(2, np.float32), np.empty(2, np.float32)
    u[0], u[1] = (_F(left) - lens[2]) / lens[0], (_F(left + TILE) - lens[2]) / lens[0]
    v[0], v[1] = (_F(top) - lens[3]) / lens[1], (_F(top + TILE) - lens[3]) / lens[1]
    mx, my = _F(0.5) * (u[0] + u[1]), _F(0.5) * (v[0] + v[1])
    ray = np.sqrt(mx * mx + my * my + _F(1.0))
    corner = np.sqrt((u[1] - mx) ** 2 + (v[1] - my) ** 2)  # of the tile's middle at depth 1
    middle = _F(0.5) * (near + far)
    radius = _F(0.5) * (far - near) * ray + far * corner
    count = 0
    for photo in range(len(num)):
        t, s = num[photo, TURN : TURN + 9], num[photo, SHIFT : SHIFT + 3]
        if whole[photo, KIND] == PINHOLE and _outside(num[photo], whole[photo], u, v, near, far):
            continue
        dx = mx * middle + t[0] * s[0] + t[3] * s[1] + t[6] * s[2]  # from the photograph's place to the tile's middle
        dy = my * middle + t[1] * s[0] + t[4] * s[1] + t[7] * s[2]
        dz = middle + t[2] * s[0] + t[5] * s[1] + t[8] * s[2]
        far_off = np.sqrt(dx * dx + dy * dy + dz * dz)
        bound, apart = _F(np.inf), _F(0.0)
        if far_off > radius:
            footprint = (far_off - radius) / num[photo, LENS] * lens[0] / far
            if footprint > _F(COARSE[1] * _ROUNDED) * widest:
                continue
            facing = abs(dx * normal[0] + dy * normal[1] + dz * normal[2]) / far_off
            tilt = np.arccos(min(facing, _F(1.0))) - normal[3] - np.arcsin(radius / far_off) - _F(_SLACK)
            facing = np.cos(max(tilt, _F(0.0)))
            steep = min((facing - _F(GRAZING[0])) * _F(1.0 / (GRAZING[1] - GRAZING[0])), _F(1.0))
            if steep <= _F(0.0):
                continue
            alike = (dx * mx + dy * my + dz) / (far_off * ray)
            angle = np.arccos(min(max(alike, _F(-1.0)), _F(1.0))) - np.arcsin(radius / far_off) - corner
            apart = _F(1.0) - np.cos(max(angle, _F(0.0)))
            bound = _F(_ROUNDED) * facing * steep / ((_F(LEAST_ANGLE) + apart) * footprint)
        place = count
        while place > 0 and bounds[place - 1] < bound:
            bounds[place], found[place] = bounds[place - 1], found[place - 1]
            place -= 1
        bounds[place], found[place] = bound, photo
        count += 1
    return count


@compiled(nogil=True)
def _outside(num, whole, u, v, near, far):
    """Whether a block of the view frustum lies on the outer side of one of five planes of a photograph's frustum."""
    fx, fy, cx, cy = num[LENS], num[LENS + 1], num[LENS + 2], num[LENS + 3]
    outside = 31
    for corner in range(8):
        z = near if corner & 1 else far
        a, b = u[(corner >> 1) & 1] * z, v[corner >> 2] * z
        x = num[TURN] * a + num[TURN + 1] * b + num[TURN + 2] * z + num[SHIFT]
        y = num[TURN + 3] * a + num[TURN + 4] * b + num[TURN + 5] * z + num[SHIFT + 1]
        d = -(num[TURN + 6] * a + num[TURN + 7] * b + num[TURN + 8] * z + num[SHIFT + 2])
        out = (1 if d <= 0 else 0) + (2 if cx * d + fx * x < 0 else 0) + (8 if cy * d - fy * y < 0 else 0)
        out += 4 if (whole[WIDTH] - cx) * d - fx * x < 0 else 0
        out += 16 if (whole[HEIGHT] - cy) * d + fy * y < 0 else 0
        outside &= out
    return outside != 0


@compiled(nogil=True)
def photograph_rows(filled, depth, grid, lens, numbers, places, pool, colours, first, last):
    """Writes to colours (H, W) uint32, zeros, RGBA8, what the photographs show, their share as alpha, in tile rows ``first`` to
    ``last``.

    filled: (H, W) uint32, RGBA8.  grid: of count_measured.  lens: (4,) float32.  pool: its words, uint32.
    """
    height, width = depth.shape
    ranges, texels, most = pool.view(np.float32), pool.view(np.int32), len(numbers)
    found, taken, bounds = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most, np.float32)
    s, slots = np.zeros(PLANES * PLANE, np.float32), np.zeros((max(most, MOST) + 1, SLOT_PLANES * PLANE), np.float32)
    best, words = np.zeros((MOST, SLOT_PLANES * PLANE), np.float32), np.zeros((len(slots), WORD_PLANES * PLANE), np.int32)
    around, four = np.zeros(3 * SURROUNDINGS, np.float32), np.zeros(TEXEL_PLANES * PLANE, np.int32)
    sampled = np.empty(most, np.int64)
    for top in range(first * TILE, min(last * TILE, height), TILE):
        for left in range(0, width, TILE):
            if not surface(depth, grid, lens, top, left, around, s):
                continue
            near, far, widest = _extent(s)
            if not far > _F(0.0):
                continue
            orient(s)
            normal = _normals(s)
            count = _candidates(numbers, places, lens, left, top, near, far, widest, normal, found, bounds)
            if count == 0:
                continue
            used = 0  # slots of photographs that may colour a pixel
            for k in range(count):
                if used >= MOST and not could_improve(s, bounds[k]):
                    break
                photo, kept = found[k], slots[used]
                project(s, numbers[photo], places[photo], kept, words[used])
                if weigh(s, numbers[photo], places[photo], lens[0], kept, words[used], ranges) == 0:
                    continue
                rank(s, kept, used)
                taken[used] = photo
                used += 1
            if used == 0:
                continue
            count = 0
            for slot in range(used):
                if used <= MOST or among_best(s, slot):
                    locate(places[taken[slot]], slots[slot], words[slot], texels)
                    sampled[count] = slot
                    count += 1
            _unpack(filled, top, left, s)
            for k in range(count):  # by now their texels are in the cache
                slot = sampled[k]
                sample(numbers[taken[slot]], slots[slot], words[slot], four, texels)
            if used > MOST:
                ranked(s, slots, best)
                vote(s, best[0], best[1], best[2])
            else:
                for k in range(used, MOST):
                    slots[k, WEIGHT : WEIGHT + PIXELS] = _F(0.0)
                vote(s, slots[0], slots[1], slots[2])
            _write(s, top, left, colours)


@compiled(nogil=True)
def _unpack(filled, top, left, s):
    """The filled picture's colours in RED, GREEN, BLUE of a tile."""
    height, width = filled.shape
    byte = np.int32(255)
    for j in range(min(TILE, height - top)):
        at = TILE * j
        if left + TILE <= width:  # a number of pixels that the compiler knows
            part = filled[top + j, left : left + TILE]
            for i in range(TILE):
                word = np.int32(part[i])
                s[RED + at + i], s[GREEN + at + i] = _F(word & byte), _F(word >> np.int32(8) & byte)
                s[BLUE + at + i] = _F(word >> np.int32(16) & byte)
        else:
            for i in range(width - left):
                word = np.int32(filled[top + j, left + i])
                s[RED + at + i], s[GREEN + at + i] = _F(word & byte), _F(word >> np.int32(8) & byte)
                s[BLUE + at + i] = _F(word >> np.int32(16) & byte)


@compiled(nogil=True)
def _write(s, top, left, colours):
    height, width, half = *colours.shape, _F(0.5)
    for j in range(min(TILE, height - top)):
        line, at = colours[top + j], TILE * j
        for i in range(min(TILE, width - left)):
            red, green = np.int32(s[MEAN_RED + at + i] + half), np.int32(s[MEAN_GREEN + at + i] + half)
            colour, part = red | green << 8 | np.int32(s[MEAN_BLUE + at + i] + half) << 16, s[SHARE + at + i] * _F(255.0)
            line[left + i] = np.uint32(colour) | np.uint32(part + half) << np.uint32(24)
