"""The rigid transformation that brings points of one scan to the same points of another, which a person has clicked.

Least squares over all pairs (Kabsch, A solution for the best rotation to relate two sets of vectors, 1976; by the singular
value decomposition, Arun et al. 1987).  Frame: of either scan, float64, one unit of length for both; the transformation leads
from the moving scan's frame to that of the fixed one.
"""

from dataclasses import dataclass

import numpy as np

from ...common.errors import InputError
from ...common.rigid_transform import Rows, rigid

LEAST = 3
"""Pairs that determine a rotation and a shift."""
_THIN = 0.03
"""Width of the points across their longest direction, as a share of their length, from which on they determine the turn about
it: at 0.03 a click's error of 5 mm over 5 m of length turns what is 1 m beside the line by 33 mm."""
_UNITS = 1.5
"""Ratio of lengths in both scans beyond which they have different units: feet and metres differ by 3.28, yards by 1.09."""


@dataclass(frozen=True, eq=False)
class PairFit:
    """transform: from the moving to the fixed scan.  residuals: (n,) distance between the points of each pair after it.
    rms: their root mean square.  A clicked point is less certain than that: the fit takes six values from 3 n coordinates."""

    transform: Rows
    residuals: np.ndarray
    rms: float

    @property
    def worst(self) -> int:
        """Number of the pair that fits least, from 0."""
        return int(np.argmax(self.residuals))


def fit_pairs(moving: np.ndarray, fixed: np.ndarray) -> PairFit:
    """The transformation of (n, 3) points to their partners (n, 3).

    Raises InputError, in one line, where there are fewer than LEAST pairs, where the points lie on a line or at one place, or
    where the lengths between them differ as units of length do.
    """
    moving, fixed = np.asarray(moving, np.float64), np.asarray(fixed, np.float64)
    if moving.shape != fixed.shape or moving.ndim != 2 or moving.shape[1] != 3:
        raise InputError(f"pairs of points of shape {moving.shape} and {fixed.shape}: expected (n, 3) and (n, 3)")
    if len(moving) < LEAST:
        raise InputError(f"{len(moving)} pairs of points do not determine a turn and a shift; three or more do")
    if not (np.isfinite(moving).all() and np.isfinite(fixed).all()):
        raise InputError("a point of a pair has a coordinate that is no finite number")
    middles = moving.mean(axis=0), fixed.mean(axis=0)
    first, second = moving - middles[0], fixed - middles[1]
    for points, which in ((first, "moving"), (second, "fixed")):
        length, width, _ = np.linalg.svd(points, compute_uv=False)
        if length <= 1e-9 * max(1.0, float(np.abs(middles).max())) or width < _THIN * length:
            raise InputError(f"the points in the {which} scan lie on a line, about which it could still turn",
                             remedy="choose one of them away from that line")
    ratio = float(np.linalg.norm(second) / np.linalg.norm(first))
    if not 1 / _UNITS < ratio < _UNITS:
        raise InputError(f"the points are {ratio:.4g} times as far apart in the fixed scan: other units, or other points",
                         remedy="choose the same points in both scans; a scan is moved, not scaled")
    rotation = _rotation(first, second)
    transform = rigid(rotation, middles[1] - rotation @ middles[0])
    residuals = np.linalg.norm(first @ rotation.T - second, axis=1)  # of small numbers: map coordinates cost digits
    return PairFit(transform, residuals, float(np.sqrt((residuals**2).mean())))


def _rotation(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(3, 3): the rotation that brings points (n, 3) about 0 nearest to others; never a mirror image."""
    u, _, v = np.linalg.svd(second.T @ first)
    return u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ v))]) @ v
