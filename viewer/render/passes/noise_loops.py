"""The noise level of each pixel in compiled loops: the same operations as shaders/noise_level.comp in software OpenGL, in the
same order and in float32.
"""

from typing import NamedTuple

import numpy as np

from ....model.common.jit import compiled

_F, _U = np.float32, np.uint32
_BYTE = _F(1.0 / 255.0)


class Lattice(NamedTuple):
    """The scan's noise, float32, as the uniforms of noise_level.comp.  sigma: (z, y, x).  curve: (KNOTS,).  lens: (4,).
    to_lattice: (3, 3), rows for view x, y, z.  eye: (3,), voxels.  luma: (3,)."""

    sigma: np.ndarray
    curve: np.ndarray
    lens: np.ndarray
    to_lattice: np.ndarray
    eye: np.ndarray
    luma: np.ndarray
    parallel: np.float32
    scale: np.float32
    point_weight: np.float32


@compiled(nogil=True)
def noise_rows(colours, depths, points, weights, lattice, width, made, first, last):
    """Noise level of rows ``first`` to ``last``: made (P,) float32, values of half floats; cut off, not rounded, as software
    OpenGL stores them.  points: (P,) uint8, sums of weights.  weights: (P,) float32, 0 where nothing is kept."""
    sigma, curve, lens, turn, eye = lattice.sigma, lattice.curve, lattice.lens, lattice.to_lattice, lattice.eye
    deep, tall, broad = sigma.shape
    flat, knots, luma = sigma.reshape(-1), np.int32(len(curve) - 2), lattice.luma
    place = np.empty(width, np.int32)
    for y in range(first, last):
        start = y * width
        down = (_F(y) + _F(0.5) - lens[3]) / lens[1]
        z_row, word_row = depths[start : start + width], colours[start : start + width]
        count_row = points[start : start + width]
        kept, out = weights[start : start + width], made[start : start + width]
        for x in range(width):
            z = z_row[x] if kept[x] > _F(0.0) else _F(1.0)
            far = lattice.parallel if lattice.parallel > _F(0.0) else z
            across, below = (_F(x) + _F(0.5) - lens[2]) / lens[0] * far, down * far
            a = eye[0] + ((turn[0, 0] * across + turn[1, 0] * below) + turn[2, 0] * z)
            b = eye[1] + ((turn[0, 1] * across + turn[1, 1] * below) + turn[2, 1] * z)
            c = eye[2] + ((turn[0, 2] * across + turn[1, 2] * below) + turn[2, 2] * z)
            u = np.int32(min(max(np.floor(a), _F(0.0)), _F(broad - 1)))
            v = np.int32(min(max(np.floor(b), _F(0.0)), _F(tall - 1)))
            w = np.int32(min(max(np.floor(c), _F(0.0)), _F(deep - 1)))
            place[x] = (w * np.int32(tall) + v) * np.int32(broad) + u
        for x in range(width):
            word = word_row[x]
            red, green, blue = (_F(word & _U(0xFF)) * _BYTE, _F(word >> _U(8) & _U(0xFF)) * _BYTE,
                                _F(word >> _U(16) & _U(0xFF)) * _BYTE)
            knot = ((blue * luma[2] + green * luma[1]) + red * luma[0]) * _F(len(curve) - 1)
            below_knot = min(np.int32(knot), knots)
            part = knot - _F(below_knot)
            factor = curve[below_knot] + part * (curve[below_knot + 1] - curve[below_knot])
            count = max(_F(count_row[x]) / lattice.point_weight, _F(1.0))
            out[x] = lattice.scale * factor * flat[place[x]] * (_F(1.0) / np.sqrt(count))
        bits = out.view(np.uint32)
        for x in range(width):
            bits[x] = bits[x] & _U(0xFFFFE000) if kept[x] > _F(0.0) else _U(0)
