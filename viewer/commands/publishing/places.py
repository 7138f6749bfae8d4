"""The places of a publication: scanner positions, viewpoints, cameras of a file, or places planned over the scan.

Frame: file coordinates, float64.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError, Option
from ...common.text import with_whole_characters
from ...work.places.free_places import free_places
from ...work.places.planned.covering_places import covering_places
from ...work.places.planned.human_scale import metre_of
from ...work.places.planned.outside_places import outside_places
from ...work.places.planned.standing_candidates import standing_candidates
from ...work.places.standing_place import sample_scene
from ...work.places.start_view import standing_view
from ...work.places.up_axis import turned, upright_axes
from ...work.places.walk_map import build_walk_map
from ...work.selection import Selection
from .place_choice import MOST, PLANNED

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...work.document import Document
    from .place_choice import PlaceChoice

_FREE = 240
"""Places that are looked at where no floor is known, at each height."""
_SAME = 0.05
"""Metres within which two places are one."""
PITCH = -9.0
"""Degrees of the first view: a little down, so that the rings of other places on the floor are in the picture."""


@dataclass(frozen=True, eq=False)
class Place:
    """name: for a person.  position: (3,) file coordinates.  heading: (3,) direction of the first view, file axes, not
    straight up or down; None: where most is in view.  metre: file units in a metre; of a file that does not say, as of
    viewer.work.places.planned.human_scale where the place was planned, else 1.  pitch: degrees of the first view.  below: file
    units from the eye down to what is beneath a place outside the scan; None: a floor is looked for.  around: whether it
    looks at a thing from outside, to which one is turned on arrival."""

    name: str
    position: np.ndarray
    heading: np.ndarray | None = None
    metre: float = 1.0
    pitch: float = PITCH
    below: float | None = None
    around: bool = False


def chosen_places(scene: "Scene", document: "Document", wanted: "PlaceChoice") -> list[Place]:
    """The places, at least one.  wanted: as of parse_places; auto: the scanner positions where they are known, else the
    project's viewpoints, else planned ones; cameras: in file coordinates.  Raises InputError where there are none of the kind
    asked for, or more than MOST."""
    found: list[Place] = []
    if wanted in ("stations", "auto"):
        found = _stations(scene, document)
        if not found and wanted == "stations":
            raise InputError("no scanner positions are known of this scan", option="--at", value=wanted,
                             remedy="give viewpoints, a camera file or a number")
    if wanted == "viewpoints" or (wanted == "auto" and not found):
        found = _viewpoints(document, scene)
        if not found and wanted == "viewpoints":
            raise InputError("no viewpoints are kept in this project", option="--at", value=wanted,
                             remedy="keep some in the window (K), or give stations, a camera file or a number")
    if isinstance(wanted, tuple):
        found = _cameras(wanted, document, scene)
    found = found or _planned(scene, document, wanted if isinstance(wanted, int) else PLANNED)
    if len(found) > MOST:
        raise InputError((f"{len(found):,} places, at most {MOST} are published; give a number to ", Option("--at")))
    return found


def _metre(scene: "Scene") -> float:
    metres = scene.meta.metres_per_unit
    return 1.0 / metres if metres else 1.0


def _stations(scene: "Scene", document: "Document") -> list[Place]:
    places, hidden = scene.scan_places, set(document.hidden_stations)
    known = [number for number in range(len(places)) if np.isfinite(places[number]).all() and number not in hidden]
    found: list[Place] = []
    for number in known:
        if _is_new(places[number], found, _metre(scene)):
            name = with_whole_characters(scene.meta.scans[number].name or f"Station {number + 1}")
            found.append(Place(name, places[number], metre=_metre(scene)))
    return found


def _viewpoints(document: "Document", scene: "Scene") -> list[Place]:
    found: list[Place] = []
    for view in document.viewpoints:
        if view.orthographic is not None:
            continue  # it stands nowhere
        pose = np.array(view.camera_to_world)
        if _is_new(pose[:3, 3], found, _metre(scene)):
            found.append(Place(view.name, pose[:3, 3], _level(-pose[:3, 2], document.up), _metre(scene)))
    return found


def _cameras(cameras: "tuple[Camera, ...]", document: "Document", scene: "Scene") -> list[Place]:
    found: list[Place] = []
    for camera in cameras:
        if camera.orthographic is None and _is_new(camera.position, found, _metre(scene)):
            found.append(Place(camera.name, camera.position, _level(camera.forward, document.up), _metre(scene)))
    return found


def _planned(scene: "Scene", document: "Document", most: int) -> list[Place]:
    """Places that see every surface; over or around a scan in which nobody can stand."""
    upright, seen = upright_axes(document.up), sample_scene(scene)
    sight = Selection.in_sight(scene, document.edits)
    walk = build_walk_map(sight, upright, seen.metre)
    if walk is not None and scene.meta.metres_per_unit is None and (metre := metre_of(walk)) != seen.metre:
        seen = replace(seen, metre=metre)
        walk = build_walk_map(sight, upright, metre)
    level, view = turned(seen, upright), standing_view(scene, seen, upright)
    if view is None:
        return [
            Place(f"Place {number}", upright @ place.position, upright @ place.direction, seen.metre, below=place.below,
                  around=place.around, pitch=float(np.degrees(np.arcsin(place.direction[2]))))
            for number, place in enumerate(outside_places(level, most, coarse=walk is None), 1)
        ]  # fmt: skip
    footing = None
    if walk is not None:
        eyes, areas, footing, roomy = standing_candidates(walk)
    else:  # too coarse to tell a step from a wall
        spacing = seen.spacing * float(np.sqrt(max(scene.count / max(len(seen.points), 1), 1.0)))
        eyes = free_places(level.points, spacing, seen.metre, _FREE)
        areas, roomy = np.zeros(len(eyes), int), np.ones(len(eyes), bool)
    home = areas == areas[np.linalg.norm(eyes - view[0] @ upright, axis=1).argmin()] if len(eyes) else areas == 0
    inside = level.points[((level.points >= level.low) & (level.points <= level.high)).all(axis=1)]
    # between the tanks of plant_room.laz one has to stand close to them; on the stairs of street_corner.laz nobody need stand
    kept = home | roomy | (not roomy.any())
    places = covering_places(inside, eyes[kept], home[kept], seen.metre, most, None if footing is None else footing[kept])
    places = places @ upright.T
    places = places if len(places) else view[0][None]
    return [Place(f"Place {number}", place, metre=seen.metre) for number, place in enumerate(places, 1)]


def _is_new(position: np.ndarray, found: list[Place], metre: float) -> bool:
    return all(np.linalg.norm(position - place.position) > _SAME * metre for place in found)


def _level(direction: np.ndarray, up) -> np.ndarray:
    """A unit vector across the up axis, along the direction where that is not up or down itself."""
    axes = upright_axes(up)
    flat = direction - (direction @ axes[:, 2]) * axes[:, 2]
    length = float(np.linalg.norm(flat))
    return flat / length if length > 1e-9 else axes[:, 0]
