"""Compiled loops of the depth filter on the processor (viewer.render.passes.filter_cpu), preset ``auto``: the same operations
as shaders/filter_down.comp, filter_up.comp, filter_keep.comp and common_filter.glsl, in the same order and in float32.

``support`` holds two whole numbers, pixels times CHILDREN plus occupied children (shaders/common_filter.glsl).
A plane of a level is flat, (height + 2) rows of width + 2, with an edge of one pixel around the picture.  Rows ``first`` to
``last`` of the picture are written, so that threads can share a plane.
"""

import numpy as np

from ....model.common.jit import compiled
from ....model.reference.filter_constants import (
    CHILDREN,
    CLUMPED,
    EMPTY,
    SAME_SURFACE,
    STEEPEST,
    SUPPORT,
    SUPPORT_SHARED,
    TWIST,
)

_F, _U = np.float32, np.uint32
_SAME, _LIMIT, _LIMIT_SHARED = _F(1.0 - SAME_SURFACE), _F(36.0 * SUPPORT), _F(36.0 * SUPPORT_SHARED)


@compiled(nogil=True, inline="always")
def _on(limit, near, support):
    return support if near >= limit else _F(0.0)


@compiled(nogil=True, inline="always")
def _part(limit, near, support):
    """A child's part of a block's support: its pixels, and itself."""
    pixels = np.floor(support * _F(1.0 / CHILDREN)) * _F(CHILDREN) + _F(1.0)
    return pixels if (near >= limit) & (support > _F(0.0)) else _F(0.0)


@compiled(nogil=True)
def base_rows(depth, near, support, width, first, last):
    """Inverse depth, 0 where empty, and the support of one pixel where there is a point.  depth: (H * W,) view-space z, +inf
    where empty."""
    for y in range(first, last):
        start = (y + 1) * (width + 2) + 1
        line, made, points = depth[y * width : (y + 1) * width], near[start : start + width], support[start : start + width]
        for x in range(width):
            made[x] = inverse = _F(1.0) / line[x]
            points[x] = _F(CHILDREN) if inverse > _F(0.0) else _F(0.0)


@compiled(nogil=True)
def coarser_rows(fine, fine_support, fine_width, near, support, width, first, last):
    """Nearest inverse depth of each block of 2x2, and its support."""
    stride = fine_width + 2
    for y in range(first, last):
        start, begin = (2 * y + 1) * stride + 1, (y + 1) * (width + 2) + 1
        upper, lower = fine[start : start + 2 * width], fine[start + stride : start + stride + 2 * width]
        counts, counts_below = fine_support[start : start + 2 * width], fine_support[start + stride :][: 2 * width]
        made, points = near[begin : begin + width], support[begin : begin + width]
        for x in range(width):
            a, b, c, d = upper[2 * x], upper[2 * x + 1], lower[2 * x], lower[2 * x + 1]
            top, bottom = max(max(a, b), max(c, d)), min(min(a, b), min(c, d))
            slope = min(abs(a - b), abs(c - d)) + min(abs(a - c), abs(b - d))
            planar = (bottom > _F(0.0)) & (abs((a - b) - (c - d)) <= _F(TWIST) * top) & (slope <= _F(STEEPEST) * top)
            limit = top * _SAME - (slope if planar else _F(0.0))
            made[x] = top
            points[x] = ((_part(limit, a, counts[2 * x]) + _part(limit, b, counts[2 * x + 1]))
                         + _part(limit, c, counts_below[2 * x])) + _part(limit, d, counts_below[2 * x + 1])


@compiled(nogil=True)
def surround(plane, width, height, mirrored):
    """Sets the edge of a plane: mirrored about its outermost pixels, or 0."""
    stride = width + 2
    second, before = min(1, width - 1), max(width - 2, 0)
    for y in range(1, height + 1):
        row = plane[y * stride : (y + 1) * stride]
        row[0], row[width + 1] = (row[1 + second], row[1 + before]) if mirrored else (_F(0.0), _F(0.0))
    second, before = min(1, height - 1), max(height - 2, 0)
    if mirrored:
        plane[:stride] = plane[(1 + second) * stride : (2 + second) * stride]
        plane[(height + 1) * stride :] = plane[(1 + before) * stride : (2 + before) * stride]
    else:
        plane[:stride] = _F(0.0)
        plane[(height + 1) * stride :] = _F(0.0)


@compiled(nogil=True, inline="always")
def _narrower(best, a, b):
    return min(best, abs(a - b) * _F(0.5)) if (a > _F(0.0)) & (b > _F(0.0)) else best


@compiled(nogil=True, inline="always")
def _front(e, se, s, sw, w, nw, n, ne):
    """A surface in every direction: of each two consecutive neighbours the nearer one, and of those the farthest."""
    return min(min(min(max(e, se), max(se, s)), min(max(s, sw), max(sw, w))),
               min(min(max(w, nw), max(nw, n)), min(max(n, ne), max(ne, e))))


@compiled(nogil=True, inline="always")
def _slope(e, se, s, sw, w, nw, n, ne):
    across = _narrower(_narrower(_narrower(_F(EMPTY), e, w), ne, nw), se, sw)
    return across + _narrower(_narrower(_narrower(_F(EMPTY), s, n), sw, nw), se, ne)


@compiled(nogil=True)
def _fine_thresholds(near, y, width, share, slope_share, row):
    """As ``_thresholds`` at level 0, where nine blocks are always few pixels and never clumped."""
    stride = width + 2
    start = y * stride
    above, here, below = near[start : start + stride], near[start + stride :][:stride], near[start + 2 * stride :][:stride]
    for x in range(width):
        nw, n, ne, w, e = above[x], above[x + 1], above[x + 2], here[x], here[x + 2]
        sw, s, se = below[x], below[x + 1], below[x + 2]
        value = _front(e, se, s, sw, w, nw, n, ne) * share - _slope(e, se, s, sw, w, nw, n, ne) * slope_share
        row[x] = max(value, _F(0.0))


@compiled(nogil=True)
def _thresholds(near, support, y, width, share, slope_share, share_clumped, row):
    """The inverse depth below which a pixel of each block of row y is hidden by the blocks around it; 0 where none is."""
    stride = width + 2
    start = y * stride
    above, here, below = near[start : start + stride], near[start + stride :][:stride], near[start + 2 * stride :][:stride]
    counts_above, counts = support[start : start + stride], support[start + stride :][:stride]
    counts_below = support[start + 2 * stride :][:stride]
    for x in range(width):
        nw, n, ne = above[x], above[x + 1], above[x + 2]
        w, own, e = here[x], here[x + 1], here[x + 2]
        sw, s, se = below[x], below[x + 1], below[x + 2]
        front = _front(e, se, s, sw, w, nw, n, ne)
        limit = front * _SAME
        shared = own >= limit
        total = counts[x + 1] if shared else _F(0.0)
        total += _on(limit, e, counts[x + 2])
        total += _on(limit, se, counts_below[x + 2])
        total += _on(limit, s, counts_below[x + 1])
        total += _on(limit, sw, counts_below[x])
        total += _on(limit, w, counts[x])
        total += _on(limit, nw, counts_above[x])
        total += _on(limit, n, counts_above[x + 1])
        total += _on(limit, ne, counts_above[x + 2])
        count = np.floor(total * _F(1.0 / CHILDREN))
        held = total - count * _F(CHILDREN)
        sparse = (count < _LIMIT) | (shared & (count < _LIMIT_SHARED))
        clumped = _F(56.0) * count >= _F(CLUMPED) * (_F(56.0) * held + held * held)
        value = front * (share_clumped if clumped else share) - _slope(e, se, s, sw, w, nw, n, ne) * slope_share
        row[x] = max(value, _F(0.0)) if (front > _F(0.0)) & sparse else _F(0.0)


@compiled(nogil=True)
def _raise(row, coarse, y, width):
    """Raises a row of thresholds to those of the blocks above it.  coarse: (h, w) flat, or empty."""
    if len(coarse) == 0:
        return
    half = (width + 1) // 2
    line = coarse[y // 2 * half : (y // 2 + 1) * half]
    for x in range(width // 2):
        value = line[x]
        row[2 * x] = max(row[2 * x], value)
        row[2 * x + 1] = max(row[2 * x + 1], value)
    if width % 2:
        row[width - 1] = max(row[width - 1], line[half - 1])


@compiled(nogil=True)
def threshold_rows(near, support, width, coarse, share, slope_share, share_clumped, made, first, last):
    """Thresholds of a level, (h, w) flat, also of coarser ones.  The three shares:
    model.reference.filter_constants.hiding_limits."""
    for y in range(first, last):
        row = made[y * width : (y + 1) * width]
        _thresholds(near, support, y, width, share, slope_share, share_clumped, row)
        _raise(row, coarse, y, width)


@compiled(nogil=True)
def keep_rows(near, width, coarse, share, slope_share, colour, mask, filtered, first, last):
    """Level 0: keep-mask, 255 where kept, and filtered picture.  colour, filtered: (H * W,) uint32 RGBA8.  mask: (H * W,)."""
    row = np.empty(width, _F)
    for y in range(first, last):
        _fine_thresholds(near, y, width, share, slope_share, row)
        _raise(row, coarse, y, width)
        start = (y + 1) * (width + 2) + 1
        own, raw = near[start : start + width], colour[y * width : (y + 1) * width]
        kept, made = mask[y * width : (y + 1) * width], filtered[y * width : (y + 1) * width]
        for x in range(width):  # points without colour, whose alpha is 0, occlude and are not shown
            keep = (own[x] > _F(0.0)) & (own[x] >= row[x]) & (raw[x] >= _U(0xFF000000))
            kept[x] = np.uint8(255) if keep else np.uint8(0)
            made[x] = raw[x] if keep else _U(0)
