"""log2 and exp2 of rows of float32 in compiled loops, as software OpenGL (llvmpipe) computes them: polynomials with an error of
1e-6.  Calls of the C library would not be vectorised.
"""

import numpy as np

from ....model.common.intrinsics import multiply_add
from ....model.common.jit import compiled

_F, _U = np.float32, np.uint32
_L0, _L1, _L2, _L3, _L4 = (_F(c) for c in (2.88539009343309178325, 0.961791550404184197881, 0.577440339438736392009,
                                          0.403343858251329912514, 0.406718052498846252698))
_E0, _E1, _E2, _E3, _E4, _E5 = (_F(c) for c in (1.0, 0.693153073200168932794, 0.240153617044375388211, 0.0558263180532956664775,
                                               0.00898934009049466391101, 0.00187757667519147912699))


@compiled(nogil=True)
def log2_row(line, more):
    """Replaces the positive values of line (n,) by their logarithms.  more: scratch, (n,)."""
    bits, mantissa = line.view(np.uint32), more.view(np.uint32)
    for x in range(len(line)):
        mantissa[x] = (bits[x] & _U(0x7FFFFF)) | _U(0x3F800000)
    for x in range(len(line)):
        exponent = _F(np.int32(bits[x] >> _U(23)) - np.int32(127))
        y = (more[x] - _F(1.0)) / (more[x] + _F(1.0))
        z = y * y
        square = z * z
        even = multiply_add(square, multiply_add(square, _L4, _L2), _L0)
        line[x] = multiply_add(y, multiply_add(multiply_add(square, _L3, _L1), z, even), exponent)


@compiled(nogil=True)
def exp2_row(line, more):
    """Replaces the values of line (n,) by two to their power.  more: scratch, (n,)."""
    power = more.view(np.uint32)
    for x in range(len(line)):
        value = min(max(line[x], _F(-126.99999)), _F(128.0))
        whole = np.floor(value)
        power[x] = _U(np.int32(whole) + np.int32(127)) << _U(23)
        part = value - whole
        square = part * part
        even = multiply_add(square, multiply_add(square, _E4, _E2), _E0)
        odd = multiply_add(square, multiply_add(square, _E5, _E3), _E1)
        line[x] = multiply_add(odd, part, even)
    for x in range(len(line)):
        line[x] = more[x] * line[x]
