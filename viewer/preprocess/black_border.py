"""The rim of what a scanner could not see, where its photographs fade to black.

Under a tripod nothing is measured and nothing is photographed, and a ring of points around that hole takes the black beyond
the photographs' border for a colour.  The ring is thin, and yet all that is known around the hole: filled in from there, a
bright floor turns dark.  Such a point is dark, lies at the edge of what was measured, in one surface with its neighbours,
and they are bright.  Other dark points are not so: a cable stands off the wall behind it, a shadow goes on to all sides.
Where most of a file's dark points lie like that, they are the rim and no colour.
"""

import numpy as np

DARK = 16
"""Levels below which a colour may be a photograph's black border, blended in."""
_MOST_DARK, _LEAST = 0.01, 20  # a rim is thin: at most this share of the points; and as many as can be judged
_LOOKED, _NEIGHBOURS = 1000, 128
_ASIDE = 0.25
"""How far beside a point the mean of its neighbours lies, of the distance to the farthest: 0 within a surface, 0.42 at its
straight edge (the centroid of half a disc)."""
_OFF = 0.1
"""How far a point may stand off its neighbours' plane, of the same."""
_MOSTLY = 0.5
"""Share of the dark points that lie at a rim: 0.97 in plant_room.laz, at most 0.07 in eleven other scans, real and made."""


def rim_share(xyz: np.ndarray, rgb: np.ndarray) -> float:
    """Share of the points that are dark because they lie at the rim of what was photographed; 0.0 where dark is a colour.

    xyz: (n, 3) float64, any unit; rgb: (n, 3) uint8: a fair sample of one file's points.
    """
    brightness = rgb.max(axis=1)
    dark = np.flatnonzero(brightness < DARK)
    if not _LEAST <= len(dark) <= _MOST_DARK * len(xyz) or len(xyz) <= _NEIGHBOURS:
        return 0.0
    from scipy.spatial import KDTree  # half a second to import, and most scans need none

    looked = np.random.default_rng(0).choice(dark, min(len(dark), _LOOKED), replace=False)
    tree = KDTree(xyz, leafsize=64, balanced_tree=False, compact_nodes=False)
    distances, near = tree.query(xyz[looked], _NEIGHBOURS)
    from_point = xyz[near] - xyz[looked][:, None]
    reach = distances[:, -1:]
    middle = from_point.mean(axis=1)
    spread = from_point - middle[:, None]
    _, axes = np.linalg.eigh(spread.transpose(0, 2, 1) @ spread)
    off = np.abs((middle * axes[:, :, 0]).sum(axis=1))  # along the normal: the axis of the least spread
    aside = np.linalg.norm(middle, axis=1)
    bright = np.median(brightness[near], axis=1) > 3 * DARK
    at_rim = bright & (aside > _ASIDE * reach[:, 0]) & (off < _OFF * reach[:, 0])
    return len(dark) / len(xyz) if at_rim.mean() > _MOSTLY else 0.0
