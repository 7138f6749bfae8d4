"""The start viewpoint of a scan, chosen by the picture that it gives.

The scanner's position and the place where most was measured at eye height come first, as long as the scan surrounds them and
their picture is sharp.  Where it is not, because the points are sparse there or a wall is near, all places are compared: the
other scanners, free places on every storey, and places in the air above open ground.  A small picture of each
(viewer.work.places.small_picture) tells how good it would be.

Frame: file coordinates, file units; ``upright`` as in viewer.work.places.up_axis.  A function of the scan alone: the same scan
gives the same view.  No OpenGL, no window.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import each
from .free_places import free_places
from .outside_view import outside_sample, outside_view
from .small_picture import PictureSample, PictureScore, picture_sample, score
from .standing_place import (
    ENCLOSED,
    Sampled,
    azimuth_of,
    best_direction,
    enclosure,
    scanner_positions,
    standing_place,
    surroundings,
    way_ahead,
)
from .up_axis import turned

if TYPE_CHECKING:
    from ...grid.scene import Scene

_MOST = 200_000
"""Points of the sample, at most."""
_FEW, _SOME = 12_000, 40_000
"""Points of it by which all places, and the best of them, are compared.  Chosen for time."""
_ASPECT = 1.5
"""Width over height of the small pictures: between a square window and a wide one."""
SHARP_AT_SCANNER, SHARP_ENOUGH = 0.4, 0.7
"""Sharp share of the picture from which on a scanner's position, and the place where most was measured, is kept.  Measured: a
studio and a plant room 0.73 to 0.98 at all and at one in ten points, 0.43 and 0.73 at one in fifty; 0.33 at a street corner, in
front of a wall of single dots.  From a scanner nothing is hidden that was measured there, so less is enough."""
BLOCKED = 0.2
"""Share of the picture with surfaces nearer than an arm, from which on a place is no place to stand."""
_PLACES = 24
"""Places compared at each height."""
_FINALISTS = 5
"""Places whose pictures are compared with more points."""
_STATIONS = 8
"""Scanner positions compared, those with most points."""
_AZIMUTHS = 8
"""Directions compared at a place: neighbouring pictures of a window share half of their width."""
_PITCHES = (-0.04, -0.3)
"""Slope of the directions, level and looking down, of which the second is for places in the air."""
_BACK = (0.0, 3.0, 7.0, 14.0)
"""Metres that are stepped back from what is looked at where the picture becomes better: seen from there, points are nearer
together."""
_AT_SCANNER, _USUAL = 1.7, 1.2
"""How many times as good another picture must be for a scanner's position to be left; and for another one than the usual view
to be taken.  Chosen on a street corner (5 times as good) and on rooms with bare walls."""
GROUND = 0.8
"""Share of the picture straight down in which there must be surfaces: behind a wall, in a space that was not scanned, there is
no ground but the top of a fence."""
_DOWN = np.array([0.0, 0.0, -1.0])
SURROUNDED = 0.5
"""Share of the directions around another place in which there must be surfaces.  As ENCLOSED, but of small pictures, in which
sparse surfaces are closed."""


@dataclass(frozen=True, eq=False)
class View:
    """position, direction: (3,), upright world.  picture: its score.  surrounded: share of the directions near the horizon in
    which there are surfaces.  way: distance that one can walk ahead, relative to the usual one there, at most 1.  preferred:
    what its worth counts, more than 1 at a scanner.  known: whether its place is a scanner's or the usual one."""

    position: np.ndarray
    direction: np.ndarray
    picture: PictureScore
    surrounded: float = 1.0
    way: float = 1.0
    preferred: float = 1.0
    known: bool = False

    @property
    def worth(self) -> float:
        """By which views are compared.  Behind a wall, in a space that was not scanned, few directions have surfaces."""
        return self.picture.worth * self.surrounded**0.5 * self.way * self.preferred


def standing_view(scene: "Scene", seen: Sampled, upright: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray] | None:
    """(3,) position and (3,) direction of the view inside the scan that the window begins with; None for a scan that is
    looked at from outside, because nobody can stand in it or its points are too sparse to stand among.

    upright: (3, 3) as in viewer.work.places.up_axis, where another direction than +z is up.
    """
    upright = np.eye(3) if upright is None else upright
    return _standing(view_sample(scene, seen, upright), scene, seen, upright)


def standing_view_in(scene: "Scene", part: Sampled, upright: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """The same inside a part of the scene, one file among several: from outside other files would stand before it.

    part: the sample with the points of that file only.
    """
    return _standing(outside_sample(turned(part, upright)), scene, part, upright)


def _standing(sample: PictureSample, scene: "Scene", seen: Sampled,
              upright: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    view = start_view(sample, turned(seen, upright), scanner_positions(scene, seen) @ upright)
    return None if view is None else (upright @ view.position, upright @ view.direction)


def start_view(sample: PictureSample, level: Sampled, stations: np.ndarray) -> View | None:
    """The same in the upright world.  level: the coarse sample of the scan.  stations: (s, 3), that with most points first."""
    few = sample.thin(_FEW)
    usual: list[View] = []
    for scanner in (True, False):
        place = next(iter(stations), None) if scanner else standing_place(level)
        if place is not None and enclosure(level, place) >= ENCLOSED:
            direction = best_direction(level, place)
            view = View(place, direction, score(sample, place, direction, _ASPECT), preferred=_AT_SCANNER if scanner else 1.0)
            if view.picture.sharp >= (SHARP_AT_SCANNER if scanner else SHARP_ENOUGH) and view.picture.near < BLOCKED:
                return view
            usual.append(replace(view, surrounded=_surrounded(_ring(few, view))))
    known = [View(place, _DOWN, score(few, place, _DOWN, _ASPECT), preferred=_AT_SCANNER, known=True)
             for place in stations[:_STATIONS]]
    known += [replace(view, known=True) for view in usual if view.preferred == 1.0]
    familiar = [replace(view, preferred=view.preferred * _USUAL) for view in usual]
    best = max(familiar + _others(sample, few, level, known), key=lambda view: view.worth, default=None)
    if best is None or familiar:
        return best
    return best if best.picture.worth >= score(sample, *outside_view(level, _ASPECT), _ASPECT).worth else None


def view_sample(scene: "Scene", seen: Sampled, upright: np.ndarray) -> PictureSample:
    """The sample of the scan for small pictures, upright world: the coarse layers and a part of the next one.

    Points far outside the range of ``seen`` are left out.
    """
    from ...grid.scene import unpack

    whole = scene.coarse_points_within(_MOST)
    following = scene.coarse_points(whole + 1)
    parts = [unpack(scene, slice(0, whole))[:2]]
    if following > whole < _MOST:
        every = -(-(following - whole) // max(_MOST - whole, 1))
        parts.append(unpack(scene, slice(whole, following, every))[:2])
    points, rgb = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
    share = len(points) / max(scene.count, 1)
    brightest = rgb.max(axis=1, initial=0)
    slack = 0.1 * (seen.high - seen.low) + seen.metre
    kept = ((points >= seen.low - slack) & (points <= seen.high + slack)).all(axis=1)
    level = np.where(brightest > 8, brightest, 0)[kept].astype(np.float32) / 255
    return picture_sample(points[kept] @ upright, level, share, seen.spacing, seen.metre)


def _others(sample: PictureSample, few: PictureSample, level: Sampled, known: list[View]) -> list[View]:
    """The best views of the best of all places.  few: some points of the sample.  level: the coarse one.  known: views from
    places that are compared with those found here."""
    spacing = float(np.median(sample.spacing)) if len(sample.points) else 0.0
    free = free_places(sample.points, spacing, sample.metre, _PLACES) + sample.origin
    grounded = [View(place, _DOWN, score(few, place, _DOWN, _ASPECT)) for place in free]
    places = known + [view for view in grounded if view.picture.covered >= GROUND]
    some = sample.thin(_SOME)

    def looked(view: View) -> View:
        views = _ring(few, view)
        return replace(max(views, key=lambda view: view.picture.worth), surrounded=_surrounded(views))

    found = [view for view in each(looked, places) if view.surrounded >= SURROUNDED]
    best = sorted(found, key=lambda view: -view.worth)[:_FINALISTS]

    def refined(view: View) -> View:
        views = [found for pitch in _PITCHES for found in _ring(some, view, pitch)]
        if view.known:  # a window there must not win over the room
            way = way_ahead(surroundings(level, view.position), sample.metre)
            views = [replace(view, way=float(way[azimuth_of(view.direction)])) for view in views]
        best = max(views, key=lambda view: view.worth)
        position = best.position if view.known else _farther_back(some, best)
        return replace(best, position=position, picture=score(sample, position, best.direction, _ASPECT))

    return [view for view in each(refined, best) if view.picture.near < BLOCKED]


def _farther_back(sample: PictureSample, view: View) -> np.ndarray:
    """(3,) the place behind that of a view, above ground, from which its picture is best."""
    back = [view.position - step * sample.metre * view.direction * (1.0, 1.0, 0.0) for step in _BACK]
    stood = [place for place in back if score(sample, place, _DOWN, _ASPECT).covered >= GROUND]
    return max(stood, key=lambda place: score(sample, place, view.direction, _ASPECT).worth, default=view.position)


def _ring(sample: PictureSample, view: View, pitch: float = _PITCHES[0]) -> list[View]:
    """A view turned to all directions."""
    turns = 2 * np.pi / _AZIMUTHS * np.arange(_AZIMUTHS)
    directions = [np.array([np.cos(turn), np.sin(turn), pitch]) for turn in turns]
    return [replace(view, direction=direction, picture=score(sample, view.position, direction, _ASPECT))
            for direction in directions]


def _surrounded(ring: list[View]) -> float:
    return float(np.mean([view.picture.covered for view in ring]))
