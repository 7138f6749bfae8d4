"""The pose and focal length of a pinhole camera from places in its picture and the points of the scan that they show.

PnP with RANSAC (AP3P of OpenCV) finds what is consistent; a robust least-squares fit of what is consistent refines it.
View frame: x right, y down, z forward.  Points are relative to an origin near them, file units.
"""

from dataclasses import dataclass

import numpy as np

from .picture_features import opencv
from .pose_accuracy import STATED, pose_within

ROUNDS = 10_000
"""RANSAC rounds at most: finds four right ones among one in eight with a probability of 0.9."""
LEAST = 8
"""Consistent matches below which there is no pose."""


@dataclass(frozen=True, eq=False)
class SolvedPose:
    """rotation (3, 3), shift (3,): point to view frame.  focal: pixels.  consistent: indices of the matches that it explains.
    residual: root mean square of their distance, pixels.  deviations: standard deviations of the place (file units), of the
    direction (radians) and of the focal length (a share), as these matches fix them.  within: as of
    pose_within.  distance: median of the matches' points from the place, file units.  share: of the
    matches, those that agree."""

    rotation: np.ndarray
    shift: np.ndarray
    focal: float
    consistent: np.ndarray
    residual: float
    deviations: tuple[float, float, float] = (np.inf, np.inf, np.inf)
    within: tuple[float, float] = (np.inf, np.inf)
    distance: float = np.inf
    share: float = 1.0

    @property
    def position(self) -> np.ndarray:
        """(3,) of the camera, relative to the points' origin."""
        return -self.rotation.T @ self.shift


def ransac_pose(pixels: np.ndarray, points: np.ndarray, focals: tuple[float, ...], centre: tuple[float, float], tolerance: float
                ) -> SolvedPose | None:
    """The pose and the focal length, one of ``focals``, that explain most matches; None where there is none.

    pixels: (n, 2).  points: (n, 3).  centre: principal point.  tolerance: pixels.
    """
    if len(pixels) < LEAST:
        return None
    cv = opencv()
    best: SolvedPose | None = None
    for focal in focals:
        cv.setRNGSeed(0)
        matrix = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1.0]])
        found, vector, shift, inliers = cv.solvePnPRansac(
            np.ascontiguousarray(points, np.float64), np.ascontiguousarray(pixels, np.float64), matrix, None,
            iterationsCount=ROUNDS // (1 if len(focals) == 1 else 4), reprojectionError=float(tolerance), confidence=0.9999,
            flags=cv.SOLVEPNP_AP3P)  # fmt: skip
        if not found or inliers is None or len(inliers) < LEAST:
            continue
        if best is None or len(inliers) > len(best.consistent):
            best = SolvedPose(cv.Rodrigues(vector)[0], shift[:, 0], focal, inliers[:, 0], tolerance)
    return best


def refined_pose(pixels: np.ndarray, points: np.ndarray, centre: tuple[float, float], first: SolvedPose, tolerance: float,
                 *, stated: float | None) -> SolvedPose | None:
    """The least-squares pose, and focal length, of the matches within ``tolerance`` of ``first``, and of the result again.

    stated: focal length that the photograph states, which is kept to STATED; None: free.
    None where too few matches are left.
    """
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    pose, scale = first, float(np.median(np.linalg.norm(points - first.position, axis=1)))
    for _ in range(3):
        use = np.flatnonzero(distances(pixels, points, centre, pose) < tolerance)
        if len(use) < LEAST:
            return None

        def placed(values: np.ndarray, before=pose) -> tuple[np.ndarray, np.ndarray, float]:
            rotation = Rotation.from_rotvec(values[:3]).as_matrix() @ before.rotation
            return rotation, -rotation @ (before.position + scale * values[3:6]), before.focal * float(np.exp(values[6]))

        def errors(values: np.ndarray, use=use) -> np.ndarray:
            rotation, moved, length = placed(values)
            off = np.log(length / stated) / STATED if stated else 0.0
            return np.append(_apart(pixels[use], points[use], centre, rotation, moved, length).ravel(), off)

        solved = least_squares(errors, np.zeros(7), loss="huber", f_scale=0.3 * tolerance, x_scale="jac", max_nfev=60)
        rotation, shift, focal = placed(solved.x)
        apart = _apart(pixels, points, centre, rotation, shift, focal)
        length = np.linalg.norm(apart, axis=1)
        inside = np.flatnonzero(length < tolerance)
        if len(inside) < LEAST:
            return None
        residual = float(np.sqrt((length[inside] ** 2).mean()))
        within = pose_within(points[inside], rotation, shift, focal, apart[inside], pixels[inside] / (2 * np.asarray(centre)),
                             stated=stated is not None)
        pose = SolvedPose(rotation, shift, focal, inside, residual, _deviations(solved.jac, residual, scale), within, scale,
                          len(inside) / len(pixels))
    return pose


def distances(pixels: np.ndarray, points: np.ndarray, centre: tuple[float, float], pose: SolvedPose) -> np.ndarray:
    """(n,) pixels between where each point is seen from a pose and the place of its match."""
    return np.linalg.norm(_apart(pixels, points, centre, pose.rotation, pose.shift, pose.focal), axis=1)


def _apart(pixels, points, centre, rotation, shift, focal) -> np.ndarray:
    """(n, 2) pixels from where each point is seen to where its match lies; far off for points behind the camera."""
    seen = points @ rotation.T + shift
    ahead = np.maximum(seen[:, 2], 1e-9)
    apart = seen[:, :2] / ahead[:, None] * focal + centre - pixels
    return np.where((seen[:, 2] > 1e-9)[:, None], apart, 1e6)


def _deviations(jacobian: np.ndarray, residual: float, scale: float) -> tuple[float, float, float]:
    """Of place, direction and focal length.  scale: file units of a unit of the place."""
    information = jacobian.T @ jacobian / max(residual**2 / 2, 1e-12)
    try:
        variance = np.diag(np.linalg.inv(information))
    except np.linalg.LinAlgError:
        return np.inf, np.inf, np.inf
    turn, move, focal = (float(np.sqrt(np.abs(part).sum())) for part in (variance[:3], variance[3:6], variance[6:]))
    return move * scale, turn, focal
