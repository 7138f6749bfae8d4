"""The points of a scan as arrays, with the colours of the viewer (after exposure compensation) and their stations, if known.

Frame: file coordinates, file units.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.data.dataset import MergedScan
from ...common.errors import InputError

if TYPE_CHECKING:
    from ...grid.scene import Scene

MOST_POINTS = 20_000_000
"""Largest number of points used, chosen at random from more.  Each takes 27 bytes, and again as many in a view that contains
it."""
LEAST_POINTS = 1000
"""Least number of points: HELD_OUT of them, 100, are withheld, and the RMS of so many errors has a standard error of
1 / sqrt(200), 7 %, or 0.6 dB of PSNR (as model.evaluation.heldout.LEAST_IN_GAPS)."""


def points_of(scene: "Scene", path: Path, *, most: int = MOST_POINTS, seed: int = 1) -> tuple[MergedScan, float]:
    """The points, thinned at random to about ``most``, and their spacing in file units.  path: for messages.

    Raises InputError if there are too few points, or if they have no colours of their own.
    """
    from ...grid.scene import CHUNK, unpack

    colour = scene.meta.colour
    if colour is not None and not colour.of_files:
        raise InputError(f"its points have no colours (shown by {colour.source}), which the evaluation requires", file=path)
    share, rng, parts = min(1.0, most / max(scene.count, 1)), np.random.default_rng(seed), []
    for start in range(0, scene.count, 16 * CHUNK):
        xyz, rgb, _, station = unpack(scene, slice(start, min(start + 16 * CHUNK, scene.count)))
        pick = slice(None) if share == 1.0 else rng.random(len(xyz)) < share
        parts.append((xyz[pick], rgb[pick], station[pick]))
    count = sum(len(part[0]) for part in parts)
    if count < LEAST_POINTS:
        raise InputError(f"{count} points are too few to withhold some; at least {LEAST_POINTS} are needed", file=path)
    xyz, rgb, station = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return MergedScan(xyz, rgb, station, scene.station_places), scene.spacing / share**0.5
