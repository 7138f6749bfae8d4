"""Collects primitives and their materials, from which furniture is built.

Frame: world metres, or the local frame set with `Builder.at` (a rotation about z and a shift).
"""

from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from ..common.linear_light import to_linear
from .shapes import BOX, CAPSULE, CYLINDER, QUAD, ROUND, SPHERE, Shapes, half_extents, make_shapes
from .textures import NAMES


def hex_colour(text: str) -> np.ndarray:
    """'#rrggbb' to linear (3,)."""
    return to_linear([int(text[i : i + 2], 16) / 255 for i in (1, 3, 5)])


@dataclass(frozen=True)
class Appearance:
    """Appearance of a primitive.

    material: a name in `textures.NAMES`.  colour, accent: sRGB, '#rrggbb'.  shininess: 0 matt to 1 mirror.  glow: emitted
    radiance, linear RGB.  casts: whether it casts shadows.  outdoors: lit by the sky only, not by the lights of the rooms.
    """

    material: str = "plain"
    colour: str = "#808080"
    accent: str = "#404040"
    shininess: float = 0.05
    glow: tuple[float, float, float] = (0.0, 0.0, 0.0)
    casts: bool = True
    outdoors: bool = False


@dataclass(frozen=True)
class Finish:
    """The appearances of P primitives as arrays; see `Appearance`.

    material (P,) index into `textures.NAMES`; colour, accent, glow (P,3) linear; shininess (P,); outdoors (P,) bool; half (P,3)
    half extents, metres; seed (P,) int64.
    """

    material: np.ndarray
    colour: np.ndarray
    accent: np.ndarray
    shininess: np.ndarray
    glow: np.ndarray
    outdoors: np.ndarray
    half: np.ndarray
    seed: np.ndarray


@dataclass
class Builder:
    """Collects primitives in a list; `finish` turns them into arrays.  yaw: radians; shift (3,): metres."""

    seed: int = 0
    yaw: float = 0.0
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    rows: list = field(default_factory=list)

    @contextmanager
    def at(self, x: float, y: float, z: float = 0.0, yaw: float = 0.0):
        """A context in which coordinates are rotated by ``yaw`` (degrees, about z), then shifted by x, y, z.  Contexts nest."""
        kept = self.yaw, self.shift
        self.shift = self._world((x, y, z))
        self.yaw += np.radians(yaw)
        try:
            yield self
        finally:
            self.yaw, self.shift = kept

    def _turn(self) -> np.ndarray:
        c, s = np.cos(self.yaw), np.sin(self.yaw)
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])

    def _world(self, point) -> np.ndarray:
        return self._turn() @ np.asarray(point, np.float64) + self.shift

    def _add(self, kind, params, centre, axes, look: Appearance, seed=None) -> None:
        """axes: (3,3) local to builder frame; its columns are the primitive's local axes."""
        rotation = (self._turn() @ axes).T
        number = self.seed * 1000 + len(self.rows) if seed is None else seed
        self.rows.append((kind, [*params, 0, 0, 0, 0][:4], self._world(centre), rotation, look, number))

    def box(self, low, high, look: Appearance, seed=None) -> None:
        """The box between two corners."""
        low, high = np.asarray(low, float), np.asarray(high, float)
        self._add(BOX, (high - low) / 2, (low + high) / 2, np.eye(3), look, seed)

    def turned_box(self, centre, half, look: Appearance, *, axes: np.ndarray, seed=None) -> None:
        """A box with half extents (3,) along the columns of ``axes`` (3,3)."""
        self._add(BOX, half, centre, axes, look, seed)

    def cushion(self, centre, half, radius: float, look: Appearance, *, axes: np.ndarray | None = None) -> None:
        """A box with rounded edges.  radius: metres, limited to the smallest half extent."""
        self._add(ROUND, [*half, min(radius, min(half) * 0.999)], centre, np.eye(3) if axes is None else axes, look)

    def rod(self, a, b, radius: float, look: Appearance, *, end: float | None = None, caps: bool = True) -> None:
        """A cylinder from a to b.  end: radius at b if it differs, metres.  caps: whether both ends are closed."""
        a, b = np.asarray(a, float), np.asarray(b, float)
        params = (radius, radius if end is None else end, np.linalg.norm(b - a) / 2, float(caps))
        self._add(CYLINDER, params, (a + b) / 2, frame_along(b - a), look)

    def capsule(self, a, b, radius: float, look: Appearance) -> None:
        """All points within ``radius`` of the segment from a to b."""
        a, b = np.asarray(a, float), np.asarray(b, float)
        self._add(CAPSULE, (radius, np.linalg.norm(b - a) / 2), (a + b) / 2, frame_along(b - a), look)

    def cable(self, points, radius: float, look: Appearance) -> None:
        """Capsules along a polyline (K,3)."""
        for a, b in pairwise(points):
            self.capsule(a, b, radius, look)

    def ball(self, centre, radii, look: Appearance) -> None:
        """An ellipsoid; radii: one number or three."""
        self._add(SPHERE, np.broadcast_to(radii, 3), centre, np.eye(3), look)

    def quad(self, centre, right, up, look: Appearance, *, outline: int = 0, seed=None) -> None:
        """A flat patch.  right, up: perpendicular vectors (3,) of half its sides; outline: as for QUAD in `shapes`."""
        right, up = np.asarray(right, float), np.asarray(up, float)
        hx, hy = np.linalg.norm(right), np.linalg.norm(up)
        x, y = right / hx, up / hy
        self._add(QUAD, (hx, hy, outline), centre, np.stack([x, y, np.cross(x, y)], 1), look, seed)

    def finish(self) -> tuple[Shapes, Finish]:
        """The shapes and looks of all primitives added so far."""
        kinds, params, centres, rotations, looks, seeds = zip(*self.rows)
        kinds, params = np.array(kinds), np.array(params)
        shapes = make_shapes(kinds, params, centres, rotations, [look.casts for look in looks])
        finish = Finish(
            np.array([NAMES.index(look.material) for look in looks]),
            np.array([hex_colour(look.colour) for look in looks]),
            np.array([hex_colour(look.accent) for look in looks]),
            np.array([look.shininess for look in looks]),
            np.array([look.glow for look in looks], np.float64),
            np.array([look.outdoors for look in looks]),
            half_extents(kinds, params),
            np.array(seeds, np.int64),
        )
        return shapes, finish


def frame_along(direction) -> np.ndarray:
    """(3,3) rotation whose third column points along ``direction``."""
    z = np.asarray(direction, float) / np.linalg.norm(direction)
    x = np.cross([0, 0, 1.0] if abs(z[2]) < 0.9 else [1.0, 0, 0], z)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], 1)


def tilt(axis: str, degrees: float) -> np.ndarray:
    """(3,3) rotation by ``degrees`` about 'x', 'y' or 'z'."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    out = np.eye(3)
    out[i, i] = out[j, j] = c
    out[i, j], out[j, i] = -s, s
    return out
