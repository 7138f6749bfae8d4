"""Cut-outs: a box of a room against an empty background, which teaches coverage without a place that has a sky.

A box is cut out of a registered room, both scan and true pictures.  A true pixel is covered where its surface lies in the box,
background where its ray misses the box or passes through it to a surface behind, and unknown where a surface in front of the
box occludes it.  Furniture, plants and railings get outlines against the background; floors and walls end as at the border of a
scan.  World frame: the room's, metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import islice

import numpy as np

from ..dataset import MemoryPicture, MergedScan, TruePicture, TruePlace
from ..stations import StationScene

MIN_COVERED = 0.04
"""Smallest covered share of a picture of a cut-out.  Chosen by hand."""
TRIES = 8
"""Boxes tried until a view shows enough of one.  Chosen by hand."""
VIEWS_SHARE = 0.1
"""Views of a cut-out as a share of the room's: enough to learn background, while most pairs show surfaces.  Chosen by hand."""


@dataclass(frozen=True, eq=False)
class CutOut:
    """A TruePlace: the part of ``place`` in the box from ``low`` (3,) to ``high`` (3,).  most: number of views, None: all."""

    place: TruePlace
    low: np.ndarray
    high: np.ndarray
    most: int | None = None

    @property
    def name(self) -> str:
        return f"{self.place.name} cut out"

    @property
    def views(self) -> Sequence[TruePicture]:
        """The first ``most`` views that show enough of the box."""
        return _views(self)

    def scan(self, seed: int) -> MergedScan:
        """The part of the place's scan that lies in the box."""
        scan = self.place.scan(seed)
        inside = ((scan.xyz >= self.low) & (scan.xyz <= self.high)).all(1)
        return replace(scan, xyz=scan.xyz[inside], rgb=scan.rgb[inside], station=scan.station[inside])

    def cut(self, view: TruePicture) -> MemoryPicture | None:
        """The view with only the contents of the box; None where its depth is unknown."""
        depth = view.depth()
        if depth is None:
            return None
        j, i = np.mgrid[0 : view.height, 0 : view.width] + 0.5
        ray = np.stack([(i - view.cx) / view.fl, -(j - view.cy) / view.fl, -np.ones_like(i)], -1)
        ray = ray @ view.camera_to_world[:3, :3].T  # of length 1 in z, so that z-depth is the parameter along it
        eye = view.camera_to_world[:3, 3]
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (self.low - eye) / ray, (self.high - eye) / ray
        enters, leaves = np.fmin(a, b).max(-1), np.fmax(a, b).min(-1)
        meets = (leaves > enters) & (leaves > 0)
        inside = meets & (depth >= enters) & (depth <= leaves)
        background = ~meets | (depth > leaves)
        return MemoryPicture(view.rgb(), view.fl, view.camera_to_world, np.where(inside, depth, np.inf).astype(np.float32),
                             inside.astype(np.float32), inside | background, (view.cx, view.cy))


@lru_cache(maxsize=4)
def _views(piece: CutOut) -> list[MemoryPicture]:
    cut = (piece.cut(view) for view in piece.place.views)
    enough = (view for view in cut if view is not None and view.covered is not None and view.covered.mean() > MIN_COVERED)
    return list(islice(enough, piece.most))


def with_cut_outs(places: Sequence[TruePlace], seed: int) -> list[TruePlace]:
    """The places, and a cut-out with few views of every registered room among them.

    Other places have no cut-out: their depth is unknown, or (photographs) their points do not have the true pictures' colours.
    """
    pieces = []
    for number, place in enumerate(places):
        if isinstance(place, StationScene):
            tried = cut_outs(place, TRIES, seed + number, max(1, round(VIEWS_SHARE * len(place.views))))
            pieces += islice((piece for piece in tried if piece.views), 1)
    return [*places, *pieces]


def cut_outs(place: TruePlace, count: int, seed: int, most: int | None = None) -> list[CutOut]:
    """``count`` random boxes with sides of 0.8 to 3 m around points of the place; none without points.  most: views of each."""
    rng = np.random.default_rng(seed)
    points = place.scan(seed).xyz
    boxes = []
    for _ in range(count if len(points) else 0):
        middle = points[rng.integers(len(points))]
        half = np.exp(rng.uniform(np.log(0.4), np.log(1.5), 3))
        boxes.append(CutOut(place, middle - half, middle + half, most))
    return boxes
