"""Compiled loops that move an earlier neural picture to the present camera where OpenGL is software: shaders/reproject.comp is
the same on a GPU.  Reference implementation: model/reference/reprojection.py, whose constants are compiled in.

A row is worked on in strips.  Their values are planes of one array, so that each loop is compiled to vector instructions: they
need no branch, and a distance between what is read and what is written that the compiler knows.  Pictures are RGBA8 in a word.
"""

import numpy as np

from ....model.common.jit import compiled
from ....model.reference.reprojection import COUNTED, FADES_OVER, MOST_NEARER, SAME_DEPTH, SHARE, WIDER

STRIP = 256
_PLANE = STRIP + 16  # with a power of two, planes would share lines of the cache
_LOW, _HIGH, _SUM = 0, 3 * _PLANE, 6 * _PLANE  # of three pixels above each other, by channel, from one before the strip on
_OWN, _AT, _TEXELS = 10 * _PLANE, 11 * _PLANE, 12 * _PLANE
_WORDS = 16
_COLUMN, _ROW, _AHEAD, _TRUST, _RIGHT, _BELOW = (_PLANE * k for k in range(6))
_FLOATS = 6
_F, _I = np.float32, np.int32
_BYTE = np.int32(255)


@compiled(nogil=True)
def moved_rows(filled, depth, earlier, earlier_depth, place, smoothing, result, counts, first, last):
    """Rows ``first`` to ``last`` of result (H, W) uint32, and in counts (H,) int64 the counted pixels that were moved.

    filled: (H, W) uint32.  depth: (H, W) float32, view-space z, 0 where it is not opaque.  earlier, earlier_depth: the same of
    the earlier camera, (h, w).  place: (20,) float32, rotation by rows and shift, present view frame -> earlier one; 1 / fx,
    1 / fy, -cx / fx, -cy / fy of the present camera; fx, fy, cx, cy of the earlier one.
    """
    height, width = depth.shape
    n, s = np.zeros(_WORDS * _PLANE, np.int32), np.zeros(_FLOATS * _PLANE, np.float32)
    texels, depths = earlier.view(np.int32).reshape(-1), earlier_depth.reshape(-1)
    size = earlier_depth.shape
    for y in range(first, last):
        counts[y] = 0
        above, here, below = filled[max(y - 1, 0)], filled[y], filled[min(y + 1, height - 1)]
        for left in range(0, width, STRIP):
            if left > 0 and left + STRIP < width:
                part = slice(left - 1, left + STRIP + 1)
                _stacked(above[part], here[part], below[part], n)
            else:
                _stacked_at_border(above, here, below, left, n)
            _located(depth[y], left, y, size, place, n, s)
            _looked_up(depths, texels, size, n, s)
            if y % COUNTED == 0:
                for i in range(0, min(STRIP, width - left), COUNTED):
                    counts[y] += 1 if s[_TRUST + i] > _F(0.0) else 0
            _mixed(smoothing, n, s)
            out, count = result[y, left : left + STRIP], min(STRIP, width - left)
            for i in range(count):
                out[i] = np.uint32(n[_AT + i])


@compiled(nogil=True, inline="always")
def _stack(a, b, c, i, n):
    n[_OWN + i] = b
    for k in range(3):
        shift = _I(8 * k)
        one, two, three = a >> shift & _BYTE, b >> shift & _BYTE, c >> shift & _BYTE
        n[_LOW + k * _PLANE + i] = min(min(one, two), three)
        n[_HIGH + k * _PLANE + i] = max(max(one, two), three)
        n[_SUM + k * _PLANE + i] = one + two + three
    n[_SUM + 3 * _PLANE + i] = (a >> _I(24) & _BYTE) + (b >> _I(24) & _BYTE) + (c >> _I(24) & _BYTE)


@compiled(nogil=True)
def _stacked(above, here, below, n):
    """Range and sum of three rows of pixels."""
    for i in range(STRIP + 2):
        _stack(_I(above[i]), _I(here[i]), _I(below[i]), i, n)


@compiled(nogil=True)
def _stacked_at_border(above, here, below, left, n):
    last = len(here) - 1
    for i in range(STRIP + 2):
        x = min(max(left + i - 1, 0), last)
        _stack(_I(above[x]), _I(here[x]), _I(below[x]), i, n)


@compiled(nogil=True)
def _located(depth, left, y, size, place, n, s):
    """Where the earlier camera saw the surface of each pixel, how far ahead, and whether it could."""
    t0, t1, t2, t3, t4, t5, t6, t7, t8 = (place[0], place[1], place[2], place[3], place[4], place[5], place[6], place[7],
                                          place[8])  # fmt: skip
    sx, sy, sz, ax, bx = place[9], place[10], place[11], place[12], place[14]
    fx, fy, cx, cy = place[16], place[17], place[18], place[19]
    v = (_F(y) + _F(0.5)) * place[13] + place[15]
    high, wide, width = _F(size[0]), _F(size[1]), len(depth)
    columns = _I(size[1])
    for i in range(STRIP):
        s[_AHEAD + i] = depth[min(left + i, width - 1)]
    for i in range(STRIP):
        z = s[_AHEAD + i]
        u = (_F(_I(left) + _I(i)) + _F(0.5)) * ax + bx
        px, py = u * z, v * z
        x, down, ahead = t0 * px + t1 * py + t2 * z + sx, t3 * px + t4 * py + t5 * z + sy, t6 * px + t7 * py + t8 * z + sz
        column, row = fx * (x / ahead) + cx, fy * (down / ahead) + cy
        inside = (z > _F(0.0)) & (ahead > _F(0.0)) & (column >= _F(0.0)) & (row >= _F(0.0)) & (column < wide) & (row < high)
        nearer = min(max((_F(MOST_NEARER) - ahead / z) * _F(1.0 / FADES_OVER), _F(0.0)), _F(1.0))
        column, row = column if inside else _F(0.0), row if inside else _F(0.0)
        s[_COLUMN + i], s[_ROW + i], s[_AHEAD + i] = column, row, ahead
        s[_TRUST + i] = nearer if inside else _F(0.0)
        n[_AT + i] = _I(row) * columns + _I(column)


@compiled(nogil=True)
def _looked_up(depths, texels, size, n, s):
    """The four pixels around each place, and how far it is trusted."""
    for i in range(STRIP):
        s[_RIGHT + i] = depths[n[_AT + i]]
    columns, last, lowest = _I(size[1]), _F(size[1] - 1), _F(size[0] - 1)
    for i in range(STRIP):
        known, ahead = s[_RIGHT + i], s[_AHEAD + i]
        apart = abs(known - ahead) / min(known, ahead)
        same = min(max(_F(2.0) - apart * _F(2.0 / SAME_DEPTH), _F(0.0)), _F(1.0))
        s[_TRUST + i] *= same if known > _F(0.0) else _F(0.0)
        column = min(max(s[_COLUMN + i] - _F(0.5), _F(0.0)), last)
        row = min(max(s[_ROW + i] - _F(0.5), _F(0.0)), lowest)
        left, top = np.floor(column), np.floor(row)
        s[_RIGHT + i], s[_BELOW + i] = column - left, row - top
        at = _I(top) * columns + _I(left)
        aside, under = _I(1) if left < last else _I(0), columns if top < lowest else _I(0)
        n[_TEXELS + i], n[_TEXELS + _PLANE + i] = at, at + aside
        n[_TEXELS + 2 * _PLANE + i], n[_TEXELS + 3 * _PLANE + i] = at + under, at + under + aside
    for i in range(STRIP):
        n[_TEXELS + i], n[_TEXELS + _PLANE + i] = texels[n[_TEXELS + i]], texels[n[_TEXELS + _PLANE + i]]
        n[_TEXELS + 2 * _PLANE + i] = texels[n[_TEXELS + 2 * _PLANE + i]]
        n[_TEXELS + 3 * _PLANE + i] = texels[n[_TEXELS + 3 * _PLANE + i]]


@compiled(nogil=True)
def _mixed(smoothing, n, s):
    """The pixels of the result, in the plane of _AT."""
    for i in range(STRIP):
        alphas = n[_SUM + 3 * _PLANE + i] + n[_SUM + 3 * _PLANE + i + 1] + n[_SUM + 3 * _PLANE + i + 2]
        own = n[_OWN + i + 1]
        scale = _F(own >> _I(24) & _BYTE) / _F(alphas) if alphas > 0 else _F(0.0)
        step = smoothing if alphas > 0 else _F(0.0)
        right, below, share = s[_RIGHT + i], s[_BELOW + i], _F(SHARE) * s[_TRUST + i]
        one, two = n[_TEXELS + i], n[_TEXELS + _PLANE + i]
        three, four = n[_TEXELS + 2 * _PLANE + i], n[_TEXELS + 3 * _PLANE + i]
        made = own & _I(-0x1000000)
        for k in range(3):
            shift, at = _I(8 * k), k * _PLANE + i
            low = min(min(n[_LOW + at], n[_LOW + at + 1]), n[_LOW + at + 2])
            high = max(max(n[_HIGH + at], n[_HIGH + at + 1]), n[_HIGH + at + 2])
            mean = _F(n[_SUM + at] + n[_SUM + at + 1] + n[_SUM + at + 2]) * scale
            base = _F(own >> shift & _BYTE)
            base += (mean - base) * step
            a, b = _F(one >> shift & _BYTE), _F(two >> shift & _BYTE)
            c, d = _F(three >> shift & _BYTE), _F(four >> shift & _BYTE)
            upper, lower = a + (b - a) * right, c + (d - c) * right
            beyond = _F(high - low) * _F(WIDER)
            colour = min(max(upper + (lower - upper) * below, _F(low) - beyond), _F(high) + beyond)
            base += (colour - base) * share
            made |= _I(min(max(base + _F(0.5), _F(0.0)), _F(255.0))) << shift
        n[_AT + i] = made
