"""Compiled loop of the normals at the corners of triangles: smooth over gentle bends, sharp at edges."""

import numpy as np

from ....model.common.jit import compiled

SMOOTH = 0.74
"""Cosine of 42 degrees between two faces that share a normal: a pipe of nine sides is smooth, a chamfer of 45 degrees sharp."""
MOST_AROUND = 256
"""Faces around a vertex beyond which each has its own normal there: the time grows with their square."""


@compiled(nogil=True)
def corner_normals(across, angle, starts, corners, place, normals, start, stop):
    """Normals of the corners of faces ``start`` to ``stop``: at each, the mean of the faces around its place that bend away
    by less than SMOOTH, by their angles there.

    across: (F, 3) float64 unit normals.  angle: (F, 3) float64 radians at the corners.  starts: (P + 1,) and corners: (3 F,)
    int64: corner numbers (3 face + corner) at each place, one place after the other.  place: (3 F,) int64 of each corner.
    normals: (F, 3, 3) float32, written.
    """
    for face in range(start, stop):
        for corner in range(3):
            at = place[3 * face + corner]
            first, last = starts[at], starts[at + 1]
            x, y, z = across[face, 0], across[face, 1], across[face, 2]
            if last - first <= MOST_AROUND:
                x, y, z = 0.0, 0.0, 0.0
                for entry in range(first, last):
                    other, which = corners[entry] // 3, corners[entry] % 3
                    bend = (across[face, 0] * across[other, 0] + across[face, 1] * across[other, 1]
                            + across[face, 2] * across[other, 2])
                    if bend >= SMOOTH:
                        x += angle[other, which] * across[other, 0]
                        y += angle[other, which] * across[other, 1]
                        z += angle[other, which] * across[other, 2]
            length = max(np.sqrt(x * x + y * y + z * z), 1e-300)
            normals[face, corner, 0], normals[face, corner, 1], normals[face, corner, 2] = x / length, y / length, z / length
