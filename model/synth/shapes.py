"""Ray tracing of boxes, cylinders, capsules, ellipsoids and quads: the numba kernels of all synthetic places.

`Shapes` is a struct of arrays: each primitive has a kind, four parameters, and a local frame (a rotation from world to local,
and a centre) in which it is axis-aligned.  A bounding volume hierarchy with one primitive per leaf accelerates the tracing.
Frame: world metres.  Ray directions are unit vectors, so that t is metres; float64 throughout.

kind      params                             local shape
BOX       hx, hy, hz                         |x| <= hx, |y| <= hy, |z| <= hz
ROUND     hx, hy, hz, r                      the same box with edges rounded by r (sphere traced)
CYLINDER  r0, r1, h, caps                    radius r0 at z = -h to r1 at z = h; with end discs if caps > 0
CAPSULE   r, h                               points within r of the segment z = -h .. h
SPHERE    rx, ry, rz                         ellipsoid
QUAD      hx, hy, outline                    in z = 0; outline 0 rectangle, 1 ellipse, 2 leaf (pointed at x = -hx, hx)
"""

from dataclasses import dataclass

import numpy as np

from ..common.jit import compiled
from ..common.process.processors import in_slices
from ..common.process.signals import uninterrupted
from .hits import EPSILON, box_span, hit_ellipsoid, hit_quad, hit_round, hit_tube

BOX, ROUND, CYLINDER, CAPSULE, SPHERE, QUAD = range(6)
_STACK = 64
"""Stack entries of the traversal.  The tree is balanced: its depth is about log2 of the number of primitives."""


@dataclass(frozen=True)
class Shapes:
    """P primitives and their hierarchy.

    kind (P,) int64; params (P,4); centre (P,3); rotation (P,3,3) world -> local; casts (P,) bool: casts
    shadows; lows, highs (M,3): bounding boxes of the M nodes; links (M,2) int64: the two children, or (-1 - primitive, 0) at a
    leaf.
    """

    kind: np.ndarray
    params: np.ndarray
    centre: np.ndarray
    rotation: np.ndarray
    casts: np.ndarray
    lows: np.ndarray
    highs: np.ndarray
    links: np.ndarray

    def arrays(self) -> tuple[np.ndarray, ...]:
        """The arguments of the kernels, in order."""
        return (self.kind, self.params, self.centre, self.rotation, self.casts, self.lows, self.highs, self.links)

    def trace(self, origins: np.ndarray, directions: np.ndarray):
        """Nearest hits of N rays.  origins, directions: (N,3) float64, directions of unit length.

        Returns t (N,) metres, inf where nothing is hit; primitive (N,) int64, -1 there; normal (N,3) world, towards
        the ray's origin; uv (N,2) metres on the face hit (see `_surface`).
        """
        origins = np.ascontiguousarray(origins, np.float64)
        directions = np.ascontiguousarray(directions, np.float64)
        with uninterrupted():
            return in_slices(trace_rays, (origins, directions), *self.arrays())


def half_extents(kind: np.ndarray, params: np.ndarray) -> np.ndarray:
    """(P,3) half extents of each primitive along its local axes, metres."""
    p = np.asarray(params, np.float64)
    radius = np.maximum(p[:, 0], p[:, 1])
    out = p[:, :3].copy()
    out[kind == CYLINDER] = np.stack([radius, radius, p[:, 2]], 1)[kind == CYLINDER]
    out[kind == CAPSULE] = np.stack([p[:, 0], p[:, 0], p[:, 0] + p[:, 1]], 1)[kind == CAPSULE]
    out[kind == QUAD] = np.stack([p[:, 0], p[:, 1], 0 * radius], 1)[kind == QUAD]
    return out


def make_shapes(kind, params, centre, rotation, casts=None) -> Shapes:
    """Copies the arrays and builds the hierarchy, by median splits along the longest side of the centres' bounding box.

    The arguments are those of `Shapes` and are not checked.  casts: all True if None.
    """
    kind = np.asarray(kind, np.int64)
    params, centre = np.array(params, np.float64), np.array(centre, np.float64)
    rotation = np.array(rotation, np.float64)
    casts = np.ones(len(kind), bool) if casts is None else np.array(casts, bool)
    reach = np.einsum("pji,pj->pi", np.abs(rotation), half_extents(kind, params)) + 1e-9
    low, high = centre - reach, centre + reach
    lows, highs, links = [], [], []

    def node(members: np.ndarray) -> int:
        index = len(links)
        lows.append(low[members].min(0))
        highs.append(high[members].max(0))
        links.append((-1 - int(members[0]), 0))
        if len(members) > 1:
            axis = int(np.ptp(centre[members], 0).argmax())
            order = members[np.argsort(centre[members, axis], kind="stable")]
            half = len(order) // 2
            links[index] = (node(order[:half]), node(order[half:]))
        return index

    node(np.arange(len(kind)))
    return Shapes(kind, params, centre, rotation, casts, np.array(lows), np.array(highs), np.array(links, np.int64))


@compiled(nogil=True)
def one_hit(i, px, py, pz, vx, vy, vz, kind, params, centre, rotation):
    """t at which a world ray hits primitive i; inf if it misses."""
    px, py, pz = px - centre[i, 0], py - centre[i, 1], pz - centre[i, 2]
    ox = rotation[i, 0, 0] * px + rotation[i, 0, 1] * py + rotation[i, 0, 2] * pz
    oy = rotation[i, 1, 0] * px + rotation[i, 1, 1] * py + rotation[i, 1, 2] * pz
    oz = rotation[i, 2, 0] * px + rotation[i, 2, 1] * py + rotation[i, 2, 2] * pz
    dx = rotation[i, 0, 0] * vx + rotation[i, 0, 1] * vy + rotation[i, 0, 2] * vz
    dy = rotation[i, 1, 0] * vx + rotation[i, 1, 1] * vy + rotation[i, 1, 2] * vz
    dz = rotation[i, 2, 0] * vx + rotation[i, 2, 1] * vy + rotation[i, 2, 2] * vz
    p0, p1, p2, p3 = params[i, 0], params[i, 1], params[i, 2], params[i, 3]
    k = kind[i]
    if k == BOX:
        near, far = box_span(ox, oy, oz, dx, dy, dz, p0, p1, p2)
        if near > far or far <= EPSILON:
            return np.inf
        return near if near > EPSILON else far
    if k == QUAD:
        return hit_quad(ox, oy, oz, dx, dy, dz, p0, p1, p2)
    if k == CYLINDER:
        return hit_tube(ox, oy, oz, dx, dy, dz, p0, p1, p2, p3)
    if k == SPHERE:
        return hit_ellipsoid(ox, oy, oz, dx, dy, dz, p0, p1, p2)
    if k == ROUND:
        return hit_round(ox, oy, oz, dx, dy, dz, p0, p1, p2, p3)
    best = hit_tube(ox, oy, oz, dx, dy, dz, p0, p0, p1, 0.0)
    for end in (-p1, p1):
        # Both roots count: from inside the tube, the first one lies on the sphere's half within the tube.
        z = oz - end
        b, c = ox * dx + oy * dy + z * dz, ox * ox + oy * oy + z * z - p0 * p0
        root = np.sqrt(max(b * b - c, 0.0))
        for t in (-b - root, -b + root):
            if b * b >= c and EPSILON < t < best and (oz + t * dz) * np.sign(end) >= p1:
                best = t
    return best


@compiled(nogil=True)
def nearest(ox, oy, oz, dx, dy, dz, limit, shadow, kind, params, centre, rotation, casts, lows, highs, links):
    """(t, primitive) of the nearest hit before ``limit``; (limit, -1) without one.

    shadow: returns any hit on a primitive that casts shadows, not necessarily the nearest.
    """
    stack = np.empty(_STACK, np.int64)
    stack[0] = 0
    depth, best, found = 1, limit, -1
    ix = 1.0 / dx if dx != 0.0 else 1e300
    iy = 1.0 / dy if dy != 0.0 else 1e300
    iz = 1.0 / dz if dz != 0.0 else 1e300
    while depth > 0:
        depth -= 1
        n = stack[depth]
        ax, bx = (lows[n, 0] - ox) * ix, (highs[n, 0] - ox) * ix
        ay, by = (lows[n, 1] - oy) * iy, (highs[n, 1] - oy) * iy
        az, bz = (lows[n, 2] - oz) * iz, (highs[n, 2] - oz) * iz
        near = max(max(min(ax, bx), min(ay, by)), max(min(az, bz), 0.0))
        if near > min(min(max(ax, bx), max(ay, by)), min(max(az, bz), best)):
            continue
        left = links[n, 0]
        if left >= 0:
            stack[depth], stack[depth + 1] = left, links[n, 1]
            depth += 2
            continue
        i = -1 - left
        if shadow and not casts[i]:
            continue
        t = one_hit(i, ox, oy, oz, dx, dy, dz, kind, params, centre, rotation)
        if t < best:
            best, found = t, i
            if shadow:
                break
    return best, found


@compiled(nogil=True)
def _surface(k, x, y, z, p0, p1, p2, p3):
    """Outward local normal and uv (metres) at a local surface point.

    uv of a flat face are the two coordinates in its plane, in order; uv of a round one are the arc length around z, and z.
    """
    if k == QUAD:
        return 0.0, 0.0, 1.0, x, y
    if k in (BOX, ROUND):
        r = p3 if k == ROUND else 0.0
        nx, ny, nz = abs(x) - p0, abs(y) - p1, abs(z) - p2
        if k == ROUND:
            nx, ny, nz = max(nx + r, 0.0), max(ny + r, 0.0), max(nz + r, 0.0)
        face = 0 if nx >= ny and nx >= nz else (1 if ny >= nz else 2)
        u, v = (y, z) if face == 0 else ((x, z) if face == 1 else (x, y))
        if k == BOX:
            nx, ny, nz = (1.0, 0.0, 0.0) if face == 0 else ((0.0, 1.0, 0.0) if face == 1 else (0.0, 0.0, 1.0))
        length = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)
        sx, sy, sz = (-1.0 if x < 0 else 1.0), (-1.0 if y < 0 else 1.0), (-1.0 if z < 0 else 1.0)
        return sx * nx / length, sy * ny / length, sz * nz / length, u, v
    angle = np.arctan2(y, x)
    if k == CYLINDER:
        if p3 > 0.0 and abs(z) > p2 - 1e-7:
            return 0.0, 0.0, np.sign(z), x, y
        slope = 0.5 * (p1 - p0) / p2
        length = np.sqrt(1.0 + slope * slope)
        return np.cos(angle) / length, np.sin(angle) / length, -slope / length, angle * 0.5 * (p0 + p1), z
    if k == CAPSULE:
        axial = z - min(max(z, -p1), p1)
        return x / p0, y / p0, axial / p0, angle * p0, z
    nx, ny, nz = x / (p0 * p0), y / (p1 * p1), z / (p2 * p2)
    length = max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)
    return nx / length, ny / length, nz / length, angle * p0, z


@compiled(nogil=True)
def trace_rays(origins, directions, kind, params, centre, rotation, casts, lows, highs, links):
    """The kernel of `Shapes.trace`."""
    n = len(origins)
    ts, primitives = np.empty(n), np.empty(n, np.int64)
    normals, uvs = np.zeros((n, 3)), np.zeros((n, 2))
    for j in range(n):
        o, d = origins[j], directions[j]
        t, i = nearest(
            o[0], o[1], o[2], d[0], d[1], d[2], np.inf, False, kind, params, centre, rotation, casts, lows, highs, links
        )
        ts[j], primitives[j] = t, i
        if i < 0:
            continue
        local = np.zeros(3)
        for a in range(3):
            for b in range(3):
                local[a] += rotation[i, a, b] * (o[b] + t * d[b] - centre[i, b])
        nx, ny, nz, u, v = _surface(
            kind[i], local[0], local[1], local[2], params[i, 0], params[i, 1], params[i, 2], params[i, 3]
        )
        facing = 0.0
        for a in range(3):
            normals[j, a] = rotation[i, 0, a] * nx + rotation[i, 1, a] * ny + rotation[i, 2, a] * nz
            facing += normals[j, a] * d[a]
        if facing > 0.0:
            normals[j] = -normals[j]
        uvs[j, 0], uvs[j, 1] = u, v
    return ts, primitives, normals, uvs
