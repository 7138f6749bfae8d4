"""Two dates of a room, as files: the same floor, red in the first and blue in the second, with a box that moved."""

from pathlib import Path

import numpy as np

COLOURS = ((200, 60, 50), (50, 80, 200))
"""sRGB of the points of the two dates."""


def dates_in_colour(folder: Path, seed: int, count: int = 40_000) -> list[Path]:
    """The files ``before.xyz`` and ``after.xyz``: a floor of 4 x 4 at height 1 with a box upon it."""
    random, files = np.random.default_rng(seed), []
    for name, colour, left in zip(("before", "after"), COLOURS, (0.8, 2.2), strict=True):
        xyz = np.column_stack([random.uniform(0, 4, (count, 2)), random.normal(1, 0.002, count)])
        inside = (xyz[:, 0] > left) & (xyz[:, 0] < left + 1) & (xyz[:, 1] > 1.5) & (xyz[:, 1] < 2.5)
        xyz[inside, 2] += 0.5
        files.append(folder / f"{name}.xyz")
        np.savetxt(files[-1], np.column_stack([xyz, np.tile(colour, (count, 1))]), "%.4f %.4f %.4f %d %d %d")
    return files
