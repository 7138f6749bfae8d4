"""Reference implementations of distances between clouds: NumPy and a k-d tree, one place at a time.

They say what the compiled loops compute (viewer.work.comparing.surface_kernels and m3c2_kernels) and are compared with them on
random points.  Frame: any that both clouds share, file units.  Normals have either sign.
"""

import numpy as np
from scipy.spatial import KDTree

from pointglass.viewer.work.comparing.local_plane import FEWEST
from pointglass.viewer.work.comparing.m3c2_kernels import ENOUGH, GAP, LATERAL, LEAST, WIDENINGS, quantile95
from pointglass.viewer.work.comparing.surface_kernels import BALANCE, BEND


def plane_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The plane through (n, 3) points: middle (3,), normal (3,), axes in it (2, 3), variances (3,): about the plane with n - 3
    degrees of freedom, and along the axes with n."""
    middle = points.mean(axis=0)
    values, vectors = np.linalg.eigh((points - middle).T @ (points - middle) / len(points))
    about = max(values[0], 0.0) * len(points) / (len(points) - 3)
    return middle, vectors[:, 0], vectors[:, 1:].T, np.array([about, *values[1:]])


def surface_distances(places: np.ndarray, surface: np.ndarray, *, limit: float, radius: float, own: float,
                      scatter: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Distances (n,), variances (n,) and normals (n, 3) of places (n, 3) from the surface that (m, 3) points are of.

    Arguments: as for surface_kernels.distances_from_surface.  NaN, and a normal of 0, where there is no counterpart.
    """
    tree = KDTree(surface)
    distance, variance = np.full(len(places), np.nan), np.full(len(places), np.nan)
    normals = np.zeros((len(places), 3))
    for i, place in enumerate(places):
        away, nearest = tree.query(place)
        if away > limit:
            continue
        around = surface[tree.query_ball_point(surface[nearest], radius)]
        if len(around) < FEWEST:
            continue
        middle, normal, _, _ = plane_of(around)
        foot = place - (place - middle) @ normal * normal
        if np.linalg.norm(foot - middle) > 2 * radius:
            continue
        around = surface[tree.query_ball_point(foot, radius)]
        if len(around) < FEWEST:
            continue
        middle, normal, axes, variances = plane_of(around)
        found = (place - middle) @ normal
        offset = place - found * normal - middle
        if np.linalg.norm(offset) > BALANCE * radius or abs(found) > limit:
            continue
        n, spread = len(around), variances[0]
        distance[i], normals[i] = found, normal
        bend = max(spread - scatter**2 * (1 + 2 * np.sqrt(2 / (n - 3))), 0.0)
        variance[i] = max(own**2, spread) + spread / n * (1 + ((axes @ offset) ** 2 / variances[1:]).sum()) + BEND**2 * bend
    return distance, variance, normals


def m3c2_distances(cores: np.ndarray, after: np.ndarray, before: np.ndarray, *, scale: float, diameter: float, depth: float,
                   noise: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Distances (n,), levels of detection (n,), normals (n, 3) and counts (n, 2) at core points (n, 3).

    Arguments: as for m3c2_kernels.m3c2_at.  NaN, and counts of 0, where there is no counterpart.
    """
    trees = KDTree(after), KDTree(before)
    distance, level = np.full(len(cores), np.nan), np.full(len(cores), np.nan)
    normals, counts = np.zeros((len(cores), 3)), np.zeros((len(cores), 2), np.int64)
    for i, core in enumerate(cores):
        balls = [after[trees[0].query_ball_point(core, 0.5 * scale * 2**turn)] for turn in range(WIDENINGS)]
        around = next((ball for ball in balls if len(ball) >= ENOUGH), balls[-1])
        if len(around) < FEWEST:
            continue
        _, normal, _, variances = plane_of(around)
        normals[i] = normal
        gap = GAP * max(noise, float(np.sqrt(variances[0])))
        for turn in range(WIDENINGS):
            radius = 0.5 * diameter * 2**turn
            inside = []
            for tree, cloud in zip(trees, (after, before)):
                near = cloud[tree.query_ball_point(core, np.hypot(radius, depth))] - core
                along = near @ normal
                across = near - along[:, None] * normal
                held = (np.abs(along) <= depth) & (np.linalg.norm(across, axis=1) <= radius)
                inside.append((along[held], across[held]))
            if min(len(along) for along, _ in inside) < LEAST:
                continue
            runs = _two_runs(inside[0][0], inside[1][0], gap)
            if runs is None or min(run.sum() for run in runs) < LEAST:
                continue
            surfaces = [(int(run.sum()), float(along[run].mean()), float(along[run].var(ddof=1)), across[run].mean(axis=0))
                        for run, (along, across) in zip(runs, inside)]
            (n, mean, spread, middle), (m, other_mean, other_spread, other_middle) = surfaces
            if np.linalg.norm(middle - other_middle) > LATERAL * radius:
                continue
            distance[i], counts[i] = mean - other_mean, (n, m)
            a, b = spread / n, other_spread / m
            freedom = (a + b) ** 2 / (a**2 / (n - 1) + b**2 / (m - 1)) if a + b > 0 else min(n, m) - 1
            level[i] = quantile95(freedom) * np.sqrt(a + b)
            if min(n, m) >= ENOUGH:
                break
    return distance, level, normals, counts


def _two_runs(after: np.ndarray, before: np.ndarray, gap: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Which places along the axis, (n,) and (m,) bool, are those of the surface at the core point and of its counterpart; None
    where it has none.  See m3c2_kernels.two_surfaces."""
    nearest = after[np.argmin(np.abs(after))]
    low, high = _run(np.concatenate([after, before]), nearest, gap)
    one, other = (after >= low) & (after <= high), (before >= low) & (before <= high)
    if other.sum() >= LEAST:
        return one, other
    low, high = _run(before, after[one].mean(), gap)
    other = (before >= low) & (before <= high)
    low, high = _run(after, before[other].mean(), gap)
    if not low <= nearest <= high and ((after >= low) & (after <= high)).sum() >= LEAST:
        return None
    return one, other


def _run(along: np.ndarray, begin: float, gap: float) -> tuple[float, float]:
    """Ends of the run without gaps that holds the place nearest to ``begin``."""
    along = np.sort(along)
    runs = np.split(along, np.flatnonzero(np.diff(along) > gap) + 1)
    nearest = along[np.argmin(np.abs(along - begin))]
    run = next(run for run in runs if run[0] <= nearest <= run[-1])
    return float(run[0]), float(run[-1])
