"""Compiled loops over the pixels of one tile, in the order in which a tile is coloured; see photo_loops.

The pixels' values are planes of one array, so that each loop is compiled to vector instructions: they need no branch, and a
distance between what is read and what is written that the compiler knows.  View frame: x right, y down, z forward.
"""

import numpy as np

from ....model.common.jit import compiled
from ....model.reference.photo_colours import (
    AGREES,
    AT_BORDER,
    BORDER,
    COARSE,
    GRAZING,
    HIDDEN,
    LEAST_ANGLE,
    MOST,
    PINHOLE,
    POINTS_VOTE,
    SPHERICAL,
)
from .photo_pool import (
    AROUND,
    HEIGHT,
    KIND,
    LENS,
    MAP,
    MAP_HEIGHT,
    MAP_WIDTH,
    PRESENCE,
    SHIFT,
    TURN,
    WIDTH,
)

TILE = 16
"""Pixels along a side of a tile; a multiple of BLOCK."""
PIXELS = TILE * TILE
PLANE = PIXELS + 16
"""Values from one plane to the next; with a power of two they would share lines of the cache."""
(X, Y, Z, INVERSE, VIEW_X, VIEW_Y, VIEW_Z, NORMAL_X, NORMAL_Y, NORMAL_Z, SURE, SPACING, ALONG_X, AHEAD_X, ALONG_Y, AHEAD_Y,
 NEAREST, BEST, _, _, WHO, _, _, RED, GREEN, BLUE, SHARE, MEAN_RED, MEAN_GREEN, MEAN_BLUE) = (PLANE * k for k in range(30))
"""Planes of a tile: place, 1 / z, unit view ray, unit normal, certainty, pixels between measured pixels; differences across and
down the pixel; the shadow map's distance; weight and slot of the best photographs; the filled picture's colour;
the photographs' share and their own colour."""
PLANES = 30
COLUMN, ROW, FOOTPRINT, CONFIDENCE, WEIGHT, SEEN_RED, SEEN_GREEN, SEEN_BLUE, RIGHT, BELOW = (PLANE * k for k in range(10))
"""Planes of a slot: of one photograph in a tile.  COLUMN: -1 where it does not show the pixel.  SEEN_RED: -1 where a texel
holds nothing.  RIGHT, BELOW: shares of the texels to the right and below."""
SLOT_PLANES = 10
TEXEL, ASIDE, UNDER = (PLANE * k for k in range(3))
"""Whole numbers of a slot: the word of the texel (of the shadow map, then of the photograph), words to those beside and below
it."""
WORD_PLANES = 3
_F = np.float32
_ANYWHERE = 1e9  # pixels from a side that a photograph does not have


@compiled(nogil=True)
def orient(s):
    """Place, view ray and normal from x / z in X, y / z in Y, z, and the differences around."""
    for i in range(PIXELS):
        u, v, z = s[X + i], s[Y + i], s[Z + i]
        length = _F(1.0) / np.sqrt(u * u + v * v + _F(1.0))
        s[VIEW_X + i], s[VIEW_Y + i], s[VIEW_Z + i] = u * length, v * length, length
        ax, az, by, bz = s[ALONG_X + i], s[AHEAD_X + i], s[ALONG_Y + i], s[AHEAD_Y + i]
        nx, ny, nz = az * (v * bz - by), bz * (u * az - ax), ax * by - v * az * (u * bz)
        size = np.sqrt(nx * nx + ny * ny + nz * nz)
        size = _F(1.0) / size if size > _F(0.0) else _F(0.0)
        s[NORMAL_X + i], s[NORMAL_Y + i], s[NORMAL_Z + i] = nx * size, ny * size, nz * size
        s[X + i], s[Y + i], s[INVERSE + i] = u * z, v * z, _F(1.0) / z
        for k in range(MOST):
            s[BEST + k * PLANE + i], s[WHO + k * PLANE + i] = _F(0.0), _F(0.0)


@compiled(nogil=True, inline="always")
def _angle(y, x):
    """Angle of (x, y), radians, as arctan2: the polynomial 4.4.49 of Abramowitz and Stegun, wrong by 2e-8 at most."""
    a, b = abs(x), abs(y)
    less, more = (b, a) if b < a else (a, b)
    t = less / more
    q = t * t
    p = _F(-0.0161657367) + q * _F(0.0028662257)
    p = _F(-0.0752896400) + q * (_F(0.0429096138) + q * p)
    p = _F(-0.1420889944) + q * (_F(0.1065626393) + q * p)
    p = _F(1.0) + q * (_F(-0.3333314528) + q * (_F(0.1999355085) + q * p))
    p *= t
    p = _F(0.5 * np.pi) - p if b >= a else p
    p = _F(np.pi) - p if x < _F(0.0) else p
    return -p if y < _F(0.0) else p


@compiled(nogil=True)
def project(s, num, whole, kept, words):
    """Column and row in a photograph, in ``kept``, and the word of its shadow map, in ``words``."""
    t0, t1, t2, t3, t4 = num[TURN], num[TURN + 1], num[TURN + 2], num[TURN + 3], num[TURN + 4]
    t5, t6, t7, t8 = num[TURN + 5], num[TURN + 6], num[TURN + 7], num[TURN + 8]
    sx, sy, sz = num[SHIFT], num[SHIFT + 1], num[SHIFT + 2]
    fx, fy, cx, cy = num[LENS], num[LENS + 1], num[LENS + 2], num[LENS + 3]
    wide, high, map_wide, last, first = _F(whole[WIDTH]), _F(whole[HEIGHT]), whole[MAP_WIDTH], whole[MAP_HEIGHT] - 1, whole[MAP]
    across, along = _F(map_wide) / wide, _F(whole[MAP_HEIGHT]) / high
    if whole[KIND] == PINHOLE:
        for i in range(PIXELS):
            px, py, pz = s[X + i], s[Y + i], s[Z + i]
            qx, qy = t0 * px + t1 * py + t2 * pz + sx, t3 * px + t4 * py + t5 * pz + sy
            qz = t6 * px + t7 * py + t8 * pz + sz
            column, row = cx - qx / qz * fx, cy + qy / qz * fy
            shown = (qz < _F(0.0)) & (column >= _F(0.0)) & (column < wide) & (row >= _F(0.0)) & (row < high)
            kept[COLUMN + i], kept[ROW + i] = column if shown else _F(-1.0), row if shown else _F(-1.0)
    else:
        spherical, turn = whole[KIND] == SPHERICAL, wide if whole[AROUND] else _F(0.0)
        for i in range(PIXELS):
            px, py, pz = s[X + i], s[Y + i], s[Z + i]
            qx, qy = t0 * px + t1 * py + t2 * pz + sx, t3 * px + t4 * py + t5 * pz + sy
            qz = t6 * px + t7 * py + t8 * pz + sz
            flat = np.sqrt(qx * qx + qy * qy)
            rise = _angle(qz, flat) if spherical else qz / flat
            column, row = cx - _angle(qy, qx) * fx, cy - rise * fy
            column -= np.floor(column / wide) * turn
            shown = (flat > _F(0.0)) & (column >= _F(0.0)) & (column < wide) & (row >= _F(0.0)) & (row < high)
            kept[COLUMN + i], kept[ROW + i] = column if shown else _F(-1.0), row if shown else _F(-1.0)
    most = map_wide - np.int32(1)
    for i in range(PIXELS):
        column, row = np.int32(kept[COLUMN + i] * across), np.int32(kept[ROW + i] * along)
        words[TEXEL + i] = first + min(max(row, np.int32(0)), last) * map_wide + min(max(column, np.int32(0)), most)


@compiled(nogil=True)
def weigh(s, num, whole, focal, kept, words, ranges):
    """Footprint, confidence and weight of a photograph at each pixel, in ``kept``.  focal: fx of the picture.  Returns how many
    pixels it may colour."""
    for i in range(PIXELS):
        s[NEAREST + i] = ranges[words[TEXEL + i]]
    t0, t1, t2, t3, t4 = num[TURN], num[TURN + 1], num[TURN + 2], num[TURN + 3], num[TURN + 4]
    t5, t6, t7, t8 = num[TURN + 5], num[TURN + 6], num[TURN + 7], num[TURN + 8]
    sx, sy, sz = num[SHIFT], num[SHIFT + 1], num[SHIFT + 2]
    ex, ey, ez = -(t0 * sx + t3 * sy + t6 * sz), -(t1 * sx + t4 * sy + t7 * sz), -(t2 * sx + t5 * sy + t8 * sz)
    scale, wide, high, presence = focal / num[LENS], _F(whole[WIDTH]), _F(whole[HEIGHT]), num[PRESENCE]
    aside, near_border = _F(_ANYWHERE if whole[AROUND] else 0.0), _F(1.0) / (_F(BORDER) * wide)
    for i in range(PIXELS):
        column, row = kept[COLUMN + i], kept[ROW + i]
        dx, dy, dz = s[X + i] - ex, s[Y + i] - ey, s[Z + i] - ez
        far = np.sqrt(dx * dx + dy * dy + dz * dz)
        inverse = _F(1.0) / far
        visible = min(max(_F(2.0) - (far / s[NEAREST + i] - _F(1.0)) * _F(1.0 / HIDDEN), _F(0.0)), _F(1.0))
        footprint = far * scale * s[INVERSE + i]
        fine = (_F(COARSE[1]) - footprint / s[SPACING + i]) * _F(1.0 / (COARSE[1] - COARSE[0]))
        fine = min(max(fine, _F(0.0)), _F(1.0))
        facing = abs(dx * s[NORMAL_X + i] + dy * s[NORMAL_Y + i] + dz * s[NORMAL_Z + i]) * inverse
        steep = min(max((facing - _F(GRAZING[0])) * _F(1.0 / (GRAZING[1] - GRAZING[0])), _F(0.0)), _F(1.0))
        confidence = s[SURE + i] * visible * fine * steep * presence
        alike = min((dx * s[VIEW_X + i] + dy * s[VIEW_Y + i] + dz * s[VIEW_Z + i]) * inverse, _F(1.0))
        border = min(min(row, high - row), min(column, wide - column) + aside)
        inner = _F(AT_BORDER) + _F(1.0 - AT_BORDER) * min(border * near_border, _F(1.0))
        weight = confidence * facing * inner / ((_F(LEAST_ANGLE + 1.0) - alike) * footprint)
        kept[FOOTPRINT + i], kept[CONFIDENCE + i] = footprint, confidence
        kept[WEIGHT + i] = weight if (column >= _F(0.0)) & (weight > _F(0.0)) else _F(0.0)
    count = 0
    for i in range(PIXELS):
        count += 1 if kept[WEIGHT + i] > _F(0.0) else 0
    return count


@compiled(nogil=True)
def rank(s, kept, slot):
    """Takes a slot among the best ones of each pixel."""
    slot = _F(slot)
    for i in range(PIXELS):
        weight, one, two, three = kept[WEIGHT + i], s[BEST + i], s[BEST + PLANE + i], s[BEST + 2 * PLANE + i]
        first, second, third = weight > one, weight > two, weight > three
        who, other, last = s[WHO + i], s[WHO + PLANE + i], s[WHO + 2 * PLANE + i]
        s[BEST + 2 * PLANE + i] = two if second else (weight if third else three)
        s[BEST + PLANE + i] = one if first else (weight if second else two)
        s[BEST + i] = weight if first else one
        s[WHO + 2 * PLANE + i] = other if second else (slot if third else last)
        s[WHO + PLANE + i] = who if first else (slot if second else other)
        s[WHO + i] = slot if first else who


@compiled(nogil=True)
def could_improve(s, bound):
    """Whether a photograph of at most this weight, at full certainty, could be among the best of a pixel."""
    count = 0
    for i in range(PIXELS):
        count += 1 if s[BEST + (MOST - 1) * PLANE + i] < bound * s[SURE + i] else 0
    return count > 0


@compiled(nogil=True)
def among_best(s, slot):
    """Whether a slot is among the best ones of a pixel."""
    slot, count = _F(slot), 0
    for k in range(MOST):
        for i in range(PIXELS):
            count += 1 if (s[WHO + k * PLANE + i] == slot) & (s[BEST + k * PLANE + i] > _F(0.0)) else 0
    return count > 0


@compiled(nogil=True)
def ranked(s, slots, top):
    """Copies what vote takes of the best slots of each pixel to top (MOST, SLOT_PLANES * PLANE)."""
    flat = slots.reshape(-1)
    for k in range(MOST):
        slot = top[k]
        for i in range(PIXELS):
            kept = np.uint32(np.int32(s[WHO + k * PLANE + i])) * np.uint32(SLOT_PLANES * PLANE) + np.uint32(i)
            red = flat[kept + np.uint32(SEEN_RED)]
            slot[WEIGHT + i] = s[BEST + k * PLANE + i] if red >= _F(0.0) else _F(0.0)
            slot[CONFIDENCE + i], slot[SEEN_RED + i] = flat[kept + np.uint32(CONFIDENCE)], red
            slot[SEEN_GREEN + i], slot[SEEN_BLUE + i] = flat[kept + np.uint32(SEEN_GREEN)], flat[kept + np.uint32(SEEN_BLUE)]


@compiled(nogil=True)
def vote(s, one, two, three):
    """The mean of three photographs' colours, those that disagree outvoted, in MEAN_RED, MEAN_GREEN and MEAN_BLUE, and the
    largest confidence of them in SHARE.  one, two, three: slots, in any order."""
    for i in range(PIXELS):
        w0, w1, w2 = one[WEIGHT + i], two[WEIGHT + i], three[WEIGHT + i]
        r0, r1, r2, r3 = one[SEEN_RED + i], two[SEEN_RED + i], three[SEEN_RED + i], s[RED + i]
        g0, g1, g2, g3 = one[SEEN_GREEN + i], two[SEEN_GREEN + i], three[SEEN_GREEN + i], s[GREEN + i]
        b0, b1, b2, b3 = one[SEEN_BLUE + i], two[SEEN_BLUE + i], three[SEEN_BLUE + i], s[BLUE + i]
        share = one[CONFIDENCE + i] if w0 > _F(0.0) else _F(0.0)
        share = max(share, two[CONFIDENCE + i] if w1 > _F(0.0) else _F(0.0))
        share = max(share, three[CONFIDENCE + i] if w2 > _F(0.0) else _F(0.0))
        w3 = _F(POINTS_VOTE) * max(max(w0, w1), w2)
        a01, a02 = abs(r0 - r1) + abs(g0 - g1) + abs(b0 - b1), abs(r0 - r2) + abs(g0 - g2) + abs(b0 - b2)
        a03, a12 = abs(r0 - r3) + abs(g0 - g3) + abs(b0 - b3), abs(r1 - r2) + abs(g1 - g2) + abs(b1 - b2)
        a13, a23 = abs(r1 - r3) + abs(g1 - g3) + abs(b1 - b3), abs(r2 - r3) + abs(g2 - g3) + abs(b2 - b3)
        least, r, g, b = w0 * a03 + w1 * a13 + w2 * a23, r3, g3, b3  # the points' colour; in a tie a photograph's
        cost = w0 * a02 + w1 * a12 + w3 * a23
        nearer = (w2 > _F(0.0)) & (cost <= least)
        least, r, g, b = cost if nearer else least, r2 if nearer else r, g2 if nearer else g, b2 if nearer else b
        cost = w0 * a01 + w2 * a12 + w3 * a13
        nearer = (w1 > _F(0.0)) & (cost <= least)
        least, r, g, b = cost if nearer else least, r1 if nearer else r, g1 if nearer else g, b1 if nearer else b
        cost = w1 * a01 + w2 * a02 + w3 * a03
        nearer = (w0 > _F(0.0)) & (cost <= least)
        r, g, b = r0 if nearer else r, g0 if nearer else g, b0 if nearer else b
        d0 = max(max(abs(r0 - r), abs(g0 - g)), abs(b0 - b)) * _F(1.0 / AGREES)
        d1 = max(max(abs(r1 - r), abs(g1 - g)), abs(b1 - b)) * _F(1.0 / AGREES)
        d2 = max(max(abs(r2 - r), abs(g2 - g)), abs(b2 - b)) * _F(1.0 / AGREES)
        d0, d1, d2 = d0 * d0 + _F(1.0), d1 * d1 + _F(1.0), d2 * d2 + _F(1.0)
        w0, w1, w2 = w0 / (d0 * d0), w1 / (d1 * d1), w2 / (d2 * d2)
        total = w0 + w1 + w2
        total = _F(1.0) / total if total > _F(0.0) else _F(0.0)
        r, g = min((w0 * r0 + w1 * r1 + w2 * r2) * total, _F(255.0)), min((w0 * g0 + w1 * g1 + w2 * g2) * total, _F(255.0))
        b = min((w0 * b0 + w1 * b1 + w2 * b2) * total, _F(255.0))
        s[MEAN_RED + i], s[MEAN_GREEN + i], s[MEAN_BLUE + i] = r, g, b
        s[SHARE + i] = share
