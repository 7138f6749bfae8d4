"""A furnished place: ray hits with colours, and rendered pictures, which are the ground truth for pictures of a scan.

Frame: world metres, z up.  Colours are returned as sRGB 0..1, after a fixed exposure and a tone curve.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..common.linear_light import LUMINANCE, to_linear, to_srgb
from .light import Lighting
from .rooms import DEPTH, HEIGHT, PARTING, WIDTH, furnish
from .textures import Patch, albedo

EXPOSURE = 1.5
"""Gain of the camera, linear light.  This and the colours below are of an invented place."""
SKY = np.array([0.95, 1.0, 1.08])
"""Radiance of the sky at the horizon, linear RGB."""
STREET_LIGHT = np.array([0.92, 0.97, 1.05]) * 1.15
"""Irradiance / pi of outdoor surfaces, linear RGB."""
_CHUNK = 1 << 18
"""Rays traced at a time, which limits the memory."""


@dataclass(frozen=True)
class Hits:
    """First hits of N rays.

    t (N,): metres along the ray, inf without a hit.  rgb (N,3): sRGB 0..1.  normal (N,3): unit, towards the ray's origin, 0
    without a hit.  shininess (N,): 0 matt .. 1 mirror.  darkness (N,): 1 - luminance of the albedo.  primitive (N,) int64:
    index of the primitive, -1 without a hit.
    """

    t: np.ndarray
    rgb: np.ndarray
    normal: np.ndarray
    shininess: np.ndarray
    darkness: np.ndarray
    primitive: np.ndarray


def tone(radiance: np.ndarray) -> np.ndarray:
    """Linear radiance to sRGB 0..1: exposure, then a tone curve that compresses values above 0.6, so that windows rarely
    clip."""
    x = np.maximum(radiance * EXPOSURE, 0)
    knee = 0.6
    over = np.maximum(x - knee, 0)
    return to_srgb(np.where(x > knee, knee + (1 - knee) * (1 - np.exp(-over / (1 - knee))), x))


class Place:
    """Two furnished rooms.  The same ``seed`` gives exactly the same place.

    probe_rays: rays per probe of the indirect light, which takes about 3 s; 0 omits it, if only geometry is needed.
    """

    def __init__(self, seed: int = 1, *, probe_rays: int = 48):
        self.seed = seed
        builder, lights = furnish(seed)
        self.shapes, self.finish = builder.finish()
        rooms = [((0, 0, 0), (PARTING[0], DEPTH, HEIGHT)), ((PARTING[1], 0, 0), (WIDTH, DEPTH, HEIGHT))]
        self.lighting = Lighting(self.shapes, lights, [(np.array(a), np.array(b)) for a, b in rooms], sum(PARTING) / 2)
        if probe_rays:
            self.lighting.bake(self._surface, probe_rays, seed=seed)

    def ranges(self, origins: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(N,) metres along each ray, inf without a hit: `trace` without colours."""
        return self.shapes.trace(origins, directions)[0]

    def trace(self, origins: np.ndarray, directions: np.ndarray, step: Callable[[int], object] | None = None) -> Hits:
        """First hits of N rays.  origins, directions: (N,3) float64 world, directions of unit length.

        step: called after every chunk with the number of its rays.
        """
        origins, directions = np.asarray(origins, np.float64), np.asarray(directions, np.float64)
        parts = []
        for i in range(0, max(len(origins), 1), _CHUNK):
            parts.append(self._trace(origins[i : i + _CHUNK], directions[i : i + _CHUNK]))
            if step is not None:
                step(len(parts[-1].t))
        return Hits(*(np.concatenate([getattr(p, name) for p in parts]) for name in Hits.__dataclass_fields__))

    def _trace(self, origins, directions) -> Hits:
        t, primitive, normal, uv = self.shapes.trace(origins, directions)
        missed = primitive < 0
        points = origins + np.where(missed, 0, t)[:, None] * directions
        colour, glow, lit = self._surface(t, primitive, uv, points)
        light = self.lighting.irradiance(points, normal, lit)
        light[self.finish.outdoors[primitive] & ~missed] = STREET_LIGHT
        radiance = colour * light + glow
        radiance[missed] = SKY * (1.0 + 0.25 * directions[missed, 2:])
        luminance = colour @ LUMINANCE
        shininess = np.where(missed, 0, self.finish.shininess[primitive])
        return Hits(t, tone(radiance), normal, shininess, np.where(missed, 1, 1 - luminance), primitive)

    def _surface(self, t, primitive, uv, points):
        """Albedo (N,3), emitted radiance (N,3), and whether the lights of the rooms illuminate it (N,) bool, at N hits."""
        hit = primitive >= 0
        which = np.where(hit, primitive, 0)
        offset = points - self.shapes.centre[which]
        local = np.einsum("nij,nj->ni", self.shapes.rotation[which], offset)
        look = self.finish
        patch = Patch(uv, local, look.half[which], look.colour[which], look.accent[which], look.seed[which])
        colour = albedo(look.material[which], patch)
        glow = look.glow[which] * hit[:, None] * np.clip(colour / np.maximum(look.colour[which], 0.02), 0, 1)
        return colour, glow, hit & ~look.outdoors[which]

    def render(self, camera_to_world, fx, fy, cx, cy, width: int, height: int, *, samples: int = 2):
        """The true picture from a pinhole camera.

        camera_to_world: (4,4) OpenGL axes; fx, fy, cx, cy: pixels, pixel centres at +0.5; samples: rays along each side of a
        pixel for the colour, averaged in linear light.  Returns rgb (H,W,3) uint8 and depth (H,W) float32, view-space metres at
        pixel centres, inf without a hit.
        """
        total = np.zeros((height * width, 3))
        for i in range(samples):
            for j in range(samples):
                origins, rays, _ = pixel_rays(
                    camera_to_world, fx, fy, cx, cy, width, height, (i + 0.5) / samples, (j + 0.5) / samples
                )
                total += to_linear(self.trace(origins, rays).rgb)
        origins, rays, cosine = pixel_rays(camera_to_world, fx, fy, cx, cy, width, height, 0.5, 0.5)
        depth = (self.ranges(origins, rays) * cosine).astype(np.float32).reshape(height, width)
        rgb = np.round(to_srgb(total / samples**2) * 255).astype(np.uint8).reshape(height, width, 3)
        return rgb, depth


def pixel_rays(camera_to_world, fx, fy, cx, cy, width, height, du, dv):
    """Origins (N,3), unit directions (N,3) and cosines to the view axis (N,) through (column + du, row + dv)."""
    column, row = np.meshgrid(np.arange(width) + du, np.arange(height) + dv)
    rays = np.stack([(column - cx) / fx, -(row - cy) / fy, -np.ones_like(column)], -1).reshape(-1, 3)
    length = np.linalg.norm(rays, axis=1)
    matrix = np.asarray(camera_to_world, np.float64)
    directions = (rays / length[:, None]) @ matrix[:3, :3].T
    return np.broadcast_to(matrix[:3, 3], directions.shape).copy(), directions, 1 / length
