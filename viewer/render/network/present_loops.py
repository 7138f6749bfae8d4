"""The picture that is shown of the network's output, in compiled loops: the same operations in float32 as
shaders/network_output.comp, bounded by the filled picture.
"""

import numpy as np

from ....model.common.jit import compiled
from ....model.network.network_layout import PACKED_OUT
from ..passes.fill_picture_loops import byte_of

_F, _U = np.float32, np.uint32
_RAISE = _F(2.0**112)
"""Brings the bits of a half float, put where a float32 has them, to its value: the exponents count from 15 and from 127."""
_BYTE = _F(1.0 / 255.0)


@compiled(nogil=True, inline="always")
def _raised(half):
    return _U(0) if half & np.uint16(0x8000) else _U(half) << _U(13)  # zero has a sign, too


@compiled(nogil=True)
def present_rows(made, filled, width, shown, first, last):
    """Rows ``first`` to ``last`` of shown (P,) uint32 RGBA8.  made: (PACKED_OUT * P,) uint16, bits of half floats, cut off at
    0 and 1.  filled: (P,) uint32 RGBA8."""
    bits = np.empty((PACKED_OUT, width), np.uint32)
    values = bits.view(np.float32)
    for y in range(first, last):
        row, below = made[PACKED_OUT * y * width : PACKED_OUT * (y + 1) * width], filled[y * width : (y + 1) * width]
        red, green, blue, cover = bits[0], bits[1], bits[2], bits[3]
        for x in range(width):
            red[x], green[x] = _raised(row[PACKED_OUT * x]), _raised(row[PACKED_OUT * x + 1])
            blue[x], cover[x] = _raised(row[PACKED_OUT * x + 2]), _raised(row[PACKED_OUT * x + 3])
        r, g, b, c, out = values[0], values[1], values[2], values[3], shown[y * width : (y + 1) * width]
        for x in range(width):
            alpha = min(c[x] * _RAISE, _F(1.0)) * (_F(below[x] >> _U(24)) * _BYTE)
            out[x] = (byte_of(min(r[x] * _RAISE, _F(1.0)) * alpha) | byte_of(min(g[x] * _RAISE, _F(1.0)) * alpha) << _U(8)
                      | byte_of(min(b[x] * _RAISE, _F(1.0)) * alpha) << _U(16) | byte_of(alpha) << _U(24))
