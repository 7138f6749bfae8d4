"""The sign of distances: which of a surface's two normals is the positive one.

Positive is towards the scanner: towards the station of the point where its file states where that stood, else towards the
nearest station that the other cloud's file states.  Where neither file states any, positive is up, and where the surface is
steeper than STEEP, away from the middle of the cloud before.  Frame: file coordinates; up is the file's z.
"""

from dataclasses import dataclass

import numpy as np

STEEP = 0.17
"""Upward part of a unit normal below which a surface counts as upright: 80 degrees and steeper.  With 70 degrees the
signs of tests/unit/work/test_compare.py are the same, with 85 some at its walls are not."""
TEXTS = {"station": "towards the scanner", "nearest": "towards the nearest scanner of the scan before",
         "up": "up, and at walls away from the middle of the scan before",
         "model": "outside the model, by the orientation of its triangles"}  # fmt: skip
"""Rule -> what positive means, for a person."""


@dataclass(frozen=True, eq=False)
class Facing:
    """rule: a key of TEXTS.  middle: (3,) of the cloud before.  places: (S, 3) stations, NaN where one is not known: by number
    of the station ("station"), or in any order ("nearest")."""

    rule: str
    middle: np.ndarray
    places: np.ndarray

    def signs(self, normals: np.ndarray, xyz: np.ndarray, station: np.ndarray | None = None) -> np.ndarray:
        """(n,) float64, 1 or -1: factor that turns unit normals (n, 3) at places xyz (n, 3) to the positive side.

        station: (n,) numbers of the stations that measured the places, for the rule "station".
        """
        up = np.where(np.abs(normals[:, 2]) >= STEEP, normals[:, 2],
                      np.einsum("ij,ij->i", normals[:, :2], xyz[:, :2] - self.middle[:2]))  # fmt: skip
        if self.rule == "up" or not len(self.places):
            return np.where(up < 0, -1.0, 1.0)
        if self.rule == "station" and station is not None:
            place = self.places[station]
        else:
            known = self.places[np.isfinite(self.places).all(axis=1)]
            away = np.full(len(xyz), np.inf)
            place = np.full((len(xyz), 3), np.nan)
            for one in known:
                squared = ((xyz - one) ** 2).sum(axis=1)
                place[squared < away] = one
                away = np.minimum(away, squared)
        towards = np.einsum("ij,ij->i", normals, place - xyz)
        return np.where(np.where(np.isnan(towards), up, towards) < 0, -1.0, 1.0)


def facing_of(before: np.ndarray, before_places: np.ndarray, after_places: np.ndarray) -> Facing:
    """before: (n, 3).  before_places, after_places: (S, 3) of the stations of both files, NaN where one is not known."""
    middle = (before.min(axis=0) + before.max(axis=0)) / 2
    if np.isfinite(after_places).all(axis=-1).any():
        return Facing("station", middle, after_places)
    if np.isfinite(before_places).all(axis=-1).any():
        return Facing("nearest", middle, before_places)
    return Facing("up", middle, np.zeros((0, 3)))
