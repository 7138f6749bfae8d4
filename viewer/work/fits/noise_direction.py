"""What noise does to the fit of a bent surface on the average, and how unsure that is while the noise's direction is unknown.

Least squares takes the foot of a noisy point for the place that was measured.  Noise along the surface moves the foot, so a
radius comes out wrong by about sigma^2 / radius, times ten and more where only a third of a pipe is seen.  How much is found by
fitting again to points with noise of two kinds, which bound what scanners have: along their beam, which comes from the side
that is seen, and equal in all directions.  The middle of both effects is taken off, and half their difference is a bound of
what is left.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .least_squares import Fitted, nearest, scatter_of
from .surfaces import Cylinder

SIMULATED, PAIRS, ROUNDS = 500, 2, 2
"""Points of a simulation, and how many there are of each kind, each with noise of both signs: what changes sign cancels."""
UNSURE = 0.5
"""Share of a correction that is added to the bounds: it holds for normal noise on an evenly covered surface."""
_SEEN_FROM_ONE_SIDE = 0.3
"""Length of the mean normal from which a beam's direction is told: that of an arc of 270 degrees.  From one station at most
half a pipe is seen, 0.64; from all sides it is 0."""


def without_noise_bias(fit: Fitted, points: np.ndarray) -> Fitted:
    """The fit of a cylinder or a circle to (n, 3) points, corrected, with the bounds of what is left; of a plane as it is.
    Raises ValueError where points with such noise do not determine the surface."""
    if not isinstance(fit.surface, Cylinder):
        return fit
    some = points[np.linspace(0, len(points) - 1, min(SIMULATED, len(points))).astype(np.int64)]
    in_all = _effect(fit, some, _in_all_directions)
    along_beam = _effect(fit, some, _along_beam)
    middle, half = (along_beam + in_all) / 2, np.abs(along_beam - in_all) / 2
    return replace(fit, surface=fit.surface.changed(-middle), bounds=half + UNSURE * np.abs(middle))


Simulated = Callable[[Cylinder, np.ndarray, float, np.random.Generator], tuple[np.ndarray, np.ndarray]]
"""Surface, points and sigma -> feet (m, 3) of the points on the surface, and noise (PAIRS, m, 3)."""


def _effect(fit: Fitted, points: np.ndarray, simulated: Simulated) -> np.ndarray:
    """(p,) the change that leads from the surface which, with noise of this kind, gives the fit, to that fit: found by taking
    off from the fit what the noise does to the surface found last."""
    surface = fit.surface
    assert isinstance(surface, Cylinder)
    change, true = np.zeros(len(fit.errors)), surface
    for _ in range(ROUNDS):
        feet, noise = simulated(true, points, fit.sigma, np.random.default_rng(0))
        found = [nearest(true, feet + each, 0.25 * fit.sigma, fit.sigma, 12)[0] for pair in noise for each in (-pair, pair)]
        change = np.mean([true.change_to(one) for one in found], axis=0)
        true = surface.changed(-change)
        if true.radius < 0.3 * surface.radius:
            raise ValueError("the noise is as large as the bend")
    return change


def _in_all_directions(surface: Cylinder, points: np.ndarray, sigma: float,
                       rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    feet = points - surface.distances(points)[:, None] * surface.normals(points)
    return feet, sigma * rng.normal(size=(PAIRS, len(feet), 3))


def _along_beam(surface: Cylinder, points: np.ndarray, sigma: float,
                rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    normals, distances = surface.normals(points), surface.distances(points)
    feet, beam = points - distances[:, None] * normals, normals.mean(axis=0)
    if np.linalg.norm(beam) < _SEEN_FROM_ONE_SIDE:  # from all sides: each point from its own
        return feet, sigma * rng.normal(size=(PAIRS, len(feet), 1)) * normals
    beam /= np.linalg.norm(beam)
    towards = normals @ beam
    facing = towards > 0.5 * towards.max()
    size = scatter_of(distances[facing] / towards[facing], 0.0)
    lit = towards > size / surface.radius  # what noise has put beyond the edge is not seen from there
    if 4 * lit.sum() >= len(points):
        feet = feet[lit]
    return feet, size * rng.normal(size=(PAIRS, len(feet), 1)) * beam
