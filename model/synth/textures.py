"""Materials: procedural albedo at hit points.

A material is a function of a `Patch`, the hits on the primitives of that material.  It returns the albedo (N,3), linear 0..1.
"""

from dataclasses import dataclass

import numpy as np

from ..common.linear_light import to_linear
from . import prints


@dataclass(frozen=True)
class Patch:
    """N hits.

    uv (N,2): on the face hit; local (N,3): in the primitive's local frame, from its centre; half (N,3): half extents; all in
    metres.  colour, accent (N,3): linear.  seed (N,) int64.
    """

    uv: np.ndarray
    local: np.ndarray
    half: np.ndarray
    colour: np.ndarray
    accent: np.ndarray
    seed: np.ndarray


def _hash(*values: np.ndarray) -> np.ndarray:
    """Hash of integers, elementwise, as a uniform number in [0, 1)."""
    state = np.zeros(np.broadcast(*values).shape, np.uint64)
    for value in values:
        state = (state ^ np.asarray(value).astype(np.int64).astype(np.uint64)) * np.uint64(0x9E3779B97F4A7C15)
        state ^= state >> np.uint64(29)
        state *= np.uint64(0xBF58476D1CE4E5B9)
        state ^= state >> np.uint64(32)
    return (state >> np.uint64(40)).astype(np.float64) / float(1 << 24)


def noise(x: np.ndarray, y: np.ndarray, seed: np.ndarray) -> np.ndarray:
    """(N,) smooth value noise, 0..1, with lattice cells of side 1."""
    i, j = np.floor(x), np.floor(y)
    fx, fy = x - i, y - j
    fx, fy = fx * fx * (3 - 2 * fx), fy * fy * (3 - 2 * fy)
    a, b = _hash(i, j, seed), _hash(i + 1, j, seed)
    c, d = _hash(i, j + 1, seed), _hash(i + 1, j + 1, seed)
    return (a * (1 - fx) + b * fx) * (1 - fy) + (c * (1 - fx) + d * fx) * fy


def fractal(x: np.ndarray, y: np.ndarray, seed: np.ndarray, octaves: int = 3) -> np.ndarray:
    """(N,) sum of `noise` over octaves, about -1..1, mean 0."""
    total = np.zeros(np.shape(x))
    for k in range(octaves):
        total += (noise(x * 2**k, y * 2**k, seed + 17 * k) - 0.5) * 2 * 0.5**k
    return total


def _mix(a: np.ndarray, b: np.ndarray, share: np.ndarray) -> np.ndarray:
    return a + (b - a) * np.clip(share, 0, 1)[:, None]


def _edge(distance: np.ndarray, width: float) -> np.ndarray:
    """1 inside (distance < 0), 0 outside, with a linear ramp ``width`` metres wide around 0."""
    return np.clip(0.5 - distance / width, 0, 1)


def plain(p: Patch) -> np.ndarray:
    """Paint, plastic, metal: one colour with little variation."""
    return p.colour * (1 + 0.03 * fractal(p.uv[:, 0] * 9, p.uv[:, 1] * 9, p.seed, 2))[:, None]


def plaster(p: Patch) -> np.ndarray:
    """Painted plaster: slow variation in brightness, and the grain of a paint roller."""
    u, v = p.uv.T
    tone = 1 + 0.035 * fractal(u * 1.3, v * 1.3, p.seed) + 0.014 * fractal(u * 45, v * 45, p.seed + 5, 2)
    return p.colour * tone[:, None]


def wood(p: Patch) -> np.ndarray:
    """Furniture wood with its grain along the longest side of the primitive."""
    rows = np.arange(len(p.uv))
    axis = p.half.argmax(1)
    along = p.local[rows, axis]
    a, b = p.local[rows, (axis + 1) % 3], p.local[rows, (axis + 2) % 3]
    across = a + 0.7 * b + 0.012 * fractal(along * 3, a * 4, p.seed + 3, 2)
    rings = np.sin(across * 160 + 5 * noise(along, a * 5, p.seed))
    grain = 0.5 * fractal(along * 2.5, across * 70, p.seed) + 0.5 * rings
    return _mix(p.colour, p.accent, 0.5 + 0.42 * grain)


def planks(p: Patch) -> np.ndarray:
    """Floor boards, 14 cm wide and 1.4 m long along u, with different brightness and grain."""
    u, v = p.uv.T
    row = np.floor(v / 0.14)
    shifted = u / 1.4 + _hash(row, p.seed)
    board = np.floor(shifted)
    number = row * 131 + board
    tone = _hash(number, p.seed + 1)
    wave = v + 0.01 * fractal(u * 2 + 9 * tone, v * 6, p.seed + 2, 2)
    grain = fractal(u * 3 + 50 * tone, wave * 60, p.seed + 3)
    rings = np.sin(wave * 210 + 30 * tone + 2.5 * noise(u * 1.2 + 30 * tone, v * 5, p.seed))
    albedo = _mix(p.colour, p.accent, 0.12 + 0.62 * tone + 0.2 * grain + 0.07 * rings)
    gap = np.minimum(np.abs((v / 0.14 + 0.5) % 1 - 0.5) * 0.14, np.abs((shifted + 0.5) % 1 - 0.5) * 1.4)
    return albedo * (1 - 0.72 * _edge(gap - 0.0022, 0.002))[:, None]


def brick(p: Patch) -> np.ndarray:
    """Bricks in running bond, 24 x 7.5 cm with 1 cm of mortar, which has the accent colour."""
    u, v = p.uv.T
    row = np.floor(v / 0.075)
    x = u / 0.24 + 0.5 * (row % 2)
    column = np.floor(x)
    du, dv = np.abs((x % 1) - 0.5) * 0.24, np.abs((v / 0.075) % 1 - 0.5) * 0.075
    wobble = 0.0035 * fractal(u * 30, v * 30, p.seed, 2)
    distance = np.maximum(du - 0.115, dv - 0.0325) + wobble
    tone, warm = _hash(row, column, p.seed), _hash(row, column, p.seed + 1)
    face = p.colour * (0.62 + 0.7 * tone)[:, None] * (1 + (warm - 0.5)[:, None] * np.array([0.1, 0.0, -0.16]))
    face = face * (1 + 0.2 * fractal(u * 55, v * 55, p.seed + 2))[:, None]
    mortar = p.accent * (1 + 0.12 * fractal(u * 70, v * 70, p.seed + 3, 2))[:, None]
    return _mix(mortar, face, _edge(distance, 0.003))


def tiles(p: Patch) -> np.ndarray:
    """Cement tiles, 20 cm, with quarter arcs and a diamond in the accent colour, and grey grout."""
    u, v = p.uv.T
    a, b = (u / 0.2) % 1 - 0.5, (v / 0.2) % 1 - 0.5
    ring = np.hypot(np.abs(a) - 0.5, np.abs(b) - 0.5)
    ink = np.maximum(_edge(np.abs(ring - 0.37) - 0.055, 0.02), _edge(np.abs(a) + np.abs(b) - 0.15, 0.02))
    ink = np.maximum(ink, _edge(ring - 0.16, 0.02))
    each = _hash(np.floor(u / 0.2), np.floor(v / 0.2), p.seed)
    tone = 1 + 0.12 * (each - 0.5) + 0.03 * fractal(u * 40, v * 40, p.seed)
    albedo = _mix(p.colour, p.accent, ink) * tone[:, None]
    grout = _edge(0.49 - np.maximum(np.abs(a), np.abs(b)), 0.006)
    return _mix(albedo, np.full_like(albedo, 0.3), grout)


def weave(p: Patch) -> np.ndarray:
    """Upholstery: a coarse weave with a period of 1.6 cm and irregular threads."""
    u, v = p.uv.T
    check = np.sin(u * 390) * np.sin(v * 390)
    slub = fractal(u * 25, v * 160, p.seed, 2) + fractal(u * 160, v * 25, p.seed + 1, 2)
    return _mix(p.colour, p.accent, 0.3 + 0.16 * check + 0.2 * slub)


def stripes(p: Patch) -> np.ndarray:
    """Striped cloth for cushions: bands of 5 cm with a thin line between them."""
    v = p.uv[:, 1] + 0.002 * fractal(p.uv[:, 0] * 20, p.uv[:, 1] * 20, p.seed, 2)
    band = np.abs((v / 0.1) % 1 - 0.5)
    share = np.maximum(_edge(0.25 - band, 0.02), 0.8 * _edge(np.abs(band - 0.12) - 0.02, 0.01))
    return _mix(p.colour, p.accent, share) * (1 + 0.05 * np.sin(p.uv[:, 0] * 500))[:, None]


def rug(p: Patch) -> np.ndarray:
    """A patterned rug: stepped diamonds within a chequered border; the third colour is cream."""
    x, y = p.local[:, 0], p.local[:, 1]
    hx, hy = p.half[:, 0], p.half[:, 1]
    q = 0.015
    x, y = (np.floor(x / q) + 0.5) * q, (np.floor(y / q) + 0.5) * q  # knots
    inset = np.minimum(hx - np.abs(x), hy - np.abs(y))
    cream = np.broadcast_to(to_linear([0.86, 0.8, 0.68]), p.colour.shape)
    diamond = np.abs((x / 0.48) % 1 - 0.5) + np.abs((y / 0.48) % 1 - 0.5)
    ring = np.floor(diamond * 9)
    albedo = np.where((ring % 3 == 0)[:, None], p.accent, np.where((ring % 3 == 1)[:, None], p.colour, cream))
    albedo = np.where((diamond < 0.17)[:, None], np.where((diamond < 0.09)[:, None], p.colour * 0.35, cream), albedo)
    checker = ((np.floor(x / 0.06) + np.floor(y / 0.06)) % 2).astype(bool)
    border = np.where(checker[:, None], p.colour * 0.55, cream)
    albedo = np.where((inset < 0.16)[:, None], border, albedo)
    albedo = np.where(((inset < 0.04) | ((inset > 0.16) & (inset < 0.2)))[:, None], p.accent * 0.7, albedo)
    u, v = p.uv.T
    pile = 0.86 + 0.14 * fractal(u * 4, v * 4, p.seed) + 0.14 * fractal(u * 130, v * 130, p.seed)
    return albedo * pile[:, None]


def foliage(p: Patch) -> np.ndarray:
    """A clipped hedge: clumps of leaves with dark gaps."""
    u, v = p.local[:, 0] + 0.6 * p.local[:, 1], p.local[:, 2] + 0.3 * p.local[:, 1]
    clump = 0.55 + 0.5 * fractal(u * 14, v * 14, p.seed) + 0.35 * fractal(u * 45, v * 45, p.seed + 9, 2)
    return _mix(p.accent, p.colour * 1.25, clump)


def paper(p: Patch) -> np.ndarray:
    """A paper lantern: thin ribs around z, 3 cm apart."""
    rib = _edge(np.abs((p.local[:, 2] / 0.03) % 1 - 0.5) - 0.06, 0.06)
    return _mix(p.colour, p.accent, rib)


def leaf(p: Patch) -> np.ndarray:
    """A leaf: a lighter midrib along x, veins, and different brightness for each leaf."""
    x, y = p.local[:, 0], p.local[:, 1]
    tone = 0.75 + 0.5 * _hash(p.seed, p.seed + 1)
    side = _edge(np.abs(((x - np.abs(y)) / 0.022) % 1 - 0.5) - 0.06, 0.06)
    vein = np.maximum(_edge(np.abs(y) - 0.002, 0.002), 0.35 * side)
    return _mix(p.colour * tone[:, None], p.accent, vein)


def _printed(p: Patch, draw, u: np.ndarray, v: np.ndarray) -> np.ndarray:
    """(N,3) colours of the image ``draw(seed)`` of each hit's primitive, at u, v (N,)."""
    out = np.empty((len(u), 3))
    order = np.argsort(p.seed, kind="stable")
    starts = np.flatnonzero(np.diff(p.seed[order], prepend=-1))
    for start, stop in zip(starts, [*starts[1:], len(order)]):
        members = order[start:stop]
        out[members] = prints.sample(draw(int(p.seed[members[0]])), u[members], v[members])
    return out


def poster(p: Patch) -> np.ndarray:
    """A poster on a quad: local x to the right, y up."""
    return _printed(p, prints.poster, p.local[:, 0] / p.half[:, 0] / 2 + 0.5, 0.5 - p.local[:, 1] / p.half[:, 1] / 2)


def page(p: Patch) -> np.ndarray:
    """A magazine page on the top of a box or on a quad: local x to the right, y up."""
    return _printed(p, prints.page, p.local[:, 0] / p.half[:, 0] / 2 + 0.5, 0.5 - p.local[:, 1] / p.half[:, 1] / 2)


def book(p: Patch) -> np.ndarray:
    """A book upright along z with its spine at +x: printed spine, cloth boards, and cream pages on the other sides."""
    x, y, z = p.local.T
    spine = p.half[:, 0] - x < 1e-3
    board = p.half[:, 1] - np.abs(y) < 1e-3
    out = _printed(p, prints.spine, 0.5 + 0.5 * y / p.half[:, 1], 0.5 - 0.5 * z / p.half[:, 2])
    cloth = _printed(p, prints.spine, np.full(len(x), 0.02), np.full(len(x), 0.5))
    pages = to_linear([0.88, 0.84, 0.74]) * (0.85 + 0.15 * np.sin(y * 3000))[:, None]
    inner = (~spine & ~board & (p.half[:, 1] - np.abs(y) > 0.0025))[:, None]
    return np.where(spine[:, None], out, np.where(inner, pages, cloth))


def carton(p: Patch) -> np.ndarray:
    """A cardboard box: corrugation, a strip of tape over the top, and printed labels on the sides +y and -y."""
    x, y, z = p.local.T
    base = p.colour * (1 + 0.06 * fractal(p.uv[:, 0] * 8, p.uv[:, 1] * 30, p.seed))[:, None]
    tape = (np.abs(y) < 0.03) & ((p.half[:, 2] - np.abs(z) < 1e-3) | (z > p.half[:, 2] - 0.08))
    label = (p.half[:, 1] - np.abs(y) < 1e-3) & (np.abs(x) < 0.4 * p.half[:, 0]) & (np.abs(z) < 0.45 * p.half[:, 2])
    u, v = x / p.half[:, 0] / 0.8 + 0.5, 0.5 - z / p.half[:, 2] / 0.9
    out = _mix(base, p.accent, 0.75 * tape)
    return np.where(label[:, None], _printed(p, prints.page, np.clip(u, 0, 1), np.clip(v, 0, 1)), out)


def facade(p: Patch) -> np.ndarray:
    """A house: brick with rows of windows in pale surrounds."""
    u, v = p.uv.T
    a, b = np.abs((u / 2.2) % 1 - 0.5) * 2.2, np.abs(((v + 0.2) / 2.8) % 1 - 0.5) * 2.8
    wall = brick(p)
    surround = np.maximum(a - 0.62, b - 0.92)
    pane = np.maximum(a - 0.5, b - 0.8)
    bars = np.minimum(a, np.abs(b - 0.27)) < 0.035
    glass = np.array([0.12, 0.16, 0.2]) * (1 + 0.8 * fractal(u * 0.7, v * 0.9, p.seed))[:, None]
    out = _mix(wall, np.full_like(wall, 0.72), _edge(surround, 0.01))
    return np.where((pane < 0)[:, None], np.where(bars[:, None], 0.7, glass), out)


MATERIALS = {
    f.__name__: f
    for f in (
        plain, plaster, wood, planks, brick, tiles, weave, stripes, rug, foliage, paper, leaf, poster, page, book,
        carton, facade,
    )
}
NAMES = list(MATERIALS)
"""Names of the materials; a material's number is its index here."""


def albedo(material: np.ndarray, patch: Patch) -> np.ndarray:
    """(N,3) linear albedo, 0.01..0.92.  material: (N,) index into `NAMES`."""
    out = np.zeros((len(material), 3))
    for number, name in enumerate(NAMES):
        at = np.flatnonzero(material == number)
        if len(at):
            part = Patch(*(getattr(patch, f)[at] for f in Patch.__dataclass_fields__))
            out[at] = MATERIALS[name](part)
    return np.clip(out, 0.01, 0.92)
