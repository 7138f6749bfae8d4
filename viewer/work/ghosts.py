"""Ghosts: what stood or walked in one station's scan and was gone when another station looked through the place.

Each station's points make a range image around it.  A point is a candidate where another station measured only what is clearly
farther in its direction, with rays close enough together not to have missed it, and no station measured anything at its
range.  Candidates count where they make up most of the points around them, hang together, and are wider than what the other
station's rays could have missed: thin things are kept.  (Visibility-based change detection as in Girardeau-Montaut
et al. 2005, with range images as in Underwood et al. 2013.)

Ghosts get a station number of their own in a copy of the scene, so that all that knows hidden stations can hide them; nothing
is removed from the scan or its cache.  Frame: file coordinates, file units.

The constants were set before the first measurement, and kept (README.md of this folder has it): registered rooms without a
registration error, cylinders for people.  Half and twice of SLACK, SHARE, VOXEL, LEAST_POINTS and 0.25 and 0.75 for MAJORITY
find what tests/unit/work/test_ghosts.py has.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..common.errors import InputError
from ..common.progress import progress
from ..grid.marked_points import MarkedPoints
from ..preprocess.scan_description import ScanSummary
from ..preprocess.scan_table import MOST_NUMBERS

if TYPE_CHECKING:
    from ..grid.scene import Scene

NAME = "ghosts (seen through by another station)"
"""Name of their station."""
BLOCK = 1 << 20
"""Points taken at a time: 28 MiB of coordinates."""
RAYS_PER_CELL = 4
"""Points of an average cell of a range image; sets its resolution."""
COARSEST, FINEST = 60, 1440
"""Columns of a range image.  The coarsest, of 6 degrees, are as wide as a person (0.44 m) at 4.2 m; stations of less than 7,200
points have them.  The finest, of 0.25 degrees, are 44 mm wide at 10 m, narrower than a hand; those of more than 4.1 million
have them."""
LEAST_RAYS = 9
"""Points in the 3 x 3 cells around a direction from which a station counts as having looked there: one a cell."""
SLACK, SHARE = 6.0, 0.03
"""How much farther the surface behind is at least: in spacings of the scan, and as a share of the range."""
VOXEL = 8.0
"""Side, in spacings of the scan, of the cubes in which candidates are counted and hang together."""
MAJORITY = 0.5
"""Share of a cube's points that are candidates where they count."""
LEAST_POINTS = 40
"""Points of a ghost: fewer are noise."""
MOST_MEMORY = 1 << 29
"""Bytes of all range images together; with many stations they get coarser."""


def with_ghosts(scene: "Scene") -> "Scene":
    """The scene with ghosts marked as a station of their own; see :func:`find_ghosts` for errors."""
    scans = scene.meta.scans
    if len(scans) >= MOST_NUMBERS:
        raise InputError(f"{len(scans)} stations: passers-by are found among {MOST_NUMBERS - 1} at most",
                         remedy="open the files of one part of the place")
    found = find_ghosts(scene)
    meta = replace(scene.meta, scans=(*scans, ScanSummary(NAME, len(found))))
    return replace(scene, meta=meta, marked=MarkedPoints(found, len(scans)))


def prepared(scene: "Scene", ghosts: str) -> "Scene":
    """The scene with ghosts marked where they are to be dimmed or hidden (``ghosts``: of the document) and are not yet."""
    return scene if ghosts == "shown" or scene.marked is not None else with_ghosts(scene)


def find_ghosts(scene: "Scene") -> np.ndarray:
    """Numbers of the points that are ghosts, ascending int64.

    Raises InputError where fewer than two scanner positions are known, or no station number is free.
    """
    places = scene.station_places
    known = np.flatnonzero(np.isfinite(places).all(axis=1))
    if len(known) < 2 or not (np.ptp(places[known], axis=0) > 0).any():
        raise InputError("passers-by are found by what other stations saw through them; "
                         f"this scan has {len(known)} station{'s' * (len(known) != 1)} with a known position: open two or more")
    if len(scene.meta.scans) >= 255:
        raise InputError("passers-by need a station number of their own; this scan has 255 stations or more")
    candidates, width = _candidates(scene, known, places[known])
    return candidates[_coherent(scene, candidates, width)]


def _candidates(scene: "Scene", known: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points seen through, and how wide a thing the rays could have missed there."""
    from .ghost_kernels import add_ranges, blurred_ranges, seen_through

    slot = np.full(256, -1, np.int16)
    slot[known] = np.arange(len(known))
    per_station = scene.count / len(known)
    columns = int(np.clip(np.sqrt(2 * per_station / RAYS_PER_CELL), COARSEST, FINEST))
    columns = min(columns, int(np.sqrt(2 * MOST_MEMORY / (11 * len(known))))) // 2 * 2
    shape = len(known), columns // 2, columns
    nearest, rays = np.full(shape, np.inf, np.float32), np.zeros(shape, np.uint16)
    for _, xyz, station in _blocks(scene, "range images"):
        add_ranges(xyz, station, slot, places, nearest, rays)
    near, enough = np.empty(shape, np.float32), np.empty(shape, np.uint8)
    blurred_ranges(nearest, rays, near, enough, LEAST_RAYS)
    numbers, widths = [], []
    width = np.empty(BLOCK, np.float32)
    for start, xyz, station in _blocks(scene, "looking for ghosts"):
        part = width[: len(xyz)]
        seen_through(xyz, station, slot, places, near, enough, SLACK * scene.spacing, SHARE, part)
        found = np.flatnonzero(part)
        numbers.append(found + start)
        widths.append(part[found])
    return np.concatenate(numbers), np.concatenate(widths)


def _coherent(scene: "Scene", candidates: np.ndarray, width: np.ndarray) -> np.ndarray:
    """(M,) bool: which candidates belong to something wide enough, of which they are most of the points."""
    if len(candidates) == 0:
        return np.zeros(0, bool)
    from ..grid.scene import unpack

    side = VOXEL * scene.spacing
    xyz = np.concatenate([unpack(scene, candidates[i : i + BLOCK])[0] for i in range(0, len(candidates), BLOCK)])
    cubes, cube_of = np.unique(_keys(xyz, scene, side), return_inverse=True)
    everything = np.zeros(len(cubes), np.int64)
    for _, block, _station in _blocks(scene, "points around ghosts"):
        keys = _keys(block, scene, side)
        at = np.minimum(np.searchsorted(cubes, keys), len(cubes) - 1)
        everything += np.bincount(at[cubes[at] == keys], minlength=len(cubes))
    counted = np.bincount(cube_of, minlength=len(cubes))
    most = counted > MAJORITY * everything
    part_of = _components(cubes, most)
    part = part_of[cube_of]
    kept = np.zeros(len(candidates), bool)
    order = np.argsort(part, kind="stable")
    edges = np.flatnonzero(np.diff(part[order])) + 1
    for members in np.split(order, edges):
        if part[members[0]] < 0 or len(members) < LEAST_POINTS:
            continue
        extent = np.sort(np.ptp(xyz[members], axis=0))
        kept[members] = extent[1] > np.median(width[members])
    return kept


def _components(cubes: np.ndarray, used: np.ndarray) -> np.ndarray:
    """(C,) int: the component of each used cube, neighbours over faces, edges and corners together; -1 for the others."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    part = np.full(len(cubes), -1)
    mine = cubes[used]
    if len(mine) == 0:
        return part
    pairs = []
    steps = [(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) > (0, 0, 0)]
    for x, y, z in steps:
        other = mine + (x << 2 * _BITS) + (y << _BITS) + z
        at = np.minimum(np.searchsorted(mine, other), len(mine) - 1)
        found = np.flatnonzero(mine[at] == other)
        pairs.append(np.stack([found, at[found]]))
    first, second = np.concatenate(pairs, axis=1)
    graph = coo_matrix((np.ones(len(first), bool), (first, second)), shape=(len(mine), len(mine)))
    part[used] = connected_components(graph, directed=False)[1]
    return part


_BITS = 21
"""Bits of a cube's number along an axis."""


def _keys(xyz: np.ndarray, scene: "Scene", side: float) -> np.ndarray:
    """(n,) int64: the cube of each point; one free number lies between rows, so that neighbours never wrap around."""
    side = max(side, float(np.ptp(scene.bounds, axis=0).max()) / ((1 << _BITS) - 4))
    cube = np.floor((xyz - scene.bounds[0]) / side).astype(np.int64) + 1
    return cube[:, 0] << 2 * _BITS | cube[:, 1] << _BITS | cube[:, 2]


def _blocks(scene: "Scene", label: str) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """(number of the first point, xyz (n, 3) float64, station (n,) uint8) of every part of the scan, with progress."""
    from ..grid.scene import unpack

    with progress(scene.count, label, "point") as meter:
        for start in range(0, scene.count, BLOCK):
            stop = min(start + BLOCK, scene.count)
            xyz, _, _, station = unpack(scene, slice(start, stop))
            yield start, xyz, station
            meter.update(stop - start)
