"""Compiled loops of the fill's last step on the processor: the filled picture, its depth and the network's input, as
shaders/fill_picture.comp; the same operations in float32.
"""

from typing import NamedTuple

import numpy as np

from ....model.common.jit import compiled
from ....model.network.network_layout import DEPTH_FEATURE_SCALE, PACKED_IN
from ..culling.enclosed_directions import SEALED, SIDE
from ..device.gl_logarithms import exp2_row
from .fill_loops import FEATURE, NOISE, PLANES, WEIGHT, corners_row, measured_row, wide_row

_F, _U = np.float32, np.uint32
_TINY = _F(1e-20)
_LEAST_HALF = _F(2.0**-14)


class Around(NamedTuple):
    """What lies in the directions of a picture.  alike: the state of all of them, -1 where they differ.  closed: int8
    (6 * SIDE, SIDE).  axes: (3, 3) float32, world to view.  lens: (4,) float32, fx, fy, cx, cy.  holes: (h, w, 4) uint32, of
    hole_coverage.comp; (0, 0, 4) where all directions are closed."""

    alike: int
    closed: np.ndarray
    axes: np.ndarray
    lens: np.ndarray
    holes: np.ndarray


class Filled(NamedTuple):
    """What is written, flat.  shown: (P,) uint32 RGBA8.  depth: (P,) float32, or empty.  packed: (PACKED_IN, P) float32,
    values of half floats, or (PACKED_IN, 0)."""

    shown: np.ndarray
    depth: np.ndarray
    packed: np.ndarray


@compiled(nogil=True)
def _directions_row(around, y, states):
    """State of the direction of each pixel of row y."""
    axes, lens, closed = around.axes, around.lens, around.closed
    down = (_F(y) + _F(0.5) - lens[3]) / lens[1]
    for x in range(len(states)):
        across = (_F(x) + _F(0.5) - lens[2]) / lens[0]
        a = (axes[0, 0] * across + axes[1, 0] * down) + axes[2, 0]
        b = (axes[0, 1] * across + axes[1, 1] * down) + axes[2, 1]
        c = (axes[0, 2] * across + axes[1, 2] * down) + axes[2, 2]
        if abs(a) >= abs(b) and abs(a) >= abs(c):
            axis, along, u, v = 0, a, b, c
        elif abs(b) >= abs(c):
            axis, along, u, v = 1, b, c, a
        else:
            axis, along, u, v = 2, c, a, b
        face, size = 2 * axis + (1 if along < _F(0.0) else 0), abs(along)
        column = min(max(np.int32((u / size * _F(0.5) + _F(0.5)) * _F(SIDE)), 0), SIDE - 1)
        row = min(max(np.int32((v / size * _F(0.5) + _F(0.5)) * _F(SIDE)), 0), SIDE - 1)
        states[x] = closed[face * SIDE + row, column]


@compiled(nogil=True)
def _holes_row(holes, y, made):
    """The byte of each pixel of row y in ``holes``: made (4 w,) int32."""
    row, first, shift = holes[y // 4], 2 * (y // 2 % 2), _U(16 * (y % 2))
    for u in range(len(row)):
        left, right = row[u, first] >> shift, row[u, first + 1] >> shift
        made[4 * u], made[4 * u + 1] = np.int32(left & _U(0xFF)), np.int32(left >> _U(8) & _U(0xFF))
        made[4 * u + 2], made[4 * u + 3] = np.int32(right & _U(0xFF)), np.int32(right >> _U(8) & _U(0xFF))


@compiled(nogil=True)
def _cover_row(states, hole, weight, empty, alpha, closed):
    """Opacity of each pixel, and 1 in ``closed`` where the network must keep what is filled."""
    for x in range(len(alpha)):
        opaque = (states[x] != 0) | (weight[x] > _F(0.0))
        cover = _F(1.0) if opaque else _F(hole[x] >> 1) / _F(127.0)
        alpha[x] = _F(0.0) if empty else cover
        sealed = (states[x] == SEALED) | ((states[x] == 0) & (hole[x] & 1 != 0))
        closed[x] = _F(1.0) if sealed else _F(0.0)


@compiled(nogil=True, inline="always")
def byte_of(value):
    """A value 0..1 as a byte, halves to even, as OpenGL stores it."""
    value = min(max(value, _F(0.0)), _F(1.0))
    return _U(np.int32((value * _F(255.0 / 256.0) + _F(32768.0) - _F(32768.0)) * _F(256.0)))


@compiled(nogil=True)
def _shown_row(red, green, blue, alpha, shown):
    for x in range(len(shown)):
        a = alpha[x]
        shown[x] = byte_of(red[x] * a) | byte_of(green[x] * a) << _U(8) | byte_of(blue[x] * a) << _U(16) | byte_of(a) << _U(24)


@compiled(nogil=True)
def halves(line):
    """Rounds to half floats, to even."""
    bits = line.view(np.uint32)
    for x in range(len(line)):
        small = (line[x] + _F(0.75)) - _F(0.75)  # below the least normal one, multiples of 2^-24
        is_small, word = abs(line[x]) < _LEAST_HALF, bits[x]
        bits[x] = (word + _U(0xFFF) + (word >> _U(13) & _U(1))) & _U(0xFFFFE000)
        line[x] = small if is_small else line[x]


@compiled(nogil=True)
def _noise_row(near, far, unit, own, weight, line, made):
    """The noise level as the network takes it.  near, far: (across + 2,) rows of the level above."""
    factor = _F(0.0625) / unit
    for u in range(len(line)):
        line[u] = (_F(3.0) * near[u] + far[u]) * factor
    left, middle, right = line[: len(line) - 2], line[1 : len(line) - 1], line[2:]
    for u in range(len(middle)):
        made[2 * u], made[2 * u + 1] = _F(3.0) * middle[u] + left[u], _F(3.0) * middle[u] + right[u]
    for x in range(len(weight)):
        made[x] = own[x] + (_F(1.0) - weight[x]) * made[x]


@compiled(nogil=True)
def picture_rows(given, pyramid, around, made, first, last):
    """Rows 2 ``first`` to 2 ``last`` of the picture."""
    width, planes = given.width, PLANES if len(given.noise) > 0 else PLANES - 1
    begin, stride, across, down = pyramid.levels[0]
    whole = pyramid.values[WEIGHT, pyramid.levels[len(pyramid.levels) - 1, 0]]
    unit = max(whole, _TINY) if len(pyramid.levels) == 1 else _F(1.0)
    near, far = np.empty((PLANES, across + 2), _F), np.empty((PLANES, across + 2), _F)
    own, channels = np.zeros((PLANES, 2 * across), _F), np.zeros((PACKED_IN, 2 * across), _F)
    line, more, wide = np.empty(width, _F), np.empty(width, _F), np.empty(across + 2, _F)
    alpha, states = np.empty(width, _F), np.full(width, max(around.alike, 0), np.int32)
    hole = np.zeros(max(width, 4 * around.holes.shape[1]), np.int32)
    for y in range(2 * first, min(2 * last, given.height)):
        v = y // 2
        beyond = min(max(v + 2 * (y % 2) - 1, 0), down - 1)
        measured_row(given, y, own, line, more)
        weight = own[WEIGHT][:width]
        for plane in range(planes):
            if plane != WEIGHT:
                wide_row(pyramid.values[plane], begin, stride, across, v, near[plane])
                wide_row(pyramid.values[plane], begin, stride, across, beyond, far[plane])
        for plane in range(WEIGHT):
            value, start = channels[FEATURE + 1 if plane == FEATURE else plane], own[plane]
            corners_row(near[plane], far[plane], unit, value)
            for x in range(width):
                value[x] = start[x] + (_F(1.0) - weight[x]) * value[x]
        if around.alike < 0:
            _directions_row(around, y, states)
        if around.alike <= 0:
            _holes_row(around.holes, y, hole)
        _cover_row(states, hole, weight, whole == _F(0.0), alpha, channels[6])
        _shown_row(channels[0], channels[1], channels[2], alpha, made.shown[y * width : (y + 1) * width])
        if len(made.depth) > 0:
            depth = made.depth[y * width : (y + 1) * width]
            for x in range(width):
                line[x] = channels[FEATURE + 1, x] / _F(DEPTH_FEATURE_SCALE)
            exp2_row(line, more)
            for x in range(width):
                depth[x] = line[x] / given.feature_scale if alpha[x] == _F(1.0) else _F(0.0)
        if made.packed.shape[1] > 0:
            if planes == PLANES:
                _noise_row(near[NOISE], far[NOISE], unit, own[NOISE], weight, wide, channels[5])
            channels[3][:width] = weight
            last_channel = channels[7]
            for x in range(width):
                last_channel[x] = _F(1.0) - alpha[x]
            for c in range(PACKED_IN):
                row, value = made.packed[c, y * width : (y + 1) * width], channels[c]
                for x in range(width):
                    row[x] = value[x]
                halves(row)
