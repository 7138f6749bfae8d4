"""Reference implementations of the loops of splats: NumPy, one cell at a time.

Frame: relative to the lowest corner of the points, file units.
"""

from dataclasses import dataclass

import numpy as np

from pointglass.model.common.linear_light import to_linear
from pointglass.viewer.work.splats.shape_loops import FEW, FEWEST, FLAT, LEAST_WIDTH, STRAY, THIN


def cells_by_number(xyz: np.ndarray, side: float) -> dict[tuple[int, int, int], np.ndarray]:
    """Numbers along the axes -> rows of the points in the cell."""
    found: dict[tuple[int, int, int], list[int]] = {}
    for row, (x, y, z) in enumerate((xyz / side).astype(np.int64).tolist()):
        found.setdefault((x, y, z), []).append(row)
    return {number: np.array(rows) for number, rows in found.items()}


def chosen_cells(xyz: np.ndarray, side: float, highest: int, errors: list[dict[tuple[int, int, int], float]],
                 threshold: float) -> set[tuple[int, tuple[int, int, int]]]:  # fmt: skip
    """(level, numbers) of the cells that become splats: divided from the top while an error inside is above the threshold.

    errors: of each level, by numbers."""
    levels = [cells_by_number(xyz, side * 2**level) for level in range(highest + 1)]

    def worst(level: int, number: tuple[int, int, int]) -> float:
        inside = [worst(level - 1, below) for below in _below(number) if level and below in levels[level - 1]]
        return max([errors[level][number], *inside])

    def divide(level: int, number: tuple[int, int, int]) -> set[tuple[int, tuple[int, int, int]]]:
        if level == 0 or worst(level, number) <= threshold:
            return {(level, number)}
        return set().union(*(divide(level - 1, below) for below in _below(number) if below in levels[level - 1]))

    return set().union(*(divide(highest, number) for number in levels[highest]))


def _below(number: tuple[int, int, int]) -> list[tuple[int, int, int]]:
    x, y, z = number
    return [(2 * x + i, 2 * y + j, 2 * z + k) for i in range(2) for j in range(2) for k in range(2)]


@dataclass(frozen=True, eq=False)
class PlainSplat:
    """covariance: (3, 3) of the Gaussian.  Others as in splat_shapes.Shapes; done: the points around gave a plane."""

    centre: np.ndarray
    covariance: np.ndarray
    linear: np.ndarray
    faint: bool
    done: bool


def plain_splat(own: np.ndarray, own_rgb: np.ndarray, around: np.ndarray, around_rgb: np.ndarray, *, side: float, widest: float,
                alone: bool, noise: float, colour_noise: float, spread: float, lonely: float) -> PlainSplat:  # fmt: skip
    """The splat of the points ``own`` (m, 3) by the points ``around`` (n, 3), these among them.  rgb: uint8, all coloured.

    widest: side of the cube of the points around.  alone: they are the own points.  Others: as shape_loops.shapes."""
    middle, n, m = around.mean(axis=0), len(around), len(own)
    values, vectors = np.linalg.eigh((around - middle).T @ (around - middle) / n)
    values, (last, second, first) = np.maximum(values, 0), vectors.T
    done = n >= FEWEST and values[1] >= FLAT / 12 * widest**2
    faint, centre = not done, own.mean(axis=0)
    srgb, linear = around_rgb / 255.0, to_linear(own_rgb / 255.0).mean(axis=0)
    across = max(values[0] - noise**2, 0.0)
    wide, narrow = np.sqrt(12 * values[2]), np.sqrt(12 * values[1])
    if alone:
        unbiased = np.sqrt(n / (n - 1)) if n > 1 else 1.0
        wide, narrow = wide * unbiased, max(narrow * unbiased, LEAST_WIDTH * side)
        wide = max(wide, narrow)
    else:
        true = max(((srgb - srgb.mean(axis=0)) ** 2).mean() - colour_noise**2, 0.0)
        weight = true / max(true + colour_noise**2 / m, 1e-12)
        everywhere = to_linear(srgb).mean(axis=0)
        linear = everywhere + (linear - everywhere) * weight
        way = (middle - centre) @ last
        faint = faint or (m <= FEW and abs(way) > STRAY * np.sqrt(values[0]))
        if abs(way) < 3 * noise:
            centre = centre + way * (1 - across / max(across + noise**2 / m, 1e-300)) * last
        width = np.sqrt(wide * narrow * min(m / n, 1.0)) if done else wide * np.sqrt(m / n)
        wide = narrow = min(max(width, LEAST_WIDTH * side), lonely if faint else widest)
    thick = min(max(np.sqrt(across), THIN * spread * narrow), spread * narrow)
    axes = np.stack([first, second, last], axis=1) * [spread * wide, spread * narrow, thick]
    return PlainSplat(centre, axes @ axes.T, linear, faint, done)
