"""A scan's points as the viewer shows them, for what works on arrays: exposures matched, stations told apart where they can be.

Frame: file coordinates, file units.
"""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from model.data.dataset import Scan
from viewer.errors import InputError

if TYPE_CHECKING:
    from viewer.grid.scene import Scene

MOST_POINTS = 20_000_000
"""Points that are worked on, drawn at random from more: 27 bytes each, and as many again in a view that holds all of them."""
LEAST_POINTS = 1000
"""Points below which a tenth of them says nothing."""


def points_of(scene: "Scene", path: Path, *, most: int = MOST_POINTS, seed: int = 1) -> tuple[Scan, float]:
    """The points, thinned at random to about ``most``, and their spacing.  path: for messages.

    Raises InputError where they are too few, or coloured by height or intensity, which is nothing to judge a picture by.
    """
    from viewer.grid.scene import CHUNK, unpack

    source = (scene.meta.get("colour") or {}).get("source", "rgb")
    if source != "rgb":
        raise InputError(f"{path}: its points have no colours (shown by {source}), by which pictures would be judged")
    share, rng, parts = min(1.0, most / max(scene.count, 1)), np.random.default_rng(seed), []
    for start in range(0, scene.count, 16 * CHUNK):
        xyz, rgb, _, station = unpack(scene, slice(start, min(start + 16 * CHUNK, scene.count)))
        pick = slice(None) if share == 1.0 else rng.random(len(xyz)) < share
        parts.append((xyz[pick], rgb[pick], station[pick]))
    count = sum(len(part[0]) for part in parts)
    if count < LEAST_POINTS:
        raise InputError(f"{path}: {count} points are too few to withhold some; at least {LEAST_POINTS} are needed")
    xyz, rgb, station = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return Scan(xyz, rgb, station, scene.station_places), scene.spacing / share**0.5
