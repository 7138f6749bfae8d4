"""Detects points whose colour is the black border of a photograph.

Below the tripod nothing is measured or photographed.  A ring of points around that hole is coloured from beyond the border of
the photographs, in black.  The ring is thin, but the hole is filled from it, which turns a bright floor dark.  Such a point is
dark, lies at the edge of the measured surface and in one plane with its neighbours, and these are bright.  Other dark points
differ: a cable stands off the wall behind it, a shadow has dark points on all sides.  Where most of a file's dark points are
like border points, they are treated as missing colour.
"""

import itertools

import numpy as np

DARK = 16
"""8-bit levels below which a colour may be blended with a photograph's black border; tuned on plant_room.laz."""
_MOST_DARK, _LEAST_DARK = 0.01, 20  # share of dark points at most, since a border is thin; points at least
_EXAMINED = 1000  # dark points: they tell a share of a half within 0.016 (standard error), far less than its limits are apart
_NEIGHBOURS = 128  # of each; with 64 other dark points lost their colour (tests/unit/grid/test_black_border.py)
_CELLS = 32
"""Cells along the longest side by which the surroundings of the examined points are selected."""
_ASIDE = 0.25
"""Distance from a point to the mean of its neighbours, divided by that to the farthest: 0 within a surface, 0.42 at a straight
edge (the centroid of half a disc); the limit lies between them."""
_OFF = 0.1
"""Distance from a point to the plane of its neighbours, divided by the same.  Half and twice of it, of _MOST_DARK and of
_LEAST_DARK tell the same points in tests/unit/grid/test_black_border.py."""
_MOSTLY = 0.5
"""Share of the dark points that are like border points: 0.97 in plant_room.laz, at most 0.07 in eleven other scans, real and
synthetic; the limit lies between them."""


def brightest(rgb: np.ndarray) -> np.ndarray:
    """(n,) the highest channel of colours (n, 3): rgb.max(axis=1), which takes ten times as long."""
    return np.maximum(np.maximum(rgb[:, 0], rgb[:, 1]), rgb[:, 2])


def _neighbours(xyz: np.ndarray, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distances (m, _NEIGHBOURS), ascending, from places (m, 3) to their nearest points of xyz (n, 3), and which points these
    are.  Searched among the points around the places, where these are few: the search tree of all takes far longer."""
    from scipy.spatial import KDTree  # half a second to import, and most scans need none

    low = np.array([xyz[:, axis].min() for axis in range(3)])
    side = max(float(xyz[:, axis].max()) - low[axis] for axis in range(3)) / _CELLS
    if side > 0:
        marked = np.zeros((_CELLS + 3,) * 3, bool)
        x, y, z = ((places - low) / side).astype(np.int64).T + 1
        for dx, dy, dz in itertools.product((-1, 0, 1), repeat=3):
            marked[x + dx, y + dy, z + dz] = True
        cells = [((xyz[:, axis] - low[axis]) / side).astype(np.int32) + 1 for axis in range(3)]
        around = np.flatnonzero(marked[cells[0], cells[1], cells[2]])
        if _NEIGHBOURS <= len(around) < len(xyz) / 2:
            tree = KDTree(xyz[around], leafsize=64, balanced_tree=False, compact_nodes=False)
            distances, near = tree.query(places, _NEIGHBOURS)
            if distances.max() < side * (1 - 1e-9):  # all points within a cell's side of a place are among them
                return distances, around[near]
    distances, near = KDTree(xyz, leafsize=64, balanced_tree=False, compact_nodes=False).query(places, _NEIGHBOURS)
    return distances, np.asarray(near)


def black_border_share(xyz: np.ndarray, rgb: np.ndarray) -> float:
    """Share of the points that are dark because of a black border; 0.0 where dark is a colour.

    xyz: (n, 3) float64, any unit; rgb: (n, 3) uint8: a random sample of one file's points.
    """
    brightness = brightest(rgb)
    dark = np.flatnonzero(brightness < DARK)
    if not _LEAST_DARK <= len(dark) <= _MOST_DARK * len(xyz) or len(xyz) <= _NEIGHBOURS:
        return 0.0
    looked = np.random.default_rng(0).choice(dark, min(len(dark), _EXAMINED), replace=False)
    distances, near = _neighbours(xyz, xyz[looked])
    from_point = xyz[near] - xyz[looked][:, None]
    reach = distances[:, -1:]
    middle = from_point.mean(axis=1)
    spread = from_point - middle[:, None]
    _, axes = np.linalg.eigh(spread.transpose(0, 2, 1) @ spread)
    off = np.abs((middle * axes[:, :, 0]).sum(axis=1))  # along the normal, the axis of the smallest variance
    aside = np.linalg.norm(middle, axis=1)
    bright = np.median(brightness[near], axis=1) > 3 * DARK
    at_border = bright & (aside > _ASIDE * reach[:, 0]) & (off < _OFF * reach[:, 0])
    return len(dark) / len(xyz) if at_border.mean() > _MOSTLY else 0.0
