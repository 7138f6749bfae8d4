"""Averaging in sparse places in compiled loops: the same operations as shaders/averaging.comp in software OpenGL, in the same
order and in float32.

Rows ``first`` to ``last`` are written, so that threads can share a picture.
"""

from typing import NamedTuple

import numpy as np

from ....model.common.jit import compiled
from ....model.network.network_layout import DEPTH_FEATURE_SCALE
from ....model.reference.fill_constants import DENSITY_BLOCK, NEAR_DOUBLINGS, NEAR_SPREAD
from .fill_loops import feature_row

_F = np.float32
_NEAR_SCALE = 1.0 / (NEAR_DOUBLINGS * DEPTH_FEATURE_SCALE)


class Sparse(NamedTuple):
    """The uniforms of averaging.comp, float32, with its ramp in two."""

    feature_scale: np.float32
    dense: np.float32
    slope: np.float32
    per_level: np.float32


@compiled(nogil=True)
def block_rows(weights, depths, sparse, width, height, made, first, last):
    """Rows of blocks: made (rows, columns, 3), the share of measured pixels, and the sums of their depth features and of the
    squares of these over the number of pixels.  weights, depths: (P,) float32."""
    features, more = np.empty(width, _F), np.empty(width, _F)
    for row in range(first, last):
        begin, end = row * DENSITY_BLOCK, min((row + 1) * DENSITY_BLOCK, height)
        made[row] = _F(0.0)
        for y in range(begin, end):
            feature_row(depths[y * width : (y + 1) * width], sparse.feature_scale, features, more)
            for x in range(width):
                if weights[y * width + x] > _F(0.0):
                    block, feature = made[row, x // DENSITY_BLOCK], features[x]
                    block[0] += _F(1.0)
                    block[1] += feature
                    block[2] += feature * feature
        for column in range(made.shape[1]):
            pixels = (end - begin) * (min((column + 1) * DENSITY_BLOCK, width) - column * DENSITY_BLOCK)
            for k in range(3):
                made[row, column, k] /= _F(pixels)


@compiled(nogil=True, inline="always")
def _mix(a, b, share):
    return a + share * (b - a)


@compiled(nogil=True, inline="always")
def _around(upper, lower, k, left, right, across, down):
    """Value ``k`` of four blocks, interpolated."""
    return _mix(_mix(upper[left, k], upper[right, k], across), _mix(lower[left, k], lower[right, k], across), down)


@compiled(nogil=True, inline="always")
def _place(at, count):
    """The two blocks whose centres are around a pixel's centre, and the share of the second."""
    place = max((_F(at) + _F(0.5)) / _F(DENSITY_BLOCK) - _F(0.5), _F(0.0))
    one = min(np.int64(place), count - 1)
    return one, min(one + 1, count - 1), place - np.floor(place)


@compiled(nogil=True)
def weigh_rows(weights, depths, levels, blocks, sparse, width, made, first, last):
    """Weights of the pixels in the fill: made (P,) float32.  levels: (P,) float32, noise level with detail 1.  blocks: of
    ``block_rows``."""
    features, more = np.empty(width, _F), np.empty(width, _F)
    upper, lower = np.empty((blocks.shape[1], 3), _F), np.empty((blocks.shape[1], 3), _F)
    for y in range(first, last):
        above, below, down = _place(y, blocks.shape[0])
        upper[:], lower[:] = blocks[above], blocks[below]
        feature_row(depths[y * width : (y + 1) * width], sparse.feature_scale, features, more)
        for x in range(width):
            weight = weights[y * width + x]
            if weight > _F(0.0):
                left, right, across = _place(x, blocks.shape[1])
                share = _around(upper, lower, 0, left, right, across, down)
                total = _around(upper, lower, 1, left, right, across, down)
                squares = _around(upper, lower, 2, left, right, across, down)
                density = max(share, _F(1e-6))
                mean = total / density
                spread = np.sqrt(max(squares / density - mean * mean, _F(0.0)))
                near = min(max((mean - features[x] - _F(NEAR_SPREAD) * spread) * _F(_NEAR_SCALE), _F(0.0)), _F(1.0))
                few = min(max((_F(1.0) / density - sparse.dense) * sparse.slope, _F(0.0)), _F(1.0))
                noise = levels[y * width + x]
                weight /= _F(1.0) + few * (_F(1.0) - near) * sparse.per_level * noise * noise
            made[y * width + x] = weight
