"""Robust least squares of surfaces, with an uncertainty that holds where errors are not independent.

The distances of the points are minimised with Tukey's biweight by Gauss-Newton steps.  Points beside each other share errors:
a wall is not flat, a pipe not round, a scanner's noise grows at grazing incidence.  So the covariance is the larger of the
usual one, of independent errors, and that of a jackknife which leaves out one block of the surface at a time (Kuensch, The
Jackknife and the Bootstrap for General Stationary Observations, 1989; here in space, and by one Newton step each).
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from scipy.special import stdtrit

from .fit_loops import distances_of, median_of, moved_by, normal_equations
from .surfaces import Surface

One = TypeVar("One", bound=Surface)

TUKEY = 4.685
"""Distance at which a point stops counting, in standard deviations; 95 % efficient with normal errors (Huber, Robust
Statistics, 1981)."""
STEPS, STEPS_AT_FIRST = 40, 6
"""Of a fit that is stated, and while its points are still being found."""
BLOCKS = (16, 36)
"""Blocks of the jackknives, about: a standard error from B of them is itself uncertain by 1 / sqrt(2 (B - 1)), 18 and 12 %.
More blocks share errors with their neighbours; the larger value of both is stated."""
_MAD = 1.4826  # from the median of absolute deviations to the standard deviation of a normal distribution


@dataclass(frozen=True, eq=False)
class Fitted:
    """surface: the best one.  weights: (n,) in 0..1.  sigma: robust standard deviation of the distances, file units.
    errors: (p,) standard uncertainty of each parameter.  bounds: (p,) of systematic errors that are left.  coverage: factor to
    the expanded uncertainty at 95 %, 1.96 or more by Student's t."""

    surface: Surface
    weights: np.ndarray
    sigma: float
    errors: np.ndarray
    bounds: np.ndarray
    coverage: float
    structure: float

    def expanded(self, parameter: str) -> float:
        """Uncertainty of a parameter at 95 %, the bound added to the random part; of those with two values, the larger."""
        every = self.coverage * self.errors + self.bounds
        return max(float(value) for name, value in zip(self.surface.parameters, every, strict=True) if name == parameter)


def fitted(surface: Surface, points: np.ndarray, floor: float, sigma: float | None = None) -> Fitted:
    """The surface nearest to (n, 3) points, from a start near it.

    floor: least standard deviation of the distances, above 0, such as the rounding of the coordinates.  sigma: to begin with;
    None: that of the points' distances from the start.  Raises ValueError where the points do not determine the surface.
    """
    best, sigma = nearest(surface, points, floor, sigma, STEPS)
    distances, slopes = best.linearised(points)
    errors, coverage, structure = _errors(best, points, distances, slopes, sigma)
    return Fitted(best, _tukey(distances / sigma), sigma, errors, np.zeros(len(errors)), coverage, structure)


def nearest(surface: One, points: np.ndarray, floor: float, sigma: float | None = None,
            steps: int = STEPS_AT_FIRST) -> tuple[One, float]:
    """The surface, and the scatter around it, after so many steps at most, without uncertainties.  Otherwise as fitted."""
    points = np.ascontiguousarray(points, np.float64)
    place, frame, radius = surface.placed()
    parameters = len(surface.parameters)
    best = sigma if sigma is not None else scatter_of(distances_of(points, place, frame, radius), floor)
    for _ in range(steps):
        limit = TUKEY * best
        matrix, right, largest = normal_equations(points, place, frame, radius, parameters, limit)
        scale = np.maximum(largest, 1e-300)
        change = -_solved(matrix / np.outer(scale, scale), right / scale) / scale
        surface = surface.changed(change)
        before, (place, frame, radius) = (place, frame, radius), surface.placed()
        moved, distances = moved_by(points, *before, place, frame, radius, change, limit)
        if not np.isfinite(moved):
            raise ValueError("the points do not determine the surface")
        scatter, best = best, scatter_of(distances, floor)
        if moved < 1e-3 * best and abs(best - scatter) < 1e-3 * best:
            break
    return surface, best


def scatter_of(distances: np.ndarray, floor: float) -> float:
    """Robust standard deviation of distances around 0, at least ``floor``."""
    return max(_MAD * float(median_of(np.abs(distances))), floor) if len(distances) else floor


def _tukey(ratio: np.ndarray) -> np.ndarray:
    return np.maximum(1.0 - (ratio / TUKEY) ** 2, 0.0) ** 2


def _tukey_slope(ratio: np.ndarray) -> np.ndarray:
    """The derivative of ratio * weight."""
    square = (ratio / TUKEY) ** 2
    return np.where(square < 1.0, (1.0 - square) * (1.0 - 5.0 * square), 0.0)


def _solved(matrix: np.ndarray, right: np.ndarray) -> np.ndarray:
    try:
        return np.linalg.solve(matrix, right)
    except np.linalg.LinAlgError:
        raise ValueError("the points do not determine the surface") from None


def _errors(surface: Surface, points: np.ndarray, distances: np.ndarray, slopes: np.ndarray,
            sigma: float) -> tuple[np.ndarray, float, float]:
    """Standard uncertainty of each parameter, the coverage factor, and the structure of the errors."""
    ratio = distances / sigma
    scale = np.maximum(np.abs(slopes).max(axis=0), 1e-300)
    scaled = slopes / scale
    pull = scaled * (_tukey(ratio) * distances)[:, None]
    curve = _tukey_slope(ratio)
    whole = scaled.T @ (scaled * curve[:, None])
    inverse = _solved(whole, np.eye(len(whole)))
    count, parameters = slopes.shape
    independent = inverse @ (pull.T @ pull) @ inverse * count / max(count - parameters, 1)
    alone = np.maximum(np.diag(independent), 1e-300)
    variance, free = alone, count - parameters
    for block in (blocks(surface, points, size) for size in BLOCKS):
        number = int(block.max()) + 1
        if number < 2 * parameters:
            continue
        pulls = np.stack([np.bincount(block, pull[:, k], number) for k in range(parameters)], axis=1)
        curves = np.stack([[np.bincount(block, scaled[:, a] * scaled[:, b] * curve, number) for b in range(parameters)]
                           for a in range(parameters)])  # fmt: skip
        moves = np.stack([_solved(whole - curves[:, :, g], pulls[g]) for g in range(number)])
        jackknife = (number - 1) / number * ((moves - moves.mean(axis=0)) ** 2).sum(axis=0)
        variance, free = np.maximum(variance, jackknife), min(free, number - 1)
    return np.sqrt(variance) / scale, float(stdtrit(max(free, 1), 0.975)), float((variance / alone).mean())


def blocks(surface: Surface, points: np.ndarray, about: int) -> np.ndarray:
    """(n,) number of the block of the surface that each point lies in, from 0 without gaps.  about: how many there are."""
    unrolled = surface.unrolled(points)
    if surface.circumference is not None:  # begin behind the largest gap
        order = np.sort(unrolled[:, 0])
        gaps = np.diff(np.append(order, order[0] + surface.circumference))
        unrolled[:, 0] = (unrolled[:, 0] - order[(gaps.argmax() + 1) % len(order)]) % surface.circumference
    low, size = unrolled.min(axis=0), np.maximum(np.ptp(unrolled, axis=0), 1e-300)
    side = np.sqrt(size.prod() / about)
    number = np.clip(np.round(size / max(side, size.max() / about)), 1, about).astype(int)
    place = np.minimum((unrolled - low) / size * number, number - 1).astype(np.int64)
    return np.unique(place[:, 0] * number[1] + place[:, 1], return_inverse=True)[1]
