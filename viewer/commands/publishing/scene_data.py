"""What the page knows of a scene besides its pictures: places, viewpoints, notes, measurements, plans, units.

Frame: the upright world relative to ``origin``, file units; ``axes`` turn it back into file coordinates.
"""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ... import __version__
from ...grid.scene import unpack
from ...work.measuring.measure_text import unit_name
from ...work.notes.annotation import STATUSES, is_address
from ...work.places.up_axis import upright_axes
from ...work.selection import Selection
from .data_scripts import alpha_png, base64_text
from .measured_data import measurements_data
from .plan_picture import Plan, plan_of, storeys

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...work.document import Document
    from .places import Place

EYE = 1.6
"""Metres above the floor, where nothing was found below a place."""
_FLOOR = (0.5, 4.0)
"""Metres below the eye between which what lies there is taken for a floor."""
_PLAN_POINTS = 4_000_000
"""Points of the coarse layers from which plans are drawn, at most."""


def scene_data(scene: "Scene", document: "Document", places: "list[Place]", records: list[dict[str, Any]], *, title: str,
               view: str, attached: Mapping[int, tuple[int, int]]) -> dict[str, Any]:
    """The value of scene.js.  records: of each place: near and step of its depths, floor, the distance down to a surface (0:
    none), and yaw, degrees, where most is in view.  attached: number of a note -> (width, height) of its picture."""
    metre, axes = places[0].metre, upright_axes(document.up)
    origin = np.round(scene.bounds.mean(axis=0))
    stands = np.stack([place.position for place in places])
    local = (stands - origin) @ axes
    below = [record["floor"] for record in records]
    height = np.array([down if _FLOOR[0] * metre < down < _FLOOR[1] * metre else EYE * metre for down in below])
    outside = [place.below is not None for place in places]
    height = np.where(outside, [place.below or 0.0 for place in places], height)
    floors = local[:, 2] - height
    storey, plans = plans_of(scene, document, local, None if all(outside) else floors, origin, metre)
    unit = unit_name(scene.meta.metres_per_unit)
    return {
        "generator": f"pointglass {__version__}", "title": title, "view": view,
        "unit": unit, "metre": metre, "origin": origin.tolist(), "axes": axes.tolist(),
        "spacing": scene.spacing,
        "places": [
            {"name": place.name, "position": local[number].tolist(), "floor": float(floors[number]),
             "yaw": record["yaw"] if place.heading is None else _yaw(place.heading @ axes), "pitch": place.pitch,
             "around": place.around, "plan": int(storey[number]), "near": record["near"], "step": record["step"]}
            for number, (place, record) in enumerate(zip(places, records, strict=True))],
        "plans": [{"picture": base64_text(alpha_png(plan.alpha)), "low": plan.low.tolist(), "high": plan.high.tolist(),
                   "width": plan.alpha.shape[1], "height": plan.alpha.shape[0]} for plan in plans],
        "viewpoints": [_viewpoint(view, stands, axes) for view in document.viewpoints if view.orthographic is None],
        "notes": [
            {"title": note.title(number), "text": note.text, "status": STATUSES[note.status].name,
             "link": note.link if is_address(note.link) else "",
             "colour": "#{:02x}{:02x}{:02x}".format(*STATUSES[note.status].rgb),
             "position": ((np.array(note.position) - origin) @ axes).tolist(), "picture": attached.get(number)}
            for number, note in enumerate(document.annotations)],
        "measurements": measurements_data(document.measurements, unit, lambda points: (points - origin) @ axes),
    }  # fmt: skip


def plans_of(scene: "Scene", document: "Document", local: np.ndarray, floors: np.ndarray | None,
             origin: np.ndarray, metre: float) -> tuple[np.ndarray, list[Plan]]:
    """The storey of each place (n,), and the plan of each storey.  local: (n, 3) places, upright, relative to the origin.
    floors: (n,) heights of the floors under them; None: they are outside, over or around the scan.  metre: file units in a
    metre."""
    points = _points(scene, document, origin, upright_axes(document.up))
    if floors is None:
        return np.zeros(len(local), int), [plan_of(points, local, None, metre)]
    storey = storeys(floors, metre)
    return storey, [plan_of(points, local[storey == level], float(np.median(floors[storey == level])), metre)
                    for level in range(storey.max() + 1)]


def _points(scene: "Scene", document: "Document", origin: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """(N, 3) the points in sight of the coarse layers, which are spread as all are."""
    head = scene.coarse_points(_PLAN_POINTS)
    some = slice(0, head, -(-head // _PLAN_POINTS))
    xyz, _, _, station = unpack(scene, some)
    return (xyz[Selection.in_sight(scene, document.edits).keeps(xyz, station, some)] - origin) @ axes


def _yaw(direction: np.ndarray) -> float:
    """Degrees counter-clockwise from the first axis of the upright world."""
    return float(np.degrees(np.arctan2(direction[1], direction[0])))


def _viewpoint(view, stands: np.ndarray, axes: np.ndarray) -> dict[str, Any]:
    """A viewpoint at the place next to it."""
    pose = np.array(view.camera_to_world)
    ahead = -pose[:3, 2] @ axes
    away = np.linalg.norm(stands - pose[:3, 3], axis=1)
    return {"name": view.name, "place": int(away.argmin()), "yaw": _yaw(ahead),
            "pitch": float(np.degrees(np.arcsin(np.clip(ahead[2], -1, 1)))), "fov": float(view.vertical_fov),
            "away": float(away.min())}
