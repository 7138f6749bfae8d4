"""An RGB-D panorama as something a `VirtualScanner` can scan: six cube faces of colour and depth around one station.

A pulse returns from the pixel it meets, along that pixel's own centre: the depth of a face is exact there and nowhere
else.  So the scanner's angular grid chooses pixels, and `snap` turns its directions into theirs.  Normals come from
neighbouring depths; darkness from the colour; what shines is not in the pictures and counts as matt.

Frame: the faces' world, metres; ``up`` says which of its axes points up, and `VirtualScanner` is given and gives z-up
coordinates: `to_z_up` and `from_z_up` go there and back.
"""

from dataclasses import dataclass

import numpy as np

FACES = 6


@dataclass(frozen=True)
class Seen:
    """t (N,) metres along the ray, +inf where nothing returned; rgb (N,3) sRGB 0..1; normal (N,3) unit, towards the
    scanner; shininess, darkness (N,) 0..1."""

    t: np.ndarray
    rgb: np.ndarray
    normal: np.ndarray
    shininess: np.ndarray
    darkness: np.ndarray


def to_z_up(vectors: np.ndarray, up: str) -> np.ndarray:
    """(..., 3) vectors of a world whose axis ``up`` ("y" or "z") points up, in one where z does."""
    return vectors if up == "z" else np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], -1)


def from_z_up(vectors: np.ndarray, up: str) -> np.ndarray:
    """The inverse of `to_z_up`."""
    return vectors if up == "z" else np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], -1)


class Panorama:
    """Six faces of one station.

    rotations: (6,3,3) camera_to_world (OpenGL axes: x right, y up, -z forward) of the faces; fl: pixels;
    depth: (6,H,W) z-depth, +inf where nothing returned; rgb: (6,H,W,3) uint8.  All in a z-up world.
    """

    def __init__(self, rotations: np.ndarray, fl: float, depth: np.ndarray, rgb: np.ndarray):
        self.rotations, self.fl = rotations, fl
        self.faces, self.height, self.width = depth.shape
        i, j = np.meshgrid(np.arange(self.width) + 0.5, np.arange(self.height) + 0.5)
        local = np.stack([(i - self.width / 2) / fl, -(j - self.height / 2) / fl, -np.ones_like(i)], -1)
        length = np.linalg.norm(local, axis=-1)
        self._rays = np.einsum("fab,hwb->fhwa", rotations, local / length[..., None]).reshape(-1, 3)
        self._t = (depth * length).reshape(-1)
        self._rgb = rgb.reshape(-1, 3)
        points = np.where(np.isfinite(depth), depth, np.nan)[..., None] * local  # in each face's own frame
        across, down = np.gradient(points, axis=2), np.gradient(points, axis=1)
        normal = np.cross(down, across)
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
        facing = -(local / length[..., None])
        # at an edge to nothing: as if met squarely
        normal = np.where(np.isfinite(normal).all(-1, keepdims=True), normal, facing)
        self._normal = np.einsum("fab,fhwb->fhwa", rotations, normal).reshape(-1, 3)

    def pixels(self, rays: np.ndarray) -> np.ndarray:
        """(N,) int64: the pixel, of all faces, that each unit direction (N,3) meets."""
        face = np.argmin(np.einsum("nb,fb->nf", rays, self.rotations[:, :, 2]), 1)  # least along +z is most forward
        local = np.einsum("nb,nba->na", rays, self.rotations[face])
        ahead = np.maximum(-local[:, 2], 1e-9)
        column = np.clip((local[:, 0] / ahead * self.fl + self.width / 2).astype(int), 0, self.width - 1)
        row = np.clip((-local[:, 1] / ahead * self.fl + self.height / 2).astype(int), 0, self.height - 1)
        return (face * self.height + row) * self.width + column

    def snap(self, rays: np.ndarray) -> np.ndarray:
        """(M,3) the centre rays of the pixels that ``rays`` (N,3) meet, each pixel once, in the order first met."""
        pixel = self.pixels(rays)
        _, first = np.unique(pixel, return_index=True)
        return self._rays[pixel[np.sort(first)]]

    def trace(self, origins: np.ndarray, rays: np.ndarray) -> Seen:
        """What rays (N,3) from the station meet; origins are the station's own and not looked at."""
        del origins
        pixel = self.pixels(rays)
        rgb = self._rgb[pixel] / 255.0
        return Seen(self._t[pixel], rgb, self._normal[pixel], np.zeros(len(pixel)), 1 - rgb.max(1))


@dataclass(frozen=True)
class Passer:
    """Somebody who walks by while one station scans: an upright cylinder.  foot (3,) on the floor, z up; metres."""

    foot: np.ndarray
    height: float
    radius: float
    colour: np.ndarray


def with_passers(trace, passers: list[Passer]):
    """A trace that meets ``passers`` where they stand nearer than what ``trace`` sees."""

    def meet(origins: np.ndarray, rays: np.ndarray) -> Seen:
        seen = trace(origins, rays)
        out = Seen(seen.t.copy(), seen.rgb.copy(), seen.normal.copy(), np.array(seen.shininess), np.array(seen.darkness))
        for passer in passers:
            t, normal = _cylinder(origins, rays, passer)
            nearer = t < out.t
            out.t[nearer], out.normal[nearer], out.rgb[nearer] = t[nearer], normal[nearer], passer.colour
            out.shininess[nearer], out.darkness[nearer] = 0.1, 1 - passer.colour.max()
        return out

    return meet


def _cylinder(origins: np.ndarray, rays: np.ndarray, passer: Passer) -> tuple[np.ndarray, np.ndarray]:
    """t (N,), +inf where missed, and normals (N,3) of rays against an upright cylinder."""
    o, d = origins[:, :2] - passer.foot[:2], rays[:, :2]
    a, b, c = (d * d).sum(1), (o * d).sum(1), (o * o).sum(1) - passer.radius**2
    with np.errstate(divide="ignore", invalid="ignore"):
        root = b * b - a * c
        t = np.where(root > 0, (-b - np.sqrt(np.maximum(root, 0))) / a, np.inf)
    z = origins[:, 2] + t * rays[:, 2] - passer.foot[2]
    t = np.where((t > 0) & (z >= 0) & (z <= passer.height), t, np.inf)
    at = np.where(np.isfinite(t), t, 0)[:, None]
    flat = (o + at * d) / passer.radius
    return t, np.column_stack([flat, np.zeros(len(t))])
