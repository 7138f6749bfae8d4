"""How far a surface may go on beyond a point that was picked on its silhouette.

The measured points end before the true contour.  On a curved surface of radius R whose normal at the point leans by the angle t
towards the camera, from the direction across the viewing ray, the contour lies R (1 - cos t) farther out.  Seen from the
distance D the two contours of a pipe lie sqrt(R^2 - R^4 / D^2) from its middle, so that the angle asin(R / D) is added to t.
Normal and curvature are those of a quadric through the points around, in a ball that grows until the curvature is certain.
On flat surfaces, on those that hardly turn (_LEAST_TURN), and beyond STEEPEST, an edge is where points end: half a spacing may
be missing.
Frame: relative to the point picked, axes of the file, file units, float64.
"""

from dataclasses import dataclass

import numpy as np

from .measured import InBox
from .surfaces import frame_of

NEAR, FEWEST = 6.0, 24
"""Point spacings around a point in which its neighbours are looked at, about 110 of them; the least number."""
MOST_BEYOND = 0.25
"""Share of its neighbours on the side where the fewest are, up to which a point lies on a rim: a click is seldom on the
outermost point, but within one spacing of it (17 %).  On 1,500 flat surfaces, seen at 10 to 90 degrees, 4 points within were
taken for a rim."""
SURE = 2.4
"""Where there are fewer neighbours, the share lies below one half by so many roots of their number: 4.8 standard deviations."""
STEEPEST = 60.0
"""Degrees by which a normal leans towards the camera at most, for the rim to be taken for the contour of a curved surface: a
pipe of which a sixth is seen, 30 degrees to each side of the view, ends there."""
NEAR_CONTOUR = 20.0
"""Degrees by which a normal leans towards the camera at most where a curved surface goes on: nearer to its contour a click can
hardly be; the contour lies 6 % of the radius farther out there.  Half and twice give the rims of
tests/unit/work/test_silhouette.py, and so do 45 and 75 degrees of STEEPEST."""
_CERTAIN = 6.0
"""The least ratio of a curvature to its standard deviation for a surface to be curved."""
_LEAST_TURN = 0.1
"""Radians by which a normal turns between the middle of a ball and its edge, at least, for its curvature to say where the
contour lies.  In tests/unit/work/test_silhouette.py pipes of 40 spacings' radius turn by 0.075 in the first ball.  A worn
floor's is as certain, but goes on for a fraction of the way to the contour that follows from it: of 146 clicks on that of the
studio 30 were taken for silhouettes, 24 of them with a contour 2 to 211 units away; they turn by 0.057 at most."""
_FIRST, _GROWTH, _LARGEST = 3.0, 1.4, 40.0
"""Radius of the first ball in point spacings, the factor by which it grows, and the last radius."""
_ROUNDS, _OUTSIDE = 3, 3.0
"""Least squares are repeated without points farther off than so many standard deviations."""


@dataclass(frozen=True, eq=False)
class _Quadric:
    """normal: (3,) towards the camera.  bend: (3, 3), the second fundamental form.  bend_spread: standard deviation of a normal
    curvature.  lean_spread: of the normal, radians.  noise: standard deviation of the points.  least: the least curvature that
    turns the surface in the ball (_LEAST_TURN)."""

    normal: np.ndarray
    bend: np.ndarray
    bend_spread: float
    lean_spread: float
    noise: float
    least: float

    @property
    def bent(self) -> float:
        """The larger of the two main curvatures, without its sign."""
        return float(np.abs(np.linalg.eigvalsh(self.bend)).max())


def beyond_silhouette(in_box: InBox, spacing: float, ray: np.ndarray) -> np.ndarray | None:
    """(3,) from a picked point, which is the origin, to where the contour of its surface may lie at the farthest, 95 %.
    None where the point is not on a silhouette.

    in_box: points relative to it.  spacing: of the points there.  ray: (3,) from the camera to the point.
    """
    distance = float(np.linalg.norm(ray))
    if not (np.isfinite(spacing) and spacing > 0 and distance > 0):
        return None
    ahead = ray / distance
    outward, rest = _rim(_ball(in_box, NEAR * spacing), ahead)
    quadric = _curved(in_box, spacing, ahead)
    if quadric is not None:
        side = outward if outward is not None else quadric.normal - (quadric.normal @ ahead) * ahead
        length = float(np.linalg.norm(side))
        if length > 1e-9:
            reach = _reach(quadric, side / length, ahead, distance, NEAR_CONTOUR if outward is None else STEEPEST)
            if reach is not None:
                return (reach + spacing / 2 + 2 * quadric.noise) * side / length
    return None if outward is None else (rest + spacing / 2) * outward


def _ball(in_box: InBox, radius: float) -> np.ndarray:
    xyz = in_box(np.zeros(3), np.eye(3), np.full(3, radius)).xyz
    return xyz[(xyz**2).sum(axis=1) <= radius**2]


def _rim(near: np.ndarray, ahead: np.ndarray) -> tuple[np.ndarray | None, float]:
    """(3,) unit vector across the ray, away from where the points around the origin lie as the camera sees them; None where
    enough of them lie on that side, too.  And how far points go on there."""
    if len(near) < FEWEST:
        return None, 0.0
    u, v, _ = frame_of(ahead)
    across = np.stack([near @ u, near @ v], axis=1)
    out = -np.linalg.pinv(np.cov(across.T)) @ across.mean(axis=0)  # by their spread: near a contour they lie in a narrow strip
    length = float(np.linalg.norm(out))
    if length == 0:
        return None, 0.0
    out /= length
    beyond = across @ out
    if (beyond > 0).mean() > min(MOST_BEYOND, 0.5 - SURE / np.sqrt(len(near))):
        return None, 0.0
    beside = np.abs(across @ [-out[1], out[0]]) <= np.linalg.norm(near, axis=1).max() / NEAR
    return out @ [u, v], max(float(beyond[beside].max(initial=0.0)), 0.0)


def _curved(in_box: InBox, spacing: float, ahead: np.ndarray) -> _Quadric | None:
    """The quadric through the smallest ball in which its curvature is certain and turns the surface; None of what is flat."""
    radius = _FIRST * spacing
    while radius <= _LARGEST * spacing:
        found = _quadric(_ball(in_box, radius), radius, ahead)
        if found is not None and found.bent > max(_CERTAIN * found.bend_spread, found.least):
            return found
        radius *= _GROWTH
    return None


def _quadric(points: np.ndarray, radius: float, ahead: np.ndarray) -> _Quadric | None:
    if len(points) < FEWEST:
        return None
    middle = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - middle, full_matrices=False)
    u, v, w = axes @ points.T / radius
    shape = np.stack([np.ones(len(u)), u, v, u * u, u * v, v * v], axis=1)
    used = np.ones(len(u), bool)
    found, spread, inverse = np.zeros(6), 0.0, np.eye(6)
    for _ in range(_ROUNDS):
        if 2 * used.sum() < FEWEST:
            return None
        inverse = np.linalg.pinv(shape[used].T @ shape[used])
        found = inverse @ (shape[used].T @ w[used])
        rest = w - shape @ found
        spread = float(np.sqrt((rest[used] ** 2).sum() / max(used.sum() - 6, 1)))
        used = np.abs(rest) <= _OUTSIDE * max(spread, 1e-12)
    steep = np.sqrt(1 + found[1] ** 2 + found[2] ** 2)
    normal = axes.T @ (np.array([-found[1], -found[2], 1.0]) / steep)
    second = np.array([[2 * found[3], found[4]], [found[4], 2 * found[5]]]) / steep / radius
    bend = axes[:2].T @ second @ axes[:2]
    towards = -1.0 if axes[2] @ ahead > 0 else 1.0  # the mean normal tells which side the camera sees
    bend_spread = 2 * spread * float(np.sqrt(max(inverse[3, 3], inverse[5, 5]))) / radius
    lean_spread = spread * float(np.sqrt(max(inverse[1, 1], inverse[2, 2])))
    return _Quadric(towards * normal, towards * bend, bend_spread, lean_spread, spread * radius, _LEAST_TURN / radius)


def _reach(quadric: _Quadric, side: np.ndarray, ahead: np.ndarray, distance: float, steepest: float) -> float | None:
    """How far across the ray the contour may lie beyond the origin; None where it is none of a curved surface."""
    out, back = float(quadric.normal @ side), -float(quadric.normal @ ahead)
    if out <= 0:
        return None
    lean = float(np.arctan2(back, out))
    along = back * side + out * ahead  # a tangent in the plane of ray and side
    along /= np.linalg.norm(along)
    bend = -float(along @ quadric.bend @ along) / max(out**2 + back**2, 1e-12)
    if bend <= max(_CERTAIN / 2 * quadric.bend_spread, quadric.least / 2) or lean > np.radians(steepest):
        return None
    radius = 1 / max(bend - quadric.bend_spread, bend / 2)
    seen = np.arcsin(min(radius / (distance + radius), 1.0))
    return float(radius * (1 - np.cos(min(abs(lean) + 2 * quadric.lean_spread + seen, np.pi / 2))))
