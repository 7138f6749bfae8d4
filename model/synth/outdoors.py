"""Procedural places under an open sky: streets with facades, trees and posts, and single objects without surroundings.

A `VirtualScanner` scans a place with ``trace`` and ``ranges``; ``picture`` renders the true picture.  Pulses into the sky do
not return.  The light is a sun with hard shadows and skylight from above, so that no light has to be precomputed.
Frame: world metres, z up, the street along x, its floor at z = 0.
"""

import numpy as np

from ..common.linear_light import LUMINANCE, to_linear, to_srgb
from . import furniture as f
from .builder import Appearance, Builder
from .place import SKY, Hits, pixel_rays, tone
from .textures import Patch, albedo

_CHUNK = 1 << 18
"""Rays traced at a time, which limits the memory."""
_STONE = ("#b9a58c", "#a8745c", "#c7bda9", "#8f9aa0", "#d2c3a5", "#9c8f86")
_PAINT = ("#7a2e2a", "#2f4d66", "#c9b26a", "#3f5d45", "#e2ddd2", "#565a60")


class OpenPlace:
    """Shapes in sunlight.  sun (3,): direction towards it, normalised here; strength: irradiance / pi, linear."""

    def __init__(self, builder: Builder, sun: np.ndarray, strength: float = 1.1):
        self.shapes, self.finish = builder.finish()
        self.sun = np.asarray(sun, float) / np.linalg.norm(sun)
        self.strength = strength

    def ranges(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(N,) metres along each ray, inf where nothing is hit."""
        return self.shapes.trace(origins, directions)[0]

    def trace(self, origins: np.ndarray, directions: np.ndarray) -> Hits:
        """First hits of N rays.  origins, directions: (N,3), directions of unit length."""
        origins, directions = np.asarray(origins, np.float64), np.asarray(directions, np.float64)
        parts = [self._trace(origins[i : i + _CHUNK], directions[i : i + _CHUNK])
                 for i in range(0, max(len(origins), 1), _CHUNK)]
        return Hits(*(np.concatenate([getattr(p, name) for p in parts]) for name in Hits.__dataclass_fields__))

    def _trace(self, origins: np.ndarray, directions: np.ndarray) -> Hits:
        t, primitive, normal, uv = self.shapes.trace(origins, directions)
        missed = primitive < 0
        points = origins + np.where(missed, 0, t)[:, None] * directions
        which = np.where(missed, 0, primitive)
        local = np.einsum("nij,nj->ni", self.shapes.rotation[which], points - self.shapes.centre[which])
        look = self.finish
        patch = Patch(uv, local, look.half[which], look.colour[which], look.accent[which], look.seed[which])
        colour = albedo(look.material[which], patch)
        facing = np.maximum(normal @ self.sun, 0)
        asked = np.flatnonzero((facing > 0) & ~missed)
        blocked = self.ranges(points[asked] + 0.004 * normal[asked], np.broadcast_to(self.sun, (len(asked), 3)).copy())
        facing[asked] *= ~np.isfinite(blocked)
        sky = 0.35 + 0.25 * normal[:, 2:]
        light = self.strength * facing[:, None] * np.array([1.0, 0.95, 0.86]) + sky * np.array([0.86, 0.95, 1.1])
        radiance = colour * light
        radiance[missed] = SKY
        luminance = colour @ LUMINANCE
        shininess = np.where(missed, 0, look.shininess[which])
        return Hits(t, tone(radiance / 1.5), normal, shininess, np.where(missed, 1, 1 - luminance), primitive)

    def picture(self, camera_to_world: np.ndarray, fl: float, width: int, height: int, samples: int = 2):
        """The true picture from a camera.

        camera_to_world: (4,4), OpenGL axes; fl: focal length, pixels; the principal point is the picture's centre; samples:
        rays along each side of a pixel.  Returns rgb (H,W,3) uint8, the mean in linear light of the rays that hit a surface;
        depth (H,W) float32, view-space metres at pixel centres, inf in the sky; coverage (H,W) float32, the share of rays that
        hit.
        """
        light, hits = np.zeros((height * width, 3)), np.zeros(height * width)
        lens = (fl, fl, width / 2, height / 2, width, height)
        steps = [((i + 0.5) / samples, (j + 0.5) / samples) for i in range(samples) for j in range(samples)]
        for du, dv in steps:
            origins, rays, _ = pixel_rays(camera_to_world, *lens, du, dv)
            seen = self.trace(origins, rays)
            hit = seen.primitive >= 0
            light[hit] += to_linear(seen.rgb[hit])
            hits += hit
        origins, rays, cosine = pixel_rays(camera_to_world, *lens, 0.5, 0.5)
        depth = (self.ranges(origins, rays) * cosine).astype(np.float32).reshape(height, width)
        rgb = np.round(to_srgb(light / np.maximum(hits, 1)[:, None]) * 255).astype(np.uint8).reshape(height, width, 3)
        return rgb, depth, (hits / len(steps)).astype(np.float32).reshape(height, width)


def _outdoors(material: str, colour: str, accent: str = "#404040", shininess: float = 0.05) -> Appearance:
    return Appearance(material, colour, accent, shininess, outdoors=True)


def street(seed: int) -> OpenPlace:
    """A street between two rows of houses along x, with pavements, trees, posts, wires and parked vans; open at both ends."""
    rng = np.random.default_rng([31, seed])
    b = Builder(seed=seed)
    half, length = rng.uniform(4.0, 7.5), 44.0
    b.box((-length / 2, -half - 3, -0.3), (length / 2, half + 3, 0.0), _outdoors("tiles", "#8b8a86", "#77756f"))
    b.box((-length / 2, -half + 1.6, -0.2), (length / 2, half - 1.6, 0.02), _outdoors("plaster", "#5b5c5e", "#4c4d50"))
    for side in (-1, 1):
        x = -length / 2
        while x < length / 2 - 4:
            width, top, back = rng.uniform(5, 10), rng.uniform(4.5, 11), rng.uniform(0, 0.8)
            wall = _outdoors(str(rng.choice(["brick", "facade", "plaster"])), str(rng.choice(_STONE)), "#b9b2a6")
            low, high = sorted((side * (half + back), side * (half + back + 4)))
            b.box((x, low, -0.2), (x + width - 0.05, high, top), wall)
            _openings(b, rng, x, width, top, side, half + back)
            x += width
        for x in np.arange(-length / 2 + 3, length / 2 - 3, rng.uniform(6, 9)):
            _tree(b, rng, x + rng.uniform(-1, 1), side * (half - 1.0))
            b.rod((x + 2.5, side * (half - 1.3), 0), (x + 2.5, side * (half - 1.3), rng.uniform(0.9, 5.5)), 0.045,
                  _outdoors("plain", "#3c3f42", shininess=0.4))
    for _ in range(rng.integers(2, 5)):
        _van(b, rng, rng.uniform(-14, 14), rng.choice([-1, 1]) * (half - 2.7))
    for _ in range(rng.integers(1, 4)):  # wires from house to house
        x, z = rng.uniform(-12, 12), rng.uniform(4.0, 6.0)
        s = np.linspace(-1, 1, 9)
        b.cable(np.column_stack([x + 0.4 * s, half * s, z - 0.5 * (1 - s * s)]), 0.012, _outdoors("plain", "#202124"))
    azimuth, height = rng.uniform(0, 2 * np.pi), rng.uniform(0.5, 1.2)
    return OpenPlace(b, np.array([np.cos(azimuth) * np.cos(height), np.sin(azimuth) * np.cos(height), np.sin(height)]))


def _openings(b: Builder, rng: np.random.Generator, x: float, width: float, top: float, side: int, y: float) -> None:
    """Windows with frames and sills, and a door, on a wall at |y| that faces the street."""
    face = side * (y - 0.03)
    frame, pane = _outdoors("plain", str(rng.choice(_PAINT))), _outdoors("plain", "#39424a", shininess=0.7)
    count = max(1, int(width / rng.uniform(1.9, 2.8)))
    for storey, z in enumerate(np.arange(1.6, top - 1.0, 2.8)):
        for k in range(count):
            u = x + (k + 0.5) * width / count
            if storey == 0 and k == count // 2:
                b.box((u - 0.5, min(face, face - side * 0.06), 0), (u + 0.5, max(face, face - side * 0.06), 2.1), frame)
                continue
            b.quad((u, face - side * 0.004, z), (0.5 * side, 0, 0), (0, 0, 0.7), pane)
            for dx in (-0.5, 0.0, 0.5):
                b.rod((u + dx, face - side * 0.02, z - 0.7), (u + dx, face - side * 0.02, z + 0.7), 0.03, frame)
            near, far = sorted((face, face - side * 0.14))
            b.box((u - 0.6, near, z - 0.78), (u + 0.6, far, z - 0.7), frame)


def _tree(b: Builder, rng: np.random.Generator, x: float, y: float) -> None:
    """A trunk, branches, and clumps of leaves with gaps between them."""
    height, bark = rng.uniform(3.5, 6.5), _outdoors("wood", "#6a5642", "#46382b")
    b.rod((x, y, 0), (x, y, 0.55 * height), 0.13, bark, end=0.08)
    greens = [_outdoors("foliage", colour, "#1f2f1a") for colour in ("#4b6b3a", "#57793f", "#6b7d3c")]
    for _ in range(int(rng.integers(30, 70))):
        way = rng.normal(size=3) * (0.9, 0.9, 0.55)
        spot = np.array([x, y, 0.72 * height]) + way * height * 0.24
        b.rod((x, y, 0.5 * height), spot, 0.03, bark, end=0.008)
        b.ball(spot, rng.uniform(0.08, 0.3, 3), greens[rng.integers(3)])


def _van(b: Builder, rng: np.random.Generator, x: float, y: float) -> None:
    """A parked van: body, cabin and wheels."""
    paint, dark = _outdoors("plain", str(rng.choice(_PAINT)), shininess=0.5), _outdoors("plain", "#23262a", shininess=0.5)
    long, high = rng.uniform(3.6, 5.2), rng.uniform(1.3, 2.2)
    b.cushion((x, y, 0.35 + high / 2), (long / 2, 0.85, high / 2), 0.15, paint)
    b.cushion((x + long / 2 + 0.3, y, 0.75), (0.5, 0.8, 0.4), 0.12, paint)
    b.quad((x, y - 0.856, 0.4 + 0.7 * high), (long * 0.35, 0, 0), (0, 0, 0.2 * high), dark)
    for dx in (-0.35, 0.35):
        for dy in (-0.8, 0.8):
            b.rod((x + dx * long, y + dy - 0.1, 0.33), (x + dx * long, y + dy + 0.1, 0.33), 0.33, dark)


def single_object(seed: int) -> OpenPlace:
    """One object up to two metres in size, without ground or surroundings: furniture, a plant, pipework, or a heap of
    solids."""
    rng = np.random.default_rng([37, seed])
    b = Builder(seed=seed)
    kind = seed % 5
    material = str(rng.choice(["wood", "plain", "plaster", "weave", "brick"]))
    look = Appearance(material, str(rng.choice(_STONE)), str(rng.choice(_PAINT)), 0.2)
    if kind == 0:
        f.chair(b, f.OAK, look)
    elif kind == 1:
        f.table(b, rng.uniform(1.0, 1.8), rng.uniform(0.6, 0.9))
        with b.at(0.9, 0.2, 0, rng.uniform(0, 360)):
            f.chair(b, f.BLACK, look)
    elif kind == 2:
        f.plant(b, rng, height=rng.uniform(0.8, 1.8))
    elif kind == 3:
        _pipework(b, rng, look)
    else:
        for _ in range(int(rng.integers(8, 22))):
            spot, size = rng.normal(size=3) * (0.25, 0.25, 0.35) + (0, 0, 0.7), rng.uniform(0.06, 0.28, 3)
            b.ball(spot, size, look) if rng.random() < 0.6 else b.cushion(spot, size, 0.03, look)
    return OpenPlace(b, rng.normal(size=3) + (0, 0, 1.5), 0.9)


def _pipework(b: Builder, rng: np.random.Generator, look: Appearance) -> None:
    """A motor on a base, with pipes and flanges."""
    metal = Appearance("plain", str(rng.choice(_PAINT)), "#404040", 0.4)
    b.rod((-0.5, 0, 0.4), (0.3, 0, 0.4), rng.uniform(0.14, 0.24), metal)
    b.box((-0.6, -0.25, 0.0), (0.6, 0.25, 0.12), look)
    at = np.array([0.3, 0.0, 0.4])
    for _ in range(int(rng.integers(5, 11))):
        step = np.zeros(3)
        step[rng.integers(3)] = rng.choice([-1, 1]) * rng.uniform(0.2, 0.6)
        radius = rng.uniform(0.015, 0.06)
        b.capsule(at, at + step, radius, metal)
        b.rod(at + 0.45 * step, at + 0.5 * step, 1.9 * radius, look)
        at = np.clip(at + step, (-0.9, -0.9, 0.1), (0.9, 0.9, 1.5))
