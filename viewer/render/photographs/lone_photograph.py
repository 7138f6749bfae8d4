"""One photograph over a whole view, as it is shown at the place where it was taken: the same pixels, pose, exposure and shadow
map that colour pictures (photo_loops), but wherever the photograph shows anything, however fine the points are.

A pixel where nothing was measured is taken as far away.
"""

from typing import TYPE_CHECKING

import numpy as np

from ....model.common.jit import compiled
from ....model.common.process.processors import in_rows
from .photo_pool import SHIFT, TURN
from .photo_texel_loops import TEXEL_PLANES, locate, sample
from .photo_tile_loops import (
    COLUMN,
    CONFIDENCE,
    INVERSE,
    NORMAL_X,
    NORMAL_Y,
    NORMAL_Z,
    PIXELS,
    PLANE,
    PLANES,
    SEEN_BLUE,
    SEEN_GREEN,
    SEEN_RED,
    SHARE,
    SLOT_PLANES,
    SPACING,
    SURE,
    TILE,
    VIEW_X,
    VIEW_Y,
    VIEW_Z,
    WORD_PLANES,
    X,
    Y,
    Z,
    project,
    weigh,
)

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from .photo_pool import PhotoPool

FAR_AWAY = 1e7
"""File units at which a pixel without a surface is taken to lie: from two metres beside the photograph's place, in a file in
millimetres, it is 0.01 degrees off."""
_F = np.float32


def photograph_alone(depth: np.ndarray, camera: "Camera", pool: "PhotoPool", number: int, *, hides: bool) -> np.ndarray:
    """The photograph as a camera sees it, (H, W, 4) uint8: its colours, and as alpha how far it shows each pixel.

    depth: (H, W) float32, view-space z, +inf where nothing was measured.  camera: of that size.  number: of a photograph in the
    pool.  hides: whether its shadow map is asked, which its own place does not need.
    """
    height, width = depth.shape
    shown = np.zeros((height, width), np.uint32)
    numbers, places = pool.records([number], camera)
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    in_rows(-(-height // TILE), 1, lone_rows, np.ascontiguousarray(depth, np.float32), lens, numbers[0], places[0], pool.words,
            hides, shown)  # fmt: skip
    return shown.view(np.uint8).reshape(height, width, 4)


@compiled(nogil=True)
def lone_rows(depth, lens, num, whole, pool, hides, shown, first, last):
    """Writes to shown (H, W) uint32, RGBA8, in tile rows ``first`` to ``last``.  num, whole: a record of the pool."""
    height, width = depth.shape
    ranges, texels = pool.view(np.float32), pool.view(np.int32)
    s, kept = np.zeros(PLANES * PLANE, np.float32), np.zeros(SLOT_PLANES * PLANE, np.float32)
    words, four = np.zeros(WORD_PLANES * PLANE, np.int32), np.zeros(TEXEL_PLANES * PLANE, np.int32)
    for top in range(first * TILE, min(last * TILE, height), TILE):
        for left in range(0, width, TILE):
            _surface(depth, lens, num, top, left, s)
            project(s, num, whole, kept, words)
            weigh(s, num, whole, lens[0], kept, words, ranges)
            locate(whole, kept, words, texels)
            sample(num, kept, words, four, texels)
            for j in range(min(TILE, height - top)):
                for i in range(min(TILE, width - left)):
                    k = TILE * j + i
                    if kept[COLUMN + k] < _F(0.0) or kept[SEEN_RED + k] < _F(0.0):
                        continue
                    part = kept[CONFIDENCE + k] if hides and s[SHARE + k] > _F(0.0) else _F(1.0)
                    colour = _byte(kept[SEEN_RED + k]) | _byte(kept[SEEN_GREEN + k]) << 8 | _byte(kept[SEEN_BLUE + k]) << 16
                    shown[top + j, left + i] = np.uint32(colour) | np.uint32(_byte(part * _F(255.0))) << np.uint32(24)


@compiled(nogil=True)
def _surface(depth, lens, num, top, left, s):
    """Planes of a tile: place, and a certain, dense surface that faces the photograph.  SHARE: 1 where there is a surface."""
    height, width = depth.shape
    ex = num[TURN] * num[SHIFT] + num[TURN + 3] * num[SHIFT + 1] + num[TURN + 6] * num[SHIFT + 2]
    ey = num[TURN + 1] * num[SHIFT] + num[TURN + 4] * num[SHIFT + 1] + num[TURN + 7] * num[SHIFT + 2]
    ez = num[TURN + 2] * num[SHIFT] + num[TURN + 5] * num[SHIFT + 1] + num[TURN + 8] * num[SHIFT + 2]
    for i in range(PIXELS):
        x, y = left + i % TILE, top + i // TILE
        z = depth[min(y, height - 1), min(x, width - 1)]
        s[SHARE + i] = _F(1.0) if z < _F(np.inf) else _F(0.0)
        z = min(z, _F(FAR_AWAY))
        s[X + i], s[Y + i] = (_F(x) + _F(0.5) - lens[2]) / lens[0] * z, (_F(y) + _F(0.5) - lens[3]) / lens[1] * z
        s[Z + i], s[INVERSE + i], s[SURE + i], s[SPACING + i] = z, _F(1.0) / z, _F(1.0), _F(np.inf)
        dx, dy, dz = s[X + i] + ex, s[Y + i] + ey, z + ez
        inverse = _F(1.0) / max(np.sqrt(dx * dx + dy * dy + dz * dz), _F(1e-30))
        s[NORMAL_X + i], s[NORMAL_Y + i], s[NORMAL_Z + i] = dx * inverse, dy * inverse, dz * inverse
        s[VIEW_X + i], s[VIEW_Y + i], s[VIEW_Z + i] = s[NORMAL_X + i], s[NORMAL_Y + i], s[NORMAL_Z + i]


@compiled(nogil=True, inline="always")
def _byte(value):
    return np.int32(min(max(value, _F(0.0)), _F(255.0)) + _F(0.5))
