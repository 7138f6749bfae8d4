"""Finds where a photograph was taken: its features against those of rendered views, then against a view from the place found.

A pose is taken only if enough features, spread over the photograph, agree with it to a few pixels, and the photograph's colours
there are those of the points.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...picture.camera import Camera
from .picture_features import Features, features_of, matches
from .pose_solver import SolvedPose, distances, ransac_pose, refined_pose
from .reference_views import Draw, ReferenceView, view_of
from .repetitions import repeating_moves

Judge = Callable[[Camera], float]
"""Camera, at the size of the picture that is searched -> share of the points' differences in colour that the photograph
explains from there (viewer.render.photographs.photo_fit)."""
LONGEST = 1280
"""Pixels of a photograph's longer side at which its features are found."""
FEATURES = 4000
"""Of a photograph at most."""
BEST_VIEWS = 12
"""Views whose matches go into the first pose."""
FIRST_TOLERANCE, TOLERANCE = 0.008, 0.003
"""Share of the longer side within which a match agrees with the first pose, and with the refined one."""
REACH = (0.05, 0.02)
"""Share of the longer side within which matches are looked for in the views from the first and the second pose."""
FOCALS = tuple(0.5 * 1.15**step for step in range(11))
"""Focal lengths that are tried where the photograph states none, in longer sides: fields of view of 90 to 28 degrees."""
LEAST_MATCHES, CELLS = 25, 4
"""Consistent matches below which a pose is not believed, and of 16 parts of the photograph those that hold three of them."""
HYPOTHESES, AROUND = 5, 3.0
"""First poses that are followed up: arcades and rows of windows look alike from several places; the true one of that photograph
of atrium is the fourth.  Matches within so many tolerances of a pose say nothing about the next one."""
COLOURS = 0.5
"""Share of the points' differences in colour that a photograph explains at its place.  In atrium, kitchen and bathroom true
poses have 0.60 to 0.88; places that repeat an arch, a tile or a cupboard, with up to 930 features that agree, 0.03 to 0.42."""
RIVAL, ALIKE, WORSE = 0.6, 0.1, 0.15
"""Share of the best pose's matches with which another place makes it ambiguous whose colours agree, too, or explain at most
ALIKE less, but not WORSE less; and any place whose colours explain more.  Of a photograph between the arcades of atrium 1,400
features agree at its mirror image, 11 m off, where 0.72 is explained; at its place 1,000 and 0.60.  Of one of dining-room's
tiles, each the image of the next, two places, both 2.1 m off, explain 0.51 and 0.48; its true place, which _repeated adds,
0.74.  Of another one the true place has 0.74 and one beside 0.55."""

MOVES, FOLLOWED = 16, 3
"""Moves by which the scan repeats what the best pose shows that are judged by colours, and of those the best that are followed
up.  Matches of four of six photographs of dining-room's tiles lead to places beside the true one, and to it none; the true
place, moved there by the move alone, explains 0.71 to 0.74 of the differences, the others 0.64 at most."""

UNCERTAIN = 0.02, 0.5
"""Error that 95 of 100 poses stay below from which on one is called uncertain: of the place, as a share of the distance of what
the photograph shows, and of the direction, degrees: a choice; a search by colours then finds the rest (photo_fit)."""

AGREEING = 0.25
"""Share of the last matches, which lie near their places, that must agree: with fewer the pose is one of several that explain a
part of them, and its accuracy is unknown.  Of 144 fits to rendered views of six rooms six have 0.03 to 0.18, all of them
further off than their covariance says (5 to 20 cm); of the others, 0.31 and more, 98 % are not."""


@dataclass(frozen=True, eq=False)
class FoundPose:
    """camera: at the photograph's size, file coordinates.  residual: root mean square pixels of the photograph.  matches: that
    agree.  within: of pose_within, the angle in degrees; infinite: unknown.  uncertain: whether that is much."""

    camera: Camera
    residual: float
    matches: int
    within: tuple[float, float]
    uncertain: bool


@dataclass(frozen=True, eq=False)
class Agreeing:
    """A pose with the features of the photograph that agree with it, and their points (n, 3)."""

    pose: SolvedPose
    features: Features
    points: np.ndarray


@dataclass(frozen=True)
class NotFound:
    """why: for a person."""

    why: str


def find_pose(draw: Draw, judge: Judge, views: list[ReferenceView], origin: np.ndarray, picture: np.ndarray,
              size: tuple[int, int], name: str, stated: float | None) -> FoundPose | NotFound:
    """The pose of a photograph.

    picture: (h, w, 3) uint8 sRGB, LONGEST pixels at most.  size: width and height of the photograph's file.  stated: focal
    length in its pixels, None: unknown.
    """
    height, width = picture.shape[:2]
    longest, centre, scale = max(width, height), (width / 2, height / 2), max(size) / max(width, height)
    features = features_of(picture, FEATURES)
    pairs = [matches(features, view.features) for view in views]
    own = None if stated is None else stated / scale

    def followed(first: SolvedPose) -> Agreeing | None:
        place: Agreeing | None = Agreeing(first, features.chosen(np.empty(0, np.intp)), np.empty((0, 3)))
        for reach in REACH:
            place = place and _looked_again(draw, origin, features, (width, height), place.pose, reach, own)
        return place

    def explained(pose: SolvedPose) -> float:
        return judge(_camera(pose, origin, (width, height), name))

    found: list[Agreeing] = []
    for first in _first_poses(features, views, pairs, centre, longest, own):
        _add(found, followed(first))
    if not found:
        return NotFound("its features agree with no place in the scan")
    most = max(len(place.points) for place in found)
    found = [place for place in found if _believed(place, width, height)]
    if not found:
        return NotFound(f"only {most} of its features agree with a place in the scan")
    for first in _repeated(found, views, explained):
        if (place := followed(first)) is not None and _believed(place, width, height):
            _add(found, place)
    found.sort(key=lambda place: -len(place.points))
    shares = [explained(place.pose) for place in found]
    if max(shares) < COLOURS:
        return NotFound(f"{most} of its features agree with a place in the scan, but its colours explain only "
                        f"{100 * max(0.0, *shares):.0f} % of the differences between the points there")
    pose = _chosen(found, shares)
    if isinstance(pose, NotFound):
        return pose
    place, angle = (pose.within[0], float(np.degrees(pose.within[1]))) if pose.share >= AGREEING else (np.inf, np.inf)
    camera = _camera(pose, origin, (width, height), name)
    whole = Camera(*size, pose.focal * scale, pose.focal * scale, size[0] / 2, size[1] / 2, camera.camera_to_world, name)
    return FoundPose(whole, pose.residual * scale, len(pose.consistent), (place, angle),
                     place > UNCERTAIN[0] * pose.distance or angle > UNCERTAIN[1])  # fmt: skip


def _chosen(found: list[Agreeing], shares: list[float]) -> SolvedPose | NotFound:
    """Of places, those with the most matches first, the first whose colours agree, where no other one looks like it.

    shares: that their colours explain, one of them COLOURS or more."""
    taken = next(number for number, share in enumerate(shares) if share >= COLOURS)
    pose, limit = found[taken].pose, max(min(COLOURS, shares[taken] - ALIKE), shares[taken] - WORSE)
    for number, other in enumerate(found):
        many = len(other.points) > RIVAL * len(found[taken].points)
        if number != taken and ((many and shares[number] >= limit) or shares[number] > shares[taken]):
            apart = np.linalg.norm(other.pose.position - pose.position)
            return NotFound(f"ambiguous: two places in the scan, {apart:.3g} units apart, look like it")
    return pose


def _first_poses(features: Features, views: list[ReferenceView], pairs: list[np.ndarray], centre: tuple[float, float],
                 longest: int, stated: float | None) -> Iterator[SolvedPose]:
    """Poses that explain many matches, each by matches that those before do not explain.  pairs: of each view, as of
    matches."""
    places = [features.places[pair[:, 0]] for pair in pairs]
    points = [view.points[pair[:, 1]] for view, pair in zip(views, pairs)]
    tolerance = FIRST_TOLERANCE * longest
    focals = (stated,) if stated else tuple(longest * share for share in FOCALS)
    for _ in range(HYPOTHESES):
        chosen = sorted(range(len(views)), key=lambda number: -len(places[number]))[:BEST_VIEWS]
        pixels, there = np.concatenate([places[k] for k in chosen]), np.concatenate([points[k] for k in chosen])
        pose = ransac_pose(pixels, there, focals, centre, tolerance)
        if pose is None:
            return
        pose = refined_pose(pixels, there, centre, pose, tolerance, stated=stated) or pose
        yield pose
        focals = (pose.focal,)  # of one photograph
        for k in range(len(views)):
            left = distances(places[k], points[k], centre, pose) > AROUND * tolerance
            places[k], points[k] = places[k][left], points[k][left]


def _same(a: SolvedPose, b: SolvedPose) -> bool:
    """Whether two poses see the same: they stand within a hundredth of the shifts that tell places apart."""
    turned = np.arccos(np.clip((np.trace(a.rotation.T @ b.rotation) - 1) / 2, -1, 1))
    return bool(turned < 0.05 and np.linalg.norm(a.position - b.position) < 10 * min(a.deviations[0], b.deviations[0]))


def _add(found: list[Agreeing], place: Agreeing | None) -> None:
    """Appends a place that is not among them."""
    if place is not None and not any(_same(place.pose, other.pose) for other in found):
        found.append(place)


def _believed(place: Agreeing, width: int, height: int) -> bool:
    return len(place.points) >= LEAST_MATCHES and _cells(place.features.places, width, height) >= CELLS


def _repeated(found: list[Agreeing], views: list[ReferenceView], explained: Callable[[SolvedPose], float]) -> list[SolvedPose]:
    """Poses whose colours may agree, moved from that of ``found`` whose colours agree best to where the scan repeats what it
    shows."""
    best = max(found, key=lambda place: explained(place.pose))
    pose = best.pose
    beside = []
    for move in repeating_moves(best.features, best.points, pose.distance, views, MOVES):
        rotation = pose.rotation @ move.rotation.T
        beside.append(replace(pose, rotation=rotation, shift=pose.shift - rotation @ move.shift))
    shares = [explained(other) for other in beside]
    order = sorted(range(len(beside)), key=lambda number: -shares[number])[:FOLLOWED]
    return [beside[number] for number in order if shares[number] >= COLOURS - ALIKE]


def _looked_again(draw: Draw, origin: np.ndarray, features: Features, size: tuple[int, int], pose: SolvedPose,
                  reach: float, stated: float | None) -> Agreeing | None:
    """The pose by matches with the view from ``pose``."""
    longest, centre = max(size), (size[0] / 2, size[1] / 2)
    view = view_of(draw, _camera(pose, origin, size, ""), origin, FEATURES)
    pairs = matches(features, view.features, within=reach * longest)
    pixels, points = features.places[pairs[:, 0]], view.points[pairs[:, 1]]
    found = refined_pose(pixels, points, centre, pose, 2 * TOLERANCE * longest, stated=stated) if len(pairs) else None
    found = found and refined_pose(pixels, points, centre, found, TOLERANCE * longest, stated=stated)
    return found and Agreeing(found, features.chosen(pairs[found.consistent, 0]), points[found.consistent])


def _camera(pose: SolvedPose, origin: np.ndarray, size: tuple[int, int], name: str) -> Camera:
    placed = np.eye(4)
    placed[:3, :3] = pose.rotation.T @ np.diag([1.0, -1.0, -1.0])
    placed[:3, 3] = pose.position + origin
    return Camera(*size, pose.focal, pose.focal, size[0] / 2, size[1] / 2, placed, name)


def _cells(places: np.ndarray, width: int, height: int) -> int:
    """Of 4 x 4 parts of a picture, those that hold three places or more."""
    cell = np.minimum((places / (width, height) * 4).astype(int), 3)
    return int((np.bincount(cell[:, 1] * 4 + cell[:, 0], minlength=16) >= 3).sum())
