"""Compiled loops that look up a photograph's colours for the pixels of one tile (photo_tile_loops).

Texels lie anywhere in memory, and waiting for them costs more than blending them: they are located and begin to load first, and
are blended when other work of the tile is done.
"""

import numpy as np

from ....model.common.intrinsics import prefetch
from ....model.common.jit import compiled
from .photo_pool import AROUND, GAINS, HEIGHT, LEVEL, LEVELS, WIDTH
from .photo_tile_loops import (
    ASIDE,
    BELOW,
    COLUMN,
    FOOTPRINT,
    PIXELS,
    PLANE,
    RIGHT,
    ROW,
    SEEN_BLUE,
    SEEN_GREEN,
    SEEN_RED,
    TEXEL,
    TILE,
    UNDER,
    WEIGHT,
)

FIRST, SECOND, THIRD, FOURTH = (PLANE * k for k in range(4))
"""The four texels around each pixel of the slot that is sampled."""
TEXEL_PLANES = 4
_F = np.float32
_WHOLE = -0x1000000  # alpha 255 in the highest byte


@compiled(nogil=True)
def locate(whole, kept, words, pool):
    """The texels of a photograph around each pixel in the mip level of its footprint, in ``words``, and RIGHT and BELOW in
    ``kept``; begins to load them.  pool: (n,) int32, the pixels of all photographs."""
    for i in range(PIXELS):
        words[ASIDE + i] = words[UNDER + i] = np.int32(0)
    width, height, around = whole[WIDTH], whole[HEIGHT], whole[AROUND] != 0
    across, down, nearer = _F(1.0) / _F(width), _F(1.0) / _F(height), _F(np.inf)
    for level in range(whole[LEVELS]):
        finer, farther = 0, _F(0.5 ** (level + 0.5)) if level < whole[LEVELS] - 1 else _F(-np.inf)
        for i in range(PIXELS):
            finer += 1 if kept[FOOTPRINT + i] <= farther else 0
        if finer < PIXELS:
            _texels(kept, words, nearer, farther, width, height, _F(width) * across, _F(height) * down, whole[LEVEL + level],
                    around)
        if finer == 0:
            break
        width, height, nearer = np.int32((width + 1) // 2), np.int32((height + 1) // 2), farther
    for row in range(0, PIXELS, TILE):
        for i in (0, TILE // 2, TILE - 1):  # a line of the cache holds 16 texels
            prefetch(pool, words[TEXEL + row + i])


@compiled(nogil=True)
def sample(num, kept, words, texels, pool):
    """Colours of a photograph, bilinear, times its gains.  words: of locate.  texels: working memory."""
    for i in range(PIXELS):
        upper, aside = words[TEXEL + i], words[ASIDE + i]
        lower = upper + words[UNDER + i]
        texels[FIRST + i], texels[SECOND + i] = pool[upper], pool[upper + aside]
        texels[THIRD + i], texels[FOURTH + i] = pool[lower], pool[lower + aside]
    red, green, blue, byte = num[GAINS], num[GAINS + 1], num[GAINS + 2], np.int32(255)
    for i in range(PIXELS):
        one, two, three, four = texels[FIRST + i], texels[SECOND + i], texels[THIRD + i], texels[FOURTH + i]
        right, below = kept[RIGHT + i], kept[BELOW + i]
        left, above = _F(1.0) - right, _F(1.0) - below
        w1, w2, w3, w4 = left * above, right * above, left * below, right * below
        held = (one & two & three & four & _WHOLE) == _WHOLE
        kept[SEEN_RED + i] = (_F(np.int32(one & byte)) * w1 + _F(np.int32(two & byte)) * w2 + _F(np.int32(three & byte)) * w3
                              + _F(np.int32(four & byte)) * w4) * red if held else _F(-1.0)
        one, two, three, four = one >> 8, two >> 8, three >> 8, four >> 8
        kept[SEEN_GREEN + i] = (_F(np.int32(one & byte)) * w1 + _F(np.int32(two & byte)) * w2 + _F(np.int32(three & byte)) * w3
                                + _F(np.int32(four & byte)) * w4) * green
        one, two, three, four = one >> 8, two >> 8, three >> 8, four >> 8
        kept[SEEN_BLUE + i] = (_F(np.int32(one & byte)) * w1 + _F(np.int32(two & byte)) * w2 + _F(np.int32(three & byte)) * w3
                               + _F(np.int32(four & byte)) * w4) * blue
        kept[WEIGHT + i] = kept[WEIGHT + i] if held else _F(0.0)


@compiled(nogil=True)
def _texels(kept, words, nearer, farther, width, height, across, down, first, around):
    """The words of the texels around each place whose footprint belongs to a mip level.  Numbers of a level's texels are whole
    in float32: at most 4096 x 4096."""
    wide, last, lowest, turn = _F(width), _F(width) - _F(1.0), _F(height) - _F(1.0), _F(width) if around else _F(0.0)
    for i in range(PIXELS):
        footprint, a, b = kept[FOOTPRINT + i], kept[COLUMN + i] * across - _F(0.5), kept[ROW + i] * down - _F(0.5)
        here = (footprint <= nearer) & (footprint > farther)
        left, top = np.floor(a), np.floor(b)
        kept[RIGHT + i] = a - left if here else kept[RIGHT + i]
        kept[BELOW + i] = b - top if here else kept[BELOW + i]
        right, below = left + _F(1.0), min(top + _F(1.0), lowest)
        left, right = left + turn if left < _F(0.0) else left, right - turn if right > last else right
        left, right, top = min(max(left, _F(0.0)), last), min(max(right, _F(0.0)), last), min(max(top, _F(0.0)), lowest)
        words[TEXEL + i] = first + np.int32(top * wide + left) if here else words[TEXEL + i]
        words[ASIDE + i] = np.int32(right - left) if here else words[ASIDE + i]
        words[UNDER + i] = np.int32((max(below, _F(0.0)) - top) * wide) if here else words[UNDER + i]
