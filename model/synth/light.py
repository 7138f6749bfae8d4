"""Lighting of a place: direct light of windows, sun and lamps with soft shadows; indirect light from a grid of probes.

Frame: world metres.  Radiometry is in arbitrary linear units, three channels; a surface's radiance is its albedo times
the irradiance / pi that `Lighting.irradiance` returns.
"""

from dataclasses import dataclass

import numpy as np

from ..common.jit import compiled
from ..common.process.processors import in_slices
from ..common.process.signals import uninterrupted
from .shapes import Shapes, nearest, one_hit

WINDOW, LAMP, SUN = range(3)
AMBIENT_REACH = 0.45
"""Radius, metres, of the ambient occlusion: nearer surfaces darken the indirect light: part of the rooms' look."""
_CUBE = np.vstack([np.eye(3), -np.eye(3)])
"""(6, 3) directions of a probe's values: +x, +y, +z, -x, -y, -z."""


@dataclass(frozen=True)
class Lights:
    """L lights.

    kind (L,): WINDOW, LAMP or SUN.  position (L,3): centre, metres; of the sun the unit direction towards it.  side_u, side_v
    (L,3): vectors of half a window's sides, metres.  radius (L,): of a lamp, metres; of the sun, radians.  power (L,3): linear
    RGB.  samples (L,) int64: shadow rays per point.
    """

    kind: np.ndarray
    position: np.ndarray
    side_u: np.ndarray
    side_v: np.ndarray
    radius: np.ndarray
    power: np.ndarray
    samples: np.ndarray

    def arrays(self) -> tuple[np.ndarray, ...]:
        return (self.kind, self.position, self.side_u, self.side_v, self.radius, self.power, self.samples)


@compiled(nogil=True)
def _random(state):
    """One step of SplitMix64: (new state, uniform number in [0, 1))."""
    state = state + np.uint64(0x9E3779B97F4A7C15)
    x = state
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    x = x ^ (x >> np.uint64(31))
    return state, float(x >> np.uint64(11)) * (1.0 / 9007199254740992.0)


@compiled(nogil=True)
def light_points(
    points, normals, lit, ambient_samples, kind, position, side_u, side_v, radius, power, samples,
    s_kind, s_params, s_centre, s_rotation, s_casts, s_lows, s_highs, s_links,
):
    """Direct irradiance / pi (N,3) and ambient visibility (N,), 0 occluded to 1 open, at N surface points.

    The jitter of a point's samples is a hash of its position, so that a point has the same light in every picture.
    """
    n = len(points)
    direct, openness = np.zeros((n, 3)), np.ones(n)
    shaded = np.full(len(kind), -1)  # for each light, the last primitive that occluded it
    for j in range(n):
        if not lit[j]:
            continue
        nx, ny, nz = normals[j, 0], normals[j, 1], normals[j, 2]
        x, y, z = points[j, 0] + 1e-3 * nx, points[j, 1] + 1e-3 * ny, points[j, 2] + 1e-3 * nz
        state = (
            np.uint64(np.int64(x * 1e5)) * np.uint64(0x9E3779B1)
            ^ np.uint64(np.int64(y * 1e5)) * np.uint64(0x85EBCA77C2B2AE63)
            ^ np.uint64(np.int64(z * 1e5)) * np.uint64(0xC2B2AE3D27D4EB4F)
        )
        state, shift_a = _random(state)
        state, shift_b = _random(state)
        for light in range(len(kind)):
            total, count = 0.0, samples[light]
            for s in range(count):
                # A rank-1 lattice, shifted per point: few samples cover the light evenly.
                a = (s * 0.7548776662466927 + shift_a) % 1.0
                b = (s * 0.5698402909980532 + shift_b) % 1.0
                if kind[light] == SUN:
                    r, phi = radius[light] * np.sqrt(a), 6.283185307179586 * b
                    dx = position[light, 0] + r * np.cos(phi)
                    dy = position[light, 1]
                    dz = position[light, 2] + r * np.sin(phi)
                    gain, reach = 1.0, 7.0  # metres; farther objects are the view out of the window
                elif kind[light] == LAMP:
                    cz, phi = 2.0 * a - 1.0, 6.283185307179586 * b
                    rho = radius[light] * np.sqrt(max(0.0, 1.0 - cz * cz))
                    dx = position[light, 0] + rho * np.cos(phi) - x
                    dy = position[light, 1] + rho * np.sin(phi) - y
                    dz = position[light, 2] + radius[light] * cz - z
                    gain = 1.0 / max(dx * dx + dy * dy + dz * dz, 0.02)
                    reach = np.sqrt(dx * dx + dy * dy + dz * dz)
                else:
                    a, b = 2.0 * a - 1.0, 2.0 * b - 1.0
                    dx = position[light, 0] + a * side_u[light, 0] + b * side_v[light, 0] - x
                    dy = position[light, 1] + a * side_u[light, 1] + b * side_v[light, 1] - y
                    dz = position[light, 2] + a * side_u[light, 2] + b * side_v[light, 2] - z
                    # Windows lie in planes y = constant and shine towards -y.
                    reach = np.sqrt(dx * dx + dy * dy + dz * dz)
                    gain = max(dy, 0.0) / max(reach, 0.1) ** 3
                length = np.sqrt(dx * dx + dy * dy + dz * dz)
                if length < 1e-9:
                    continue
                dx, dy, dz = dx / length, dy / length, dz / length
                facing = dx * nx + dy * ny + dz * nz
                if facing <= 0.0 or gain * facing < 2e-4:
                    continue
                # The occluder of the last point is likely to occlude this one too.
                before = shaded[light]
                if before >= 0 and one_hit(before, x, y, z, dx, dy, dz, s_kind, s_params, s_centre, s_rotation) < reach:
                    continue
                t, hit = nearest(
                    x, y, z, dx, dy, dz, reach, True,
                    s_kind, s_params, s_centre, s_rotation, s_casts, s_lows, s_highs, s_links,
                )
                if hit < 0:
                    total += gain * facing
                else:
                    shaded[light] = hit
            for c in range(3):
                direct[j, c] += power[light, c] * total / count
        if ambient_samples == 0:
            continue
        # Tangent frame for cosine-weighted directions.
        if abs(nz) < 0.9:
            tx, ty, tz = -ny, nx, 0.0
        else:
            tx, ty, tz = 0.0, -nz, ny
        length = np.sqrt(tx * tx + ty * ty + tz * tz)
        tx, ty, tz = tx / length, ty / length, tz / length
        bx, by, bz = ny * tz - nz * ty, nz * tx - nx * tz, nx * ty - ny * tx
        closed = 0.0
        for s in range(ambient_samples):
            a = (s * 0.7548776662466927 + shift_b) % 1.0
            phi = 6.283185307179586 * ((s * 0.5698402909980532 + shift_a) % 1.0)
            u, v, w = np.sqrt(a) * np.cos(phi), np.sqrt(a) * np.sin(phi), np.sqrt(1.0 - a)
            t, hit = nearest(
                x, y, z, u * tx + v * bx + w * nx, u * ty + v * by + w * ny, u * tz + v * bz + w * nz,
                AMBIENT_REACH, True, s_kind, s_params, s_centre, s_rotation, s_casts, s_lows, s_highs, s_links,
            )
            if hit >= 0:
                closed += 1.0 - t / AMBIENT_REACH
        openness[j] = 1.0 - closed / ambient_samples
    return direct, openness


@dataclass
class ProbeGrid:
    """Indirect light in one room: irradiance / pi of surfaces that face +x, +y, +z, -x, -y, -z, at the nodes of a grid.

    low, high (3,): first and last node, metres; cube (A,B,C,6,3): values for A x B x C nodes, 6 directions, RGB.
    """

    low: np.ndarray
    high: np.ndarray
    cube: np.ndarray

    def nodes(self) -> np.ndarray:
        """(A*B*C, 3) world positions."""
        axes = [np.linspace(self.low[a], self.high[a], self.cube.shape[a]) for a in range(3)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)

    def __call__(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,3) irradiance / pi at points (N,3) with normals (N,3); interpolated trilinearly, clamped to the grid."""
        shape = np.array(self.cube.shape[:3])
        where = np.clip((points - self.low) / (self.high - self.low), 0, 1) * (shape - 1)
        base = np.minimum(where.astype(np.int64), shape - 2)
        f = where - base
        weights = np.concatenate([np.maximum(normals, 0) ** 2, np.minimum(normals, 0) ** 2], 1)
        flat = self.cube.reshape(-1, 6, 3)
        out = np.zeros((len(points), 3))
        for corner in np.ndindex(2, 2, 2):
            c = np.array(corner)
            share = np.prod(np.where(c, f, 1 - f), axis=1)
            index = np.ravel_multi_index(tuple((base + c).T), tuple(shape))
            out += share[:, None] * np.einsum("ns,nsc->nc", weights, flat[index])
        return out


class Lighting:
    """Lights, the shapes that occlude them, and one probe grid for each of two rooms.

    rooms: (low, high) corners, (3,) metres each.  parting: x of the wall between the rooms, metres.
    """

    def __init__(self, shapes: Shapes, lights: Lights, rooms: list[tuple[np.ndarray, np.ndarray]], parting: float):
        self.shapes, self.lights, self.parting = shapes, lights, parting
        self.grids = []
        for low, high in rooms:
            low, high = np.asarray(low) + 0.2, np.asarray(high) - 0.2
            counts = np.maximum(np.ceil((high - low) / 0.4).astype(int) + 1, 2)
            self.grids.append(ProbeGrid(low, high, np.zeros((*counts, 6, 3))))

    def bake(self, surface, rays: int, bounces: int = 3, seed: int = 0) -> None:
        """Computes the probes' values.

        surface: callable (t, primitive, uv, points) -> albedo (N,3), emission (N,3), lit (N,) bool.  rays: per probe.
        """
        rng = np.random.default_rng(seed)
        k = np.arange(rays) + 0.5
        z, phi = 1 - 2 * k / rays, np.pi * (3 - np.sqrt(5)) * k
        sphere = np.stack([np.sqrt(1 - z * z) * np.cos(phi), np.sqrt(1 - z * z) * np.sin(phi), z], 1)
        jobs = []
        for grid in self.grids:
            nodes = grid.nodes()
            spins, _ = np.linalg.qr(rng.normal(size=(len(nodes), 3, 3)))
            directions = np.einsum("nij,rj->nri", spins, sphere)
            origins = np.repeat(nodes, rays, 0)
            t, primitive, normal, uv = self.shapes.trace(origins, directions.reshape(-1, 3))
            points = origins + np.where(np.isfinite(t), t, 0)[:, None] * directions.reshape(-1, 3)
            albedo, emission, lit = surface(t, primitive, uv, points)
            direct, _ = self._direct(points, normal, lit, 0)
            # A probe inside furniture is dark; it is excluded, as interpolation would darken its surroundings.
            distances = np.where(np.isfinite(t), t, 9.0).reshape(len(nodes), rays)
            valid = np.quantile(distances, 0.8, axis=1) > 0.3
            weights = np.maximum(directions @ _CUBE.T, 0)
            weights /= weights.sum(1, keepdims=True)
            jobs.append((grid, points, normal, albedo, emission, direct, lit, weights, valid))
        for _ in range(bounces):
            cubes = []
            for grid, points, normal, albedo, emission, direct, lit, weights, valid in jobs:
                bounced = self.indirect(points + 0.05 * normal, normal)
                radiance = emission + lit[:, None] * albedo * (direct + 0.92 * bounced)
                radiance = np.minimum(radiance, 4.0).reshape(*weights.shape[:2], 3)
                cube = np.einsum("nrs,nrc->nsc", weights, radiance)
                cube[~valid] = cube[valid].mean(0)
                cubes.append(cube.reshape(grid.cube.shape))
            for job, cube in zip(jobs, cubes):
                job[0].cube = cube

    def indirect(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """(N,3) indirect irradiance / pi at points (N,3) with normals (N,3)."""
        share = np.clip((points[:, 0] - self.parting) / 0.3 + 0.5, 0, 1)[:, None]
        return (1 - share) * self.grids[0](points, normals) + share * self.grids[1](points, normals)

    def irradiance(self, points: np.ndarray, normals: np.ndarray, lit: np.ndarray, ambient: int = 10) -> np.ndarray:
        """(N,3) irradiance / pi at surface points (N,3) with normals (N,3); zero where ``lit`` (N,) is False."""
        direct, openness = self._direct(points, normals, lit, ambient)
        bounced = self.indirect(points + 0.12 * normals, normals)
        return lit[:, None] * (direct + bounced * (0.25 + 0.75 * openness[:, None]))

    def _direct(self, points, normals, lit, ambient):
        lit = np.ascontiguousarray(lit, np.bool_)
        with uninterrupted():
            return in_slices(light_points, (points, normals, lit), ambient, *self.lights.arrays(), *self.shapes.arrays())
