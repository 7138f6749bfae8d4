"""What is fitted: a plane, a cylinder, or the circle of a cylinder's cross-section, with what least squares needs of each.

Each can be unrolled to two coordinates along its surface, in which the points of one connected piece are told from others
(viewer.work.fits.connected).  Frame: that of the points, which the caller chooses near them; all lengths in file units.
"""

from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np


def frame_of(direction: np.ndarray) -> np.ndarray:
    """(3, 3) rows: two unit vectors at right angles to a unit vector, and itself; right-handed."""
    # Duff et al., Building an Orthonormal Basis, Revisited, 2017: no cross products, which are slow for single vectors.
    x, y, z = direction.tolist()
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    return np.array([[1.0 + sign * x * x * a, sign * b, -sign * x], [b, sign + y * y * a, -y], [x, y, z]])


@dataclass(frozen=True, eq=False)
class Plane:
    """place: (3,) on it.  direction: (3,) its unit normal."""

    place: np.ndarray
    direction: np.ndarray
    parameters: ClassVar[tuple[str, ...]] = ("offset", "tilt", "tilt")
    circumference: ClassVar[float | None] = None

    def placed(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Place, frame (3, 3), and radius, 0 of a plane: what the compiled loops take (viewer.work.fits.fit_loops)."""
        return self.place, frame_of(self.direction), 0.0

    def distances(self, points: np.ndarray) -> np.ndarray:
        """(n,) signed distances of (n, 3) points, positive on the side of the normal."""
        return (points - self.place) @ self.direction

    def normals(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) the unit normal of the surface nearest to each point."""
        return np.broadcast_to(self.direction, points.shape)

    def unrolled(self, points: np.ndarray) -> np.ndarray:
        """(n, 2) along the surface."""
        return (points - self.place) @ frame_of(self.direction)[:2].T

    def linearised(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The distances and, (n, 3), their derivatives by the parameters: moved along its normal, and tilted about ``place``
        twice."""
        u, v, away = frame_of(self.direction) @ (points - self.place).T
        return away, np.column_stack([np.full(len(points), -1.0), u, v])

    def changed(self, change: np.ndarray) -> Self:
        """After a change of the parameters."""
        u, v, normal = frame_of(self.direction)
        tilted = normal + change[1] * u + change[2] * v
        return replace(self, place=self.place + change[0] * normal, direction=tilted / np.linalg.norm(tilted))

    def at(self, place: np.ndarray) -> Self:
        """The same plane, given at the foot of a place (3,).  At the middle of its points offset and tilt are independent."""
        return replace(self, place=place - self.distances(place[None])[0] * self.direction)


@dataclass(frozen=True, eq=False)
class Cylinder:
    """place: (3,) on the axis.  direction: (3,) unit vector along it.  radius: above 0."""

    place: np.ndarray
    direction: np.ndarray
    radius: float
    parameters: ClassVar[tuple[str, ...]] = ("place", "place", "radius", "tilt", "tilt")

    @property
    def circumference(self) -> float:
        """Length around: the first unrolled coordinate repeats after it."""
        return 2 * np.pi * self.radius

    def placed(self) -> tuple[np.ndarray, np.ndarray, float]:
        """As Plane.placed."""
        return self.place, frame_of(self.direction), float(self.radius)

    def _across(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Cosine and sine of the direction of each point seen from the axis, and its distance from the axis."""
        u, v = frame_of(self.direction)[:2] @ (points - self.place).T
        away = np.hypot(u, v)
        safe = np.maximum(away, 1e-300)
        return u / safe, v / safe, away

    def distances(self, points: np.ndarray) -> np.ndarray:
        """(n,) signed distances of (n, 3) points, positive outside."""
        return self._across(points)[2] - self.radius

    def normals(self, points: np.ndarray) -> np.ndarray:
        """(n, 3) unit vectors away from the axis."""
        cosine, sine, _ = self._across(points)
        return np.stack([cosine, sine], axis=1) @ frame_of(self.direction)[:2]

    def unrolled(self, points: np.ndarray) -> np.ndarray:
        """(n, 2): around, from 0 to the circumference, and along the axis."""
        u, v, along = frame_of(self.direction) @ (points - self.place).T
        return np.stack([(np.arctan2(v, u) % (2 * np.pi)) * self.radius, along], axis=1)

    def linearised(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The distances and, (n, 5), their derivatives by the parameters: the axis moved across twice, the radius, the axis
        tilted about ``place`` twice."""
        cosine, sine, away = self._across(points)
        along = (points - self.place) @ -self.direction
        return away - self.radius, np.column_stack([-cosine, -sine, np.full(len(points), -1.0), along * cosine, along * sine])

    def changed(self, change: np.ndarray) -> Self:
        """After a change of the parameters."""
        u, v, axis = frame_of(self.direction)
        tilted = axis + change[3] * u + change[4] * v
        return replace(self, place=self.place + change[0] * u + change[1] * v, radius=self.radius + change[2],
                       direction=tilted / np.linalg.norm(tilted))

    def change_to(self, other: "Cylinder") -> np.ndarray:
        """(5,) the change of the parameters that leads to a cylinder near this one."""
        u, v, axis = frame_of(self.direction)
        direction = other.direction * np.sign(other.direction @ axis)
        place = other.place - ((other.place - self.place) @ axis) / (direction @ axis) * direction - self.place
        return np.array([place @ u, place @ v, other.radius - self.radius, direction @ u, direction @ v])


class Circle(Cylinder):
    """A short piece of a cylinder whose direction is known: its cross-section."""

    parameters: ClassVar[tuple[str, ...]] = ("place", "place", "radius")

    def linearised(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The distances and, (n, 3), their derivatives: the centre moved across twice, and the radius."""
        distances, slopes = super().linearised(points)
        return distances, slopes[:, :3]

    def changed(self, change: np.ndarray) -> Self:
        """After a change of the parameters."""
        return super().changed(np.append(change, [0.0, 0.0]))

    def change_to(self, other: Cylinder) -> np.ndarray:
        """(3,) the change of the parameters that leads to a circle near this one."""
        return super().change_to(other)[:3]


Surface = Plane | Cylinder
