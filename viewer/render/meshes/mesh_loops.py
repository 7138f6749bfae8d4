"""Compiled loops that draw triangles: for each pixel the nearest triangle that its ray meets.

A triangle is tested by the three planes through the eye and its edges (homogeneous edge functions: Olano, Greer 1997), so that
nothing is clipped at the near plane and the weights of the corners are correct in perspective.  Of an orthographic camera the
same formulas hold with corners (x, y, 1).  Pixels are sampled at their centres; a pixel on a shared edge belongs to both
triangles, and of equal depths the first triangle wins, so that threads do not change the picture.

View frame: x right, y down, z forward, units of the document, float64.  lens: (5,) float64 fx, fy, cx, cy and the depth at
which an orthographic camera has its scale, 0 of a pinhole.
Reference implementation: tests/unit/plain_mesh_picture.py.
"""

import numpy as np

from ....model.common.jit import compiled
from ...readers.meshes.ray_loops import clip_keeps

_EDGE = 1e-13
"""Rounding of an edge function, relative to its terms: pixels on an edge count as inside both triangles."""
_NEAR = 1e-6
"""Share of a triangle's largest depth before which its box in the picture does not look: it only bounds the box."""


@compiled(nogil=True)
def view_places(vertices, matrix, view, start, stop):
    """Places in the view frame.  vertices: (V, 3) float64.  matrix: (3, 4) float64.  view: (V, 3) float64, written."""
    for i in range(start, stop):
        x, y, z = vertices[i, 0], vertices[i, 1], vertices[i, 2]
        for axis in range(3):
            view[i, axis] = matrix[axis, 0] * x + matrix[axis, 1] * y + matrix[axis, 2] * z + matrix[axis, 3]


@compiled(nogil=True)
def triangle_boxes(view, faces, lens, width, height, boxes, start, stop):
    """First and last column and row of each triangle; the last before the first where it is in no pixel.

    boxes: (F, 4) int32, written.
    """
    for number in range(start, stop):
        boxes[number, 0], boxes[number, 1], boxes[number, 2], boxes[number, 3] = 0, -1, 0, -1
        far = max(view[faces[number, 0], 2], view[faces[number, 1], 2], view[faces[number, 2], 2])
        if not far > 0.0:
            continue
        near = _NEAR * far
        left, right, top, bottom = np.inf, -np.inf, np.inf, -np.inf
        for corner in range(3):
            a, b = view[faces[number, corner]], view[faces[number, (corner + 1) % 3]]
            for end in range(2):
                x, y, z = a[0], a[1], a[2]
                if end == 1:  # where the edge passes the near plane
                    if (a[2] > near) == (b[2] > near):
                        continue
                    share = (near - a[2]) / (b[2] - a[2])
                    x, y, z = a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), near
                elif not z > near:
                    continue
                by = lens[4] if lens[4] > 0.0 else z
                u, v = lens[0] * x / by + lens[2], lens[1] * y / by + lens[3]
                left, right, top, bottom = min(left, u), max(right, u), min(top, v), max(bottom, v)
        if right < 0.0 or left > width or bottom < 0.0 or top > height or not right >= left:
            continue
        boxes[number, 0] = np.int32(max(np.ceil(left - 0.5 - 1e-4), 0.0))
        boxes[number, 1] = np.int32(min(np.floor(right - 0.5 + 1e-4), width - 1.0))
        boxes[number, 2] = np.int32(max(np.ceil(top - 0.5 - 1e-4), 0.0))
        boxes[number, 3] = np.int32(min(np.floor(bottom - 0.5 + 1e-4), height - 1.0))


@compiled(nogil=True, inline="always")
def edge_functions(view, face, parallel, edges):
    """The edge functions of a triangle, as rows of ``edges``, (3, 3): at the ray (x, y, 1) they have the ratio of the corners'
    weights, and not negative inside.  Returns whether the triangle has an area in the picture."""
    a, b, c = view[face[0]], view[face[1]], view[face[2]]
    az, bz, cz = (1.0, 1.0, 1.0) if parallel else (a[2], b[2], c[2])
    edges[0, 0], edges[0, 1], edges[0, 2] = b[1] * cz - bz * c[1], bz * c[0] - b[0] * cz, b[0] * c[1] - b[1] * c[0]
    edges[1, 0], edges[1, 1], edges[1, 2] = c[1] * az - cz * a[1], cz * a[0] - c[0] * az, c[0] * a[1] - c[1] * a[0]
    edges[2, 0], edges[2, 1], edges[2, 2] = a[1] * bz - az * b[1], az * b[0] - a[0] * bz, a[0] * b[1] - a[1] * b[0]
    volume = a[0] * edges[0, 0] + a[1] * edges[0, 1] + az * edges[0, 2]
    if volume < 0.0:
        for row in range(3):
            for column in range(3):
                edges[row, column] = -edges[row, column]
    return volume != 0.0


@compiled(nogil=True)
def nearest_rows(view, faces, boxes, lens, clip_rows, clip_groups, depth, number, start, stop):
    """Of rows of the picture the nearest triangle: depth (H, W) float32, +inf where there is none yet, and number (H, W) int32
    are written where a triangle is nearer.  boxes: of triangle_boxes."""
    edges, parallel = np.empty((3, 3)), lens[4] > 0.0
    step = (lens[4] if parallel else 1.0) / lens[0]
    for face in range(len(faces)):
        first, last = max(boxes[face, 2], start), min(boxes[face, 3], stop - 1)
        if first > last or boxes[face, 0] > boxes[face, 1]:
            continue
        if not edge_functions(view, faces[face], parallel, edges):
            continue
        za, zb, zc = view[faces[face, 0], 2], view[faces[face, 1], 2], view[faces[face, 2], 2]
        for row in range(first, last + 1):
            y = (row + 0.5 - lens[3]) * (lens[4] if parallel else 1.0) / lens[1]
            fixed0, fixed1, fixed2 = (edges[0, 1] * y + edges[0, 2], edges[1, 1] * y + edges[1, 2],
                                      edges[2, 1] * y + edges[2, 2])
            slack0 = -_EDGE * (abs(edges[0, 1] * y) + abs(edges[0, 2]))
            slack1 = -_EDGE * (abs(edges[1, 1] * y) + abs(edges[1, 2]))
            slack2 = -_EDGE * (abs(edges[2, 1] * y) + abs(edges[2, 2]))
            for column in range(boxes[face, 0], boxes[face, 1] + 1):
                x = (column + 0.5 - lens[2]) * step
                a, b, c = edges[0, 0] * x + fixed0, edges[1, 0] * x + fixed1, edges[2, 0] * x + fixed2
                if a < slack0 or b < slack1 or c < slack2:
                    continue
                whole = a + b + c
                if not whole > 0.0:
                    continue
                z = (a * za + b * zb + c * zc) / whole
                near = np.float32(z)
                if not (z > 0.0 and near < depth[row, column]):
                    continue
                if len(clip_rows) > 0:
                    out = 1.0 if parallel else z
                    if not clip_keeps(clip_rows, clip_groups, x * out, y * out, z):
                        continue
                depth[row, column], number[row, column] = near, face
