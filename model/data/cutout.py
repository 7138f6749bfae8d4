"""A piece of a room in a void: what teaches the network where nothing is, without a place that has a sky.

A box is cut out of a registered room, scan and truth alike.  A true pixel is covered where its surface lies in the box, void
where its ray misses the box or passes through it to a surface behind, and unknown where something outside the box stands
before it.  Furniture, plants and railings get outlines against nothing; floors and walls end as a scan's own border does.
World frame: the room's, metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice

import numpy as np

from model.data.dataset import MemoryPicture, Scan, TruePicture, TruePlace
from model.data.stations import StationScene

LEAST_COVERED = 0.04  # of a picture, for it to be worth learning from
TRIES = 8  # boxes, until some view shows enough of one
VIEWS_SHARE = 0.1
"""Of a room's pairs, so many more are those of its piece: enough to know a void, while most is learned of what is there."""


@dataclass(frozen=True, eq=False)
class CutOut:
    """``place`` within the box from ``low`` (3,) to ``high`` (3,); a TruePlace.  most: of its views, None: all."""

    place: TruePlace
    low: np.ndarray
    high: np.ndarray
    most: int | None = None

    @property
    def name(self) -> str:
        return f"{self.place.name} cut out"

    @property
    def views(self) -> Sequence[TruePicture]:
        """The views that show enough of it, or the first of them."""
        return _views(self)

    def scan(self, seed: int) -> Scan:
        """The part of the place's scan that lies in the box."""
        scan = self.place.scan(seed)
        inside = ((scan.xyz >= self.low) & (scan.xyz <= self.high)).all(1)
        return replace(scan, xyz=scan.xyz[inside], rgb=scan.rgb[inside], station=scan.station[inside])

    def cut(self, view: TruePicture) -> MemoryPicture | None:
        """The view with what lies outside taken away; None where its depth is unknown."""
        depth = view.depth()
        if depth is None:
            return None
        j, i = np.mgrid[0 : view.height, 0 : view.width] + 0.5
        ray = np.stack([(i - view.cx) / view.fl, -(j - view.cy) / view.fl, -np.ones_like(i)], -1)
        ray = ray @ view.camera_to_world[:3, :3].T  # z-depth is the length along it
        eye = view.camera_to_world[:3, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (self.low - eye) / ray, (self.high - eye) / ray
        enters, leaves = np.fmin(a, b).max(-1), np.fmax(a, b).min(-1)
        meets = (leaves > enters) & (leaves > 0)
        inside = meets & (depth >= enters) & (depth <= leaves)
        void = ~meets | (depth > leaves)
        return MemoryPicture(view.rgb(), view.fl, view.camera_to_world, np.where(inside, depth, np.inf).astype(np.float32),
                             inside.astype(np.float32), inside | void, (view.cx, view.cy))


@lru_cache(maxsize=4)
def _views(piece: CutOut) -> list[MemoryPicture]:
    shots = (piece.cut(view) for view in piece.place.views)
    enough = (s for s in shots if s is not None and s.covered is not None and s.covered.mean() > LEAST_COVERED)
    return list(islice(enough, piece.most))


def with_cut_outs(places: Sequence[TruePlace], seed: int) -> list[TruePlace]:
    """The places, and a piece of every registered room among them, in few views.

    Of other places none: their depth is not known, or (photographs) their points' colours are not those of the true pictures.
    """
    pieces = []
    for number, place in enumerate(places):
        if isinstance(place, StationScene):
            tried = cut_outs(place, TRIES, seed + number, max(1, round(VIEWS_SHARE * len(place.views))))
            pieces += islice((piece for piece in tried if piece.views), 1)
    return [*places, *pieces]


def cut_outs(place: TruePlace, count: int, seed: int, most: int | None = None) -> list[CutOut]:
    """``count`` seeded boxes of one to three metres around points of the place, none if it has none.  most: views of each."""
    rng = np.random.default_rng(seed)
    points = place.scan(seed).xyz
    boxes = []
    for _ in range(count if len(points) else 0):
        middle = points[rng.integers(len(points))]
        half = np.exp(rng.uniform(np.log(0.4), np.log(1.5), 3))
        boxes.append(CutOut(place, middle - half, middle + half, most))
    return boxes
