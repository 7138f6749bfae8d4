"""Compiled loops of the pull-push fill on the processor (viewer.render.passes.fill_cpu): the same operations as
shaders/fill_pull.comp, fill_push.comp and fill_picture.comp, in the same order and in float32.

The planes of all levels are rows of one array: red, green, blue and depth feature times the weight, the weight, and the noise
level times the weight.  A level has even sides; what its picture does not reach is 0.  Rows ``first`` to ``last`` are
written, so that threads can share a level.
"""

from typing import NamedTuple

import numpy as np

from ....model.common.jit import compiled
from ....model.network.network_layout import DEPTH_FEATURE_LIMIT, DEPTH_FEATURE_SCALE
from ....model.reference.fill_constants import EMPTY_FEATURE, FIRST_LEVEL, NEARER_SCALE, NEARER_START
from ..device.gl_logarithms import log2_row

FEATURE, WEIGHT, NOISE, PLANES = 3, 4, 5, 6
_F, _U = np.float32, np.uint32
_TINY, _BYTE = _F(1e-20), _F(1.0 / 255.0)


class Measured(NamedTuple):
    """What is filled, flat.  colours: uint32 RGBA8.  weights: float32 0..1, 0 where nothing is measured.  depths: float32.
    noise: float32; empty where it is 0 everywhere.  width, height: of the picture.  feature_scale: as in common_fill.glsl."""

    colours: np.ndarray
    weights: np.ndarray
    depths: np.ndarray
    noise: np.ndarray
    width: int
    height: int
    feature_scale: np.float32


class Pyramid(NamedTuple):
    """values: (PLANES, n) float32.  levels: (L, 4) int64, for each level from 1 on its first entry, the length of a row, width
    and height.  ramps: (L + 1, 2) float32, factor and offset of fill_constants.wider_ramp by level."""

    values: np.ndarray
    levels: np.ndarray
    ramps: np.ndarray


@compiled(nogil=True)
def feature_row(depths, scale, made, more):
    """Depth features of a row of positive depths: made (n,), ``feature`` of common_fill.glsl.  scale: 1 / (focal length in
    pixels x point spacing).  more: scratch, (n,)."""
    for x in range(len(made)):
        made[x] = depths[x] * scale
    log2_row(made, more)
    for x in range(len(made)):
        made[x] = min(max(made[x] * _F(DEPTH_FEATURE_SCALE), _F(-DEPTH_FEATURE_LIMIT)), _F(DEPTH_FEATURE_LIMIT))


@compiled(nogil=True)
def measured_row(given, y, made, line, more):
    """Row y of the picture: made (PLANES, >= width).  line, more: scratch, (width,) float32."""
    width = given.width
    colours, weights = given.colours[y * width : (y + 1) * width], given.weights[y * width : (y + 1) * width]
    depths, noisy = given.depths[y * width : (y + 1) * width], len(given.noise) > 0
    feature_row(depths, given.feature_scale, line, more)
    red, green, blue, feature, weight = made[0], made[1], made[2], made[FEATURE], made[WEIGHT]
    for x in range(width):
        word, w = colours[x], weights[x]
        weight[x] = w
        red[x] = _F(word & _U(0xFF)) * _BYTE * w
        green[x] = _F(word >> _U(8) & _U(0xFF)) * _BYTE * w
        blue[x] = _F(word >> _U(16) & _U(0xFF)) * _BYTE * w
    for x in range(width):
        feature[x] = line[x] * weight[x]
    if noisy:
        carried, noise = made[NOISE], given.noise[y * width : (y + 1) * width]
        for x in range(width):
            carried[x] = weight[x] * noise[x]


@compiled(nogil=True, inline="always")
def _unit(value):
    return min(max(value, _F(0.0)), _F(1.0))


@compiled(nogil=True, inline="always")
def _kept(farthest, feature, factor, offset):
    """``background`` of common_fill.glsl, of one of four samples."""
    nearer = _unit((farthest - feature) * _F(NEARER_SCALE) - _F(NEARER_START))
    return _F(1.0) - nearer * _unit(feature * factor + offset)


@compiled(nogil=True, inline="always")
def _feature(feature, weight):
    return feature / max(weight, _TINY) if weight > _F(0.0) else _F(EMPTY_FEATURE)


@compiled(nogil=True)
def _keep_row(features, weights, features_below, weights_below, factor, offset, kept):
    """Weights of the four children of each block: kept (4, width)."""
    p, q, r, s = kept[0], kept[1], kept[2], kept[3]
    for x in range(len(p)):
        a, b = _feature(features[2 * x], weights[2 * x]), _feature(features[2 * x + 1], weights[2 * x + 1])
        c = _feature(features_below[2 * x], weights_below[2 * x])
        d = _feature(features_below[2 * x + 1], weights_below[2 * x + 1])
        farthest = max(max(a, b), max(c, d))
        p[x], q[x] = _kept(farthest, a, factor, offset), _kept(farthest, b, factor, offset)
        r[x], s[x] = _kept(farthest, c, factor, offset), _kept(farthest, d, factor, offset)


@compiled(nogil=True)
def _sum_row(upper, lower, kept, made):
    """Sums of the four children of each block, weighted by kept (4, width) where it is not empty."""
    if kept.shape[1] == 0:
        for x in range(len(made)):
            made[x] = (upper[2 * x] + upper[2 * x + 1]) + (lower[2 * x] + lower[2 * x + 1])
        return
    p, q, r, s = kept[0], kept[1], kept[2], kept[3]
    for x in range(len(made)):
        made[x] = (p[x] * upper[2 * x] + q[x] * upper[2 * x + 1]) + (r[x] * lower[2 * x] + s[x] * lower[2 * x + 1])


@compiled(nogil=True)
def _pull_row(upper, lower, start, below, pyramid, number, y, planes, kept, scale):
    """Row y of level ``number`` + 1 from two rows of the finer one: planes of upper and lower, from entry start and below."""
    first, stride, width = pyramid.levels[number, 0], pyramid.levels[number, 1], pyramid.levels[number, 2]
    begin, twice = first + y * stride, 2 * width
    if number >= FIRST_LEVEL:
        _keep_row(upper[FEATURE][start : start + twice], upper[WEIGHT][start : start + twice],
                  lower[FEATURE][below : below + twice], lower[WEIGHT][below : below + twice],
                  pyramid.ramps[number, 0], pyramid.ramps[number, 1], kept)  # fmt: skip
    for plane in range(planes):
        _sum_row(upper[plane][start : start + twice], lower[plane][below : below + twice], kept,
                 pyramid.values[plane][begin : begin + width])
    weight = pyramid.values[WEIGHT][begin : begin + width]
    for x in range(width):
        scale[x] = _F(1.0) / weight[x] if weight[x] > _F(1.0) else _F(1.0)
        weight[x] = min(weight[x], _F(1.0))
    for plane in range(planes):
        if plane != WEIGHT:
            made = pyramid.values[plane][begin : begin + width]
            for x in range(width):
                made[x] = made[x] * scale[x]


@compiled(nogil=True)
def pull_picture(given, pyramid, first, last):
    """Level 1 from the picture."""
    planes = PLANES if len(given.noise) > 0 else PLANES - 1
    stride = given.width + given.width % 2
    upper, lower = np.zeros((PLANES, stride), _F), np.zeros((PLANES, stride), _F)
    line, more, kept = np.empty(given.width, _F), np.empty(given.width, _F), np.empty((4, 0), _F)
    scale = np.empty(pyramid.levels[0, 2], _F)
    for y in range(first, last):
        measured_row(given, 2 * y, upper, line, more)
        if 2 * y + 1 < given.height:
            measured_row(given, 2 * y + 1, lower, line, more)
        else:
            lower[:] = _F(0.0)
        _pull_row(upper, lower, 0, 0, pyramid, 0, y, planes, kept, scale)


@compiled(nogil=True)
def pull_level(pyramid, number, noisy, first, last):
    """Level ``number`` + 1 from the finer one."""
    begin, stride, width = pyramid.levels[number - 1, 0], pyramid.levels[number - 1, 1], pyramid.levels[number, 2]
    kept, scale = np.empty((4, width if number >= FIRST_LEVEL else 0), _F), np.empty(width, _F)
    for y in range(first, last):
        at = begin + 2 * y * stride
        _pull_row(pyramid.values, pyramid.values, at, at + stride, pyramid, number, y, PLANES if noisy else PLANES - 1, kept,
                  scale)


@compiled(nogil=True, inline="always")
def _corners(a, b, c, d):
    return ((_F(9.0) * a + _F(3.0) * b) + (_F(3.0) * c + d)) * _F(0.0625)


@compiled(nogil=True)
def corners_row(near, far, unit, made):
    """A completed level between its pixels' centres: made (2 w,), from the row of pixels that are nearer and the one that is
    farther, (w + 2,) of :func:`wide_row`."""
    a, left, right = near[1 : len(near) - 1], near[: len(near) - 2], near[2:]
    c, left_far, right_far = far[1 : len(far) - 1], far[: len(far) - 2], far[2:]
    for u in range(len(a)):
        made[2 * u] = _corners(a[u], left[u], c[u], left_far[u]) / unit
        made[2 * u + 1] = _corners(a[u], right[u], c[u], right_far[u]) / unit


@compiled(nogil=True)
def wide_row(values, first, stride, width, y, made):
    """Row y of a level with its first and last pixel repeated: made (width + 2,)."""
    row = values[first + y * stride : first + y * stride + width]
    made[1 : width + 1] = row
    made[0], made[width + 1] = row[0], row[width - 1]


@compiled(nogil=True)
def _gate_row(a, b, c, d, factor, offset, shares):
    """shares: (5, width), those of the four samples (``background`` times CORNERS) and their sum."""
    one, two, three, four, total = shares[0], shares[1], shares[2], shares[3], shares[4]
    for x in range(len(one)):
        farthest = max(max(a[x], b[x]), max(c[x], d[x]))
        one[x] = i = _kept(farthest, a[x], factor, offset) * _F(9.0)
        two[x] = j = _kept(farthest, b[x], factor, offset) * _F(3.0)
        three[x] = k = _kept(farthest, c[x], factor, offset) * _F(3.0)
        four[x] = m = _kept(farthest, d[x], factor, offset)
        total[x] = (i + j) + (k + m)


@compiled(nogil=True)
def _behind_row(a, b, c, d, shares, unit, made):
    one, two, three, four, total = shares[0], shares[1], shares[2], shares[3], shares[4]
    for x in range(len(made)):
        made[x] = (((one[x] * a[x] + two[x] * b[x]) + (three[x] * c[x] + four[x] * d[x])) / total[x]) / unit


@compiled(nogil=True)
def _noise_behind_row(a, b, c, d, shares, unit, made):
    one, two, three, four, total = shares[0], shares[1], shares[2], shares[3], shares[4]
    for x in range(len(made)):
        made[x] = (((four[x] * d[x] + three[x] * c[x]) + two[x] * b[x]) + one[x] * a[x]) / (total[x] * unit)


@compiled(nogil=True)
def _complete_row(values, weight, left, right):
    """Adds the part that the weights leave open of left and right, those of even and odd pixels."""
    for x in range(len(values) // 2):
        values[2 * x] += (_F(1.0) - weight[2 * x]) * left[x]
        values[2 * x + 1] += (_F(1.0) - weight[2 * x + 1]) * right[x]
    if len(values) % 2:
        values[-1] += (_F(1.0) - weight[len(values) - 1]) * left[len(values) // 2]


@compiled(nogil=True)
def push_level(pyramid, number, noisy, first, last):
    """Completes level ``number`` from the coarser one, which is complete, or the coarsest."""
    begin, stride, width, _ = pyramid.levels[number - 1]
    above, above_stride, across, down = pyramid.levels[number]
    coarsest = number + 1 == len(pyramid.levels)
    unit = max(pyramid.values[WEIGHT, above], _TINY) if coarsest else _F(1.0)
    factor, offset = pyramid.ramps[number + 1, 0], pyramid.ramps[number + 1, 1]
    near, far = np.empty((PLANES, across + 2), _F), np.empty((PLANES, across + 2), _F)
    shares, behind = np.empty((2, 5, across), _F), np.empty((2, across), _F)
    for y in range(first, last):
        v = y // 2
        beyond = min(max(v + 2 * (y % 2) - 1, 0), down - 1)
        for plane in range(PLANES):
            if plane != WEIGHT and (plane != NOISE or noisy):
                wide_row(pyramid.values[plane], above, above_stride, across, v, near[plane])
                wide_row(pyramid.values[plane], above, above_stride, across, beyond, far[plane])
        for side in range(2):
            _gate_row(near[FEATURE][1 : across + 1], near[FEATURE][2 * side : across + 2 * side], far[FEATURE][1 : across + 1],
                      far[FEATURE][2 * side : across + 2 * side], factor, offset, shares[side])
        at = begin + y * stride
        weight = pyramid.values[WEIGHT][at : at + width]
        for plane in range(PLANES):
            if plane == WEIGHT or (plane == NOISE and not noisy):
                continue
            for side in range(2):
                a, b = near[plane][1 : across + 1], near[plane][2 * side : across + 2 * side]
                c, d = far[plane][1 : across + 1], far[plane][2 * side : across + 2 * side]
                if plane == NOISE:
                    _noise_behind_row(a, b, c, d, shares[side], unit, behind[side])
                else:
                    _behind_row(a, b, c, d, shares[side], unit, behind[side])
            _complete_row(pyramid.values[plane][at : at + width], weight, behind[0], behind[1])


@compiled(nogil=True)
def fill_coarse(pyramid, number, noisy):
    """All levels above ``number``, up and down; then level ``number`` can be completed."""
    last = len(pyramid.levels)
    for made in range(number, last):
        pull_level(pyramid, made, noisy, 0, pyramid.levels[made, 3])
    for made in range(last - 1, number, -1):
        push_level(pyramid, made, noisy, 0, pyramid.levels[made - 1, 3])
