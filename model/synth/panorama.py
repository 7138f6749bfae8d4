"""An RGB-D panorama as a scene for `VirtualScanner`: six cube faces of colour and depth around one station.

The depth of a face is exact at pixel centres only.  `snap` therefore replaces the directions of the scanner's angular grid by
those of the pixel centres.  Normals are computed from neighbouring depths and darkness from the colour.  The pictures do not
show shininess; every surface counts as matt.

Frame: world of the faces, metres; its axis ``up`` points up.  `VirtualScanner` works with z up: `to_z_up` and `from_z_up`
convert.
"""

from dataclasses import dataclass

import numpy as np

FACES = 6
"""Faces of a cube."""


@dataclass(frozen=True)
class Seen:
    """Hits of N rays, as `place.Hits`.

    t (N,) metres along the ray, +inf without a return; rgb (N,3) sRGB 0..1; normal (N,3) unit, towards the scanner; shininess,
    darkness (N,) 0..1.
    """

    t: np.ndarray
    rgb: np.ndarray
    normal: np.ndarray
    shininess: np.ndarray
    darkness: np.ndarray


def to_z_up(vectors: np.ndarray, up: str) -> np.ndarray:
    """(..., 3) vectors from a frame whose axis ``up`` ("y" or "z") points up, converted to z up."""
    return vectors if up == "z" else np.stack([vectors[..., 0], -vectors[..., 2], vectors[..., 1]], -1)


def from_z_up(vectors: np.ndarray, up: str) -> np.ndarray:
    """The inverse of `to_z_up`."""
    return vectors if up == "z" else np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], -1)


class Panorama:
    """Six faces of one station.

    rotations: (6,3,3) camera_to_world (OpenGL axes: x right, y up, -z forward), world with z up; fl: focal length, pixels;
    depth: (6,H,W) view-space metres, +inf without a return; rgb: (6,H,W,3) uint8.
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
        points = np.where(np.isfinite(depth), depth, np.nan)[..., None] * local  # in each face's camera frame
        across, down = np.gradient(points, axis=2), np.gradient(points, axis=1)
        normal = np.cross(down, across)
        normal /= np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-12)
        facing = -(local / length[..., None])
        # Next to a pixel without depth there is no normal; the surface is assumed to face the scanner.
        normal = np.where(np.isfinite(normal).all(-1, keepdims=True), normal, facing)
        self._normal = np.einsum("fab,fhwb->fhwa", rotations, normal).reshape(-1, 3)

    def pixels(self, rays: np.ndarray) -> np.ndarray:
        """(N,) int64: index, over all faces, of the pixel hit by each unit direction (N,3)."""
        face = np.argmin(np.einsum("nb,fb->nf", rays, self.rotations[:, :, 2]), 1)  # a camera looks along -z
        local = np.einsum("nb,nba->na", rays, self.rotations[face])
        ahead = np.maximum(-local[:, 2], 1e-9)
        column = np.clip((local[:, 0] / ahead * self.fl + self.width / 2).astype(int), 0, self.width - 1)
        row = np.clip((-local[:, 1] / ahead * self.fl + self.height / 2).astype(int), 0, self.height - 1)
        return (face * self.height + row) * self.width + column

    def snap(self, rays: np.ndarray) -> np.ndarray:
        """(M,3) directions of the centres of the pixels hit by ``rays`` (N,3), each pixel once, in the order of the first
        hit."""
        pixel = self.pixels(rays)
        _, first = np.unique(pixel, return_index=True)
        return self._rays[pixel[np.sort(first)]]

    def trace(self, origins: np.ndarray, rays: np.ndarray) -> Seen:
        """Hits of rays (N,3) from the station; ``origins`` are ignored, as all are the scanner position."""
        del origins
        pixel = self.pixels(rays)
        rgb = self._rgb[pixel] / 255.0
        return Seen(self._t[pixel], rgb, self._normal[pixel], np.zeros(len(pixel)), 1 - rgb.max(1))


@dataclass(frozen=True)
class Passer:
    """A person who passes while one station scans: an upright cylinder.

    foot (3,): centre of its base, z up; height, radius: all in metres.  colour (3,): sRGB 0..1.
    """

    foot: np.ndarray
    height: float
    radius: float
    colour: np.ndarray


def with_passers(trace, passers: list[Passer]):
    """``trace`` with ``passers`` added to the scene; the nearer hit counts."""

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
    """Intersection of rays with an upright cylinder without caps: t (N,), +inf where missed, and normals (N,3)."""
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
