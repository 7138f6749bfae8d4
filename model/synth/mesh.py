"""A coloured triangle mesh as something a `VirtualScanner` can scan.

Rays against a hierarchy of boxes split at the median (numba), nearest child first; the hit's colour is the mean of its
corners', weighted by where it lies (Moeller and Trumbore 1997).  Frame: the mesh's own, metres, z up for a scanner that
stands upright.
"""

import numpy as np

from model.compiled import compiled, unbroken

from .panorama import Seen

_LEAF = 4
_DEPTH = 64


class Mesh:
    """vertices (V,3) float metres; triangles (T,3) indices; colours (V,3) uint8 sRGB.

    Both sides of a triangle are seen.  Raises ValueError naming the first array that does not fit.
    """

    def __init__(self, vertices: np.ndarray, triangles: np.ndarray, colours: np.ndarray):
        vertices, triangles = np.asarray(vertices, np.float64), np.asarray(triangles, np.int64)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or not np.isfinite(vertices).all():
            raise ValueError(f"vertices {vertices.shape}: expected (V, 3) finite numbers")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0:
            raise ValueError(f"triangles {triangles.shape}: expected (T, 3) with T > 0")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise ValueError(f"triangles name vertex {triangles.min()} to {triangles.max()}, there are {len(vertices)}")
        if np.shape(colours) != vertices.shape:
            raise ValueError(f"colours {np.shape(colours)}: expected one for each of {len(vertices)} vertices")
        self._colours = np.asarray(colours, np.float64)[triangles] / 255.0
        corners = vertices[triangles]
        self._first, self._u, self._v = (np.ascontiguousarray(corners[:, k] - (corners[:, 0] if k else 0)) for k in range(3))
        normal = np.cross(self._u, self._v)
        self._normal = normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
        self._order, self._boxes, self._links = _hierarchy(corners.min(1), corners.max(1))

    def trace(self, origins: np.ndarray, rays: np.ndarray) -> Seen:
        """What rays (N,3), unit directions, from ``origins`` (N,3) meet."""
        origins, rays = np.ascontiguousarray(origins, np.float64), np.ascontiguousarray(rays, np.float64)
        with unbroken():
            t, which, u, v = _nearest(origins, rays, self._first, self._u, self._v, self._order, self._boxes, self._links)
        hit = which >= 0
        at = np.where(hit, which, 0)
        weights = np.stack([1 - u - v, u, v], 1)
        rgb = np.einsum("nk,nkc->nc", weights, self._colours[at]) * hit[:, None]
        normal = self._normal[at] * hit[:, None]
        normal = np.where(np.einsum("ij,ij->i", normal, rays)[:, None] > 0, -normal, normal)
        return Seen(t, rgb, normal, np.zeros(len(t)), 1 - rgb.max(1, initial=0.0))

    def ranges(self, origins: np.ndarray, rays: np.ndarray) -> np.ndarray:
        """(N,) metres along each ray, inf for nothing."""
        return self.trace(origins, rays).t


def _hierarchy(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """order (T,), boxes (M,6) and links (M,2): a leaf's (first place in order, count), an inner node's (left child, -1), its
    right child being the next after it."""
    order, middle = np.arange(len(low)), (low + high) / 2
    boxes, links = [np.zeros(6)], [(0, len(low))]
    stack = [0]
    while stack:
        node = stack.pop()
        first, count = links[node]
        own = order[first : first + count]
        boxes[node] = np.concatenate([low[own].min(0), high[own].max(0)])
        if count <= _LEAF:
            continue
        axis = int(np.ptp(middle[own], axis=0).argmax())
        half = count // 2
        order[first : first + count] = own[np.argpartition(middle[own, axis], half)]
        child = len(boxes)
        boxes += [np.zeros(6), np.zeros(6)]
        links += [(first, half), (first + half, count - half)]
        links[node] = (child, -1)
        stack += [child, child + 1]
    return order, np.array(boxes), np.array(links, np.int64)


@compiled(nogil=True)
def _enters(box, o, inverse, limit):
    """Where a ray enters a box, infinite where it does not before ``limit``."""
    near, far = 0.0, limit
    for k in range(3):
        a, b = (box[k] - o[k]) * inverse[k], (box[k + 3] - o[k]) * inverse[k]
        if a > b:
            a, b = b, a
        if a > near:
            near = a
        if b < far:
            far = b
    return near if near <= far else np.inf


@compiled(nogil=True)
def _nearest(origins, rays, first, edge_u, edge_v, order, boxes, links):
    n = len(origins)
    ts, which, us, vs = np.full(n, np.inf), np.full(n, -1, np.int64), np.zeros(n), np.zeros(n)
    stack = np.empty(_DEPTH, np.int64)
    for j in range(n):
        o, d = origins[j], rays[j]
        inverse = 1.0 / np.where(np.abs(d) < 1e-300, 1e-300, d)
        depth = 1
        stack[0] = 0
        while depth > 0:
            depth -= 1
            node = stack[depth]
            if _enters(boxes[node], o, inverse, ts[j]) == np.inf:
                continue
            start, count = links[node]
            if count < 0:
                left, right = _enters(boxes[start], o, inverse, ts[j]), _enters(boxes[start + 1], o, inverse, ts[j])
                stack[depth], stack[depth + 1] = (start + 1, start) if left <= right else (start, start + 1)
                depth += 2
                continue
            for place in range(start, start + count):
                i = order[place]
                u, v = edge_u[i], edge_v[i]
                p = np.cross(d, v)
                turn = np.dot(u, p)
                if abs(turn) < 1e-300:
                    continue
                s = o - first[i]
                a = np.dot(s, p) / turn
                q = np.cross(s, u)
                b = np.dot(d, q) / turn
                t = np.dot(v, q) / turn
                if a >= 0 and b >= 0 and a + b <= 1 and 1e-9 < t < ts[j]:
                    ts[j], which[j], us[j], vs[j] = t, i, a, b
    return ts, which, us, vs
