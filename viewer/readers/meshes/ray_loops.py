"""Compiled loops of places on meshes: whether clips leave a place; where a ray meets a triangle (Moeller, Trumbore 1997)."""

import numpy as np

from ....model.common.jit import compiled

_EDGE = 1e-13
"""Rounding of a share of a triangle: a ray through an edge meets one of its triangles."""


@compiled(nogil=True)
def clip_keeps(rows, groups, x, y, z):
    """Whether clips leave a place.  rows: (K, 3, 4) float64, a clip holds places where each row's value is within -1 and 1.
    groups: (K,) of viewer.picture.clip.group."""
    in_box, boxes, in_slab, slabs = False, False, False, False
    for k in range(len(rows)):
        inside = True
        for row in range(3):
            value = rows[k, row, 0] * x + rows[k, row, 1] * y + rows[k, row, 2] * z + rows[k, row, 3]
            if not (value <= 1.0 and value >= -1.0):
                inside = False
        if groups[k] == 2:
            if inside:
                return False
        elif groups[k] == 0:
            boxes, in_box = True, in_box or inside
        else:
            slabs, in_slab = True, in_slab or inside
    return (in_box or not boxes) and (in_slab or not slabs)


@compiled(nogil=True)
def ray_hit(vertices, faces, begin, way, clip_rows, clip_groups):
    """The nearest triangle on a ray: its number, -1 where there is none, and the distance along ``way`` (in its length).

    vertices: (V, 3) float64.  begin, way: (3,) float64, the same frame; clip_rows in that frame, too.
    """
    best, found = np.inf, -1
    for face in range(len(faces)):
        a, b, c = vertices[faces[face, 0]], vertices[faces[face, 1]], vertices[faces[face, 2]]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        px, py, pz = way[1] * vz - way[2] * vy, way[2] * vx - way[0] * vz, way[0] * vy - way[1] * vx
        volume = ux * px + uy * py + uz * pz
        if volume == 0.0:
            continue
        sx, sy, sz = begin[0] - a[0], begin[1] - a[1], begin[2] - a[2]
        u = (sx * px + sy * py + sz * pz) / volume
        if u < -_EDGE or u > 1.0 + _EDGE:
            continue
        qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
        v = (way[0] * qx + way[1] * qy + way[2] * qz) / volume
        if v < -_EDGE or u + v > 1.0 + _EDGE:
            continue
        t = (vx * qx + vy * qy + vz * qz) / volume
        if not (t > 0.0 and t < best):
            continue
        if len(clip_rows) > 0 and not clip_keeps(clip_rows, clip_groups, begin[0] + t * way[0], begin[1] + t * way[1],
                                                 begin[2] + t * way[2]):
            continue
        best, found = t, face
    return found, best
