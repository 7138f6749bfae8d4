"""The camera, a pinhole or an orthographic one: where it stands (float64, the file's own coordinates) and how it projects
(pixels).

World frame: the scan file's.  Camera frame in ``camera_to_world``: OpenGL axes, x right, y up, -z forward.  View frame,
used for projection: x right, y down, z forward, so that z is the depth.  A pixel (column i, row j) spans
[i, i+1] x [j, j+1], row 0 at the top; its centre is at +0.5 (the COLMAP convention).
"""

from dataclasses import dataclass, field, replace

import numpy as np

from ..common.errors import InputError

_FLIP = np.diag([1.0, -1.0, -1.0])  # OpenGL camera axes -> view axes (y down, z forward)
MAX_SIDE = 16384
FOCAL_LENGTHS = (1e-12, 1e12)
"""The least and the most, in sides of the picture.  Long before, float32 no longer resolves neighbouring directions; beyond,
numbers overflow."""
_OFF_CENTRE = 1e9
"""How many sides the principal point may lie off the picture."""
SCALE_DISTANCES = (1e-12, 1e12)
"""The least and the most that an orthographic camera's scale may be measured at, file units: its inverse is a float32."""
_FARTHEST = 1e20
"""File units from zero; beyond it a number is no position (as for points, viewer.grid.building.histogram)."""


@dataclass(frozen=True, eq=False)
class Camera:
    """A camera without distortion.

    width, height: pixels.  fx, fy, cx, cy: pixels.  camera_to_world: (4, 4) float64; its rotation may carry a uniform
    scale, which is taken out.  orthographic: None for a pinhole.  Else all rays are parallel to the line of sight, and the
    scale is that which the pinhole has at this view-space depth, file units: fx / orthographic pixels a file unit.  Points
    behind the plane through the position across the line of sight are not seen, as with a pinhole.
    Raises InputError naming the first bad value.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    camera_to_world: np.ndarray
    name: str = ""
    orthographic: float | None = None
    view_rotation: np.ndarray = field(init=False, repr=False)
    """(3, 3) float64, world -> view axes (x right, y down, z forward)."""

    def __post_init__(self) -> None:
        label = f"camera {self.name!r}" if self.name else "camera"
        for side in ("width", "height"):
            given = getattr(self, side)
            value = _number(given)
            if not (1 <= value <= MAX_SIDE and value == int(value)):
                raise InputError(f"{label}: {side} {given!r}: expected a whole number of pixels from 1 to {MAX_SIDE}")
            object.__setattr__(self, side, int(value))
        for focal in ("fx", "fy"):
            given = getattr(self, focal)
            value = _number(given)
            if not (np.isfinite(value) and value > 0):
                raise InputError(f"{label}: {focal} {given!r}: expected a focal length in pixels above 0")
            side = self.width if focal == "fx" else self.height
            low, high = (side * limit for limit in FOCAL_LENGTHS)
            if not low <= value <= high:
                raise InputError(f"{label}: {focal} {value:g}: no picture {side} pixels across can be made with this focal "
                                 f"length; expected pixels, from {low:g} to {high:g}")
        for centre, side in (("cx", self.width), ("cy", self.height)):
            given = getattr(self, centre)
            if not np.isfinite(_number(given)):
                raise InputError(f"{label}: principal point ({self.cx!r}, {self.cy!r}) is not finite")
            if abs(_number(given)) > _OFF_CENTRE * side:
                raise InputError(f"{label}: {centre} {given!r}: the principal point is too far off a picture {side} pixels "
                                 "across; expected pixels, mostly half of that")
        if self.orthographic is not None:
            distance = _number(self.orthographic)
            if not SCALE_DISTANCES[0] <= distance <= SCALE_DISTANCES[1]:
                raise InputError(f"{label}: orthographic {self.orthographic!r}: expected a distance in file units, from "
                                 f"{SCALE_DISTANCES[0]:g} to {SCALE_DISTANCES[1]:g}")
            object.__setattr__(self, "orthographic", distance)
        try:
            matrix = np.array(self.camera_to_world, np.float64)
        except (TypeError, ValueError):
            raise InputError(f"{label}: camera_to_world must be a finite 4x4 matrix of numbers") from None
        if matrix.shape != (4, 4) or not np.isfinite(matrix).all():
            raise InputError(f"{label}: camera_to_world must be a finite 4x4 matrix, got shape {matrix.shape}")
        if np.abs(matrix[:3, 3]).max() > _FARTHEST:
            raise InputError(f"{label}: position {matrix[:3, 3].tolist()} is farther from zero than any place; expected the "
                             "scan's own coordinates")
        rotation = matrix[:3, :3]
        largest = np.abs(rotation).max()
        scaled = rotation / largest if largest > 0 else rotation  # first to size 1: the determinant is a cube
        determinant = np.linalg.det(scaled)
        if not determinant > 1e-9:
            raise InputError(f"{label}: camera_to_world is singular or mirrored (determinant {determinant:.3g}, "
                             f"its largest entry {largest:.3g} taken as 1)")
        scaled = scaled / np.cbrt(determinant)
        u, _, vt = np.linalg.svd(scaled)
        nearest = u @ vt
        if np.abs(scaled - nearest).max() > 1e-2:
            raise InputError(f"{label}: camera_to_world is not a rotation (sheared or scaled unevenly)")
        if np.abs(rotation - nearest).max() > 1e-12:  # an exact rotation stays as it was written, to the bit
            matrix[:3, :3] = nearest
        matrix[3] = (0, 0, 0, 1)
        matrix.setflags(write=False)
        object.__setattr__(self, "camera_to_world", matrix)
        object.__setattr__(self, "view_rotation", _FLIP @ matrix[:3, :3].T)

    @property
    def key(self) -> tuple:
        """Equal for cameras that make the same picture: everything but the name."""
        return (self.width, self.height, self.fx, self.fy, self.cx, self.cy, self.orthographic, self.camera_to_world.tobytes())

    def divisor(self, depth):
        """What view-space x and y are divided by: ``depth``, or of an orthographic camera a constant of its shape."""
        return depth if self.orthographic is None else np.full_like(np.asarray(depth, np.float64), self.orthographic)

    def ray(self, pixel: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        """Where the ray through a position of the picture begins, (3,), at depth 0, and its direction, (3,) of length 1."""
        if self.orthographic is not None:
            return self.unproject([pixel], 0.0)[0], self.forward
        along = self.unproject([pixel], 1.0)[0] - self.position
        return self.position, along / np.linalg.norm(along)

    @property
    def position(self) -> np.ndarray:
        """(3,) float64, file coordinates."""
        return self.camera_to_world[:3, 3]

    @property
    def right(self) -> np.ndarray:
        """(3,) unit vector, world axes."""
        return self.camera_to_world[:3, 0]

    @property
    def up(self) -> np.ndarray:
        """(3,) unit vector, world axes."""
        return self.camera_to_world[:3, 1]

    @property
    def forward(self) -> np.ndarray:
        """(3,) unit vector, world axes."""
        return -self.camera_to_world[:3, 2]

    @property
    def world_to_camera(self) -> np.ndarray:
        """(4, 4) float64, the inverse of camera_to_world (OpenGL camera axes)."""
        out = np.eye(4)
        out[:3, :3] = self.camera_to_world[:3, :3].T
        out[:3, 3] = -out[:3, :3] @ self.position
        return out

    @property
    def vertical_fov(self) -> float:
        """Degrees from the top edge to the bottom edge."""
        return float(np.degrees(np.arctan(self.cy / self.fy) + np.arctan((self.height - self.cy) / self.fy)))

    def sight_of(self, point: np.ndarray) -> np.ndarray:
        """(3,) file units: from where the ray through a point, (3,) file coordinates, begins, to the point."""
        away = np.asarray(point, np.float64) - self.position
        return away if self.orthographic is None else self.forward * float(away @ self.forward)

    def project(self, points) -> tuple[np.ndarray, np.ndarray]:
        """Where world points appear in the picture.

        points: (N, 3), file coordinates.  Returns pixels (N, 2) float64, column and row as in the module's docstring, and the
        view-space depth (N,) float64 in file units.  Pixels of points at or behind the camera (depth <= 0) are NaN.
        """
        view = (np.asarray(points, np.float64).reshape(-1, 3) - self.position) @ self.view_rotation.T
        depth = view[:, 2]
        safe = np.where(depth > 0, self.divisor(depth), np.nan)
        pixels = np.stack([self.cx + self.fx * view[:, 0] / safe, self.cy + self.fy * view[:, 1] / safe], axis=1)
        return pixels, depth

    def unproject(self, pixels, depth) -> np.ndarray:
        """World points seen at ``pixels`` (N, 2) at view-space ``depth`` (N,) or a scalar; the inverse of :meth:`project`.

        Returns (N, 3) float64, file coordinates.
        """
        pixels = np.asarray(pixels, np.float64).reshape(-1, 2)
        depth = np.broadcast_to(np.asarray(depth, np.float64), len(pixels))
        by = self.divisor(depth)
        view = np.stack([(pixels[:, 0] - self.cx) / self.fx * by, (pixels[:, 1] - self.cy) / self.fy * by, depth], axis=1)
        return self.position + view @ self.view_rotation

    def resized(self, width: int, height: int) -> "Camera":
        """The same view at another size.  Where the aspect differs, the vertical field of view is kept and the
        principal point scales with the picture."""
        s = height / self.height
        cx = width / 2 + (self.cx - self.width / 2) * s
        return replace(
            self, width=width, height=height, fx=self.fx * s, fy=self.fy * s, cx=cx, cy=self.cy * s,
        )

    def moved(self, camera_to_world: np.ndarray) -> "Camera":
        """The same lens at another pose."""
        return replace(self, camera_to_world=camera_to_world)


def look_at(position, target, up=(0.0, 0.0, 1.0)) -> np.ndarray:
    """(4, 4) float64 camera_to_world at ``position`` looking at ``target`` with ``up`` (world axes) upward.

    Looking straight along ``up`` falls back to another axis, so that the result is always a rotation.
    """
    position, target, up = (np.asarray(v, np.float64) for v in (position, target, up))
    back = position - target
    reach = np.abs(back).max()
    back = back / reach if reach > 1e-200 else np.array([0.0, -1.0, 0.0])  # first to size 1: squares must not vanish
    back = back / np.linalg.norm(back)
    right = np.cross(up, back)
    if np.linalg.norm(right) < 1e-9:
        right = np.cross(np.eye(3)[np.abs(back).argmin()], back)  # the axis farthest from the line of sight
    right /= np.linalg.norm(right)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = right, np.cross(back, right), back, position
    return matrix


def _number(value: object) -> float:
    """``value`` as a float, NaN where it is none: every comparison with NaN fails."""
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return float("nan")


def from_fov(width: int, height: int, vertical_fov: float, camera_to_world: np.ndarray, name: str = "") -> Camera:
    """A centred camera with square pixels.  vertical_fov: degrees, above 0 and below 180."""
    if not 0 < vertical_fov < 180:
        raise InputError("expected degrees above 0 and below 180", option="field of view", value=vertical_fov)
    with np.errstate(over="ignore", divide="ignore"):  # Camera refuses what is not finite
        focal = 0.5 * height / np.tan(np.radians(vertical_fov) / 2)
    return Camera(width, height, focal, focal, width / 2, height / 2, camera_to_world, name)
