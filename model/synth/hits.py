"""First intersection of a ray with one primitive, in the primitive's local frame; used by :mod:`model.synth.shapes`.

Rays have origin o, metres, and direction d, of unit length; t is the distance along the ray, metres.
"""

import numpy as np

from ..common.jit import compiled

EPSILON = 1e-6
"""Metres.  Nearer hits are ignored as the surface from which the ray starts: far above the rounding errors of float64 within
a room, 1e-15."""


@compiled(nogil=True)
def box_span(ox, oy, oz, dx, dy, dz, hx, hy, hz):
    """(near, far) distances at which a ray enters and leaves the box |x| <= hx, |y| <= hy, |z| <= hz; near > far if it
    misses."""
    near, far = -np.inf, np.inf
    for axis in range(3):
        o, d, h = (ox, dx, hx) if axis == 0 else ((oy, dy, hy) if axis == 1 else (oz, dz, hz))
        if d == 0.0:
            if abs(o) > h:
                return np.inf, -np.inf
        else:
            a, b = (-h - o) / d, (h - o) / d
            near, far = max(near, min(a, b)), min(far, max(a, b))
    return near, far


@compiled(nogil=True)
def hit_tube(ox, oy, oz, dx, dy, dz, r0, r1, h, caps):
    """First t > EPSILON on the side of a cone frustum and, if ``caps`` > 0, on its end discs; inf if it misses."""
    best = np.inf
    m, k = 0.5 * (r0 + r1), 0.5 * (r1 - r0) / h
    w, g = m + k * oz, k * dz
    a = dx * dx + dy * dy - g * g
    b = ox * dx + oy * dy - w * g
    c = ox * ox + oy * oy - w * w
    disc = b * b - a * c
    if disc >= 0.0 and abs(a) > 1e-15:
        root = np.sqrt(disc)
        for sign in (-1.0, 1.0):
            t = (-b + sign * root) / a
            if EPSILON < t < best and abs(oz + t * dz) <= h:
                best = t
    if caps > 0.0 and dz != 0.0:
        for end in (-1.0, 1.0):
            t = (end * h - oz) / dz
            r = r0 if end < 0.0 else r1
            if EPSILON < t < best and (ox + t * dx) ** 2 + (oy + t * dy) ** 2 <= r * r:
                best = t
    return best


@compiled(nogil=True)
def hit_ellipsoid(ox, oy, oz, dx, dy, dz, rx, ry, rz):
    """First t > EPSILON on an ellipsoid; inf if it misses."""
    ox, oy, oz, dx, dy, dz = ox / rx, oy / ry, oz / rz, dx / rx, dy / ry, dz / rz
    a, b, c = dx * dx + dy * dy + dz * dz, ox * dx + oy * dy + oz * dz, ox * ox + oy * oy + oz * oz - 1.0
    disc = b * b - a * c
    if disc < 0.0:
        return np.inf
    root = np.sqrt(disc)
    if (-b - root) / a > EPSILON:
        return (-b - root) / a
    return (-b + root) / a if (-b + root) / a > EPSILON else np.inf


@compiled(nogil=True)
def hit_round(ox, oy, oz, dx, dy, dz, hx, hy, hz, r):
    """First t on a rounded box, by sphere tracing within the box without rounding; inf if it misses."""
    near, far = box_span(ox, oy, oz, dx, dy, dz, hx, hy, hz)
    t = max(near, EPSILON)
    for _ in range(96):
        if not t < far:
            break
        qx = max(abs(ox + t * dx) - hx + r, 0.0)
        qy = max(abs(oy + t * dy) - hy + r, 0.0)
        qz = max(abs(oz + t * dz) - hz + r, 0.0)
        gap = np.sqrt(qx * qx + qy * qy + qz * qz) - r
        if gap < 2e-5:
            return t
        t += gap
    return np.inf


@compiled(nogil=True)
def hit_quad(ox, oy, oz, dx, dy, dz, hx, hy, outline):
    """t where the ray passes the plane z = 0 within the outline (see :mod:`model.synth.shapes`); inf if it misses."""
    if dz == 0.0 or -oz / dz <= EPSILON:
        return np.inf
    t = -oz / dz
    x, y = (ox + t * dx) / hx, (oy + t * dy) / hy
    if outline == 1.0:
        inside = x * x + y * y <= 1.0
    elif outline == 2.0:
        inside = abs(x) <= 1.0 and abs(y) <= 1.0 - x * x
    else:
        inside = abs(x) <= 1.0 and abs(y) <= 1.0
    return t if inside else np.inf
