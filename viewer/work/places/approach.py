"""Where to look at a measured point from: near it, facing its surface, with free sight.  Used by a double click.

Frame: file coordinates and units.  A wall is seen at right angles, at the height of the point; a floor, a table or a ceiling at
an angle of SLANT, from the side on which the eye is.  Where something stands in the way, the direction turns back toward the
present one, along which the point is seen.
"""

from typing import TYPE_CHECKING

import numpy as np

from .pick import Surface, surface_around

if TYPE_CHECKING:
    from ...grid.scene import Scene

SPACINGS = 250.0
"""Distance from the surface in point spacings: at 60 degrees on 720 rows, points are then 2.5 pixels apart."""
NEAREST, FARTHEST = 1.5, 6.0
"""Metres from the surface, at least and at most; but never more than half of the present distance."""
SLANT = np.radians(35.0)
"""Angle between the line of sight and a floor or ceiling."""
LEVEL = 0.7
"""Cosine between a surface's normal and up from which on it is a floor or ceiling."""
_TURNS = (1.0, 0.75, 0.5, 0.25, 0.0)
"""Shares of the way from the present direction to the facing one, tried in this order."""
_LOOKED_AT = 7
"""Places along the line of sight around which points would stand in the way; the balls overlap."""


def approach(scene: "Scene", eye: np.ndarray, point: np.ndarray, up: np.ndarray, metre: float) -> tuple[np.ndarray, np.ndarray]:
    """Position (3,) and direction (3,), a unit vector, from which to look at ``point`` (3,).

    eye: (3,) the present position, from which the point is seen.  up: (3,) unit vector.  metre: file units in a metre.
    """
    away = np.asarray(eye, np.float64) - point
    distance = float(np.linalg.norm(away))
    if distance == 0.0:
        raise ValueError("the eye lies in the point it is to look at")
    away /= distance
    surface = surface_around(scene, point)
    stop = min(float(np.clip(SPACINGS * (surface.spacing if np.isfinite(surface.spacing) else scene.spacing),
                             NEAREST * metre, FARTHEST * metre)), distance / 2)
    facing = facing_direction(surface, away, up)
    for share in _TURNS:
        along = _between(away, facing, share)
        if share == 0.0 or _free(scene, point, along, stop):
            return point + stop * along, -along
    raise AssertionError("the last direction is always taken")


def facing_direction(surface: Surface, away: np.ndarray, up: np.ndarray) -> np.ndarray:
    """(3,) unit vector from a surface to the place from which it is best looked at.

    away: (3,) unit vector from the surface to the present eye.  Where too few points tell a plane: ``away``.
    """
    normal = np.array(surface.normal)
    if surface.count < 4 or not np.isfinite(normal).all():
        return away
    normal = normal if normal @ away >= 0 else -normal
    steep = float(normal @ up)
    ground = away if abs(steep) >= LEVEL else normal
    level = ground - (ground @ up) * up
    length = float(np.linalg.norm(level))
    if length < 1e-6:  # straight above a floor: the direction in which one looks is unknown, so it stays
        return away
    level /= length
    if abs(steep) >= LEVEL:
        return np.cos(SLANT) * level + np.copysign(np.sin(SLANT), steep) * up
    return level


def _between(start: np.ndarray, end: np.ndarray, share: float) -> np.ndarray:
    """The unit vector at a share of the way between two unit vectors."""
    mixed = (1.0 - share) * start + share * end
    length = float(np.linalg.norm(mixed))
    return mixed / length if length > 1e-6 else start


def _free(scene: "Scene", point: np.ndarray, along: np.ndarray, stop: float) -> bool:
    """Whether no points lie around the line of sight and the eye.  From a third of the distance on: nearer is the surface."""
    from ...grid.gathered_rows import gathered
    from . import pick_kernels  # numba: only once something is picked

    for distance in np.geomspace(stop / 3, stop, _LOOKED_AT):
        place = point + distance * along - scene.origin
        radius = distance / 8
        low, high = (np.floor((place + sign * radius) / scene.cell_size).astype(np.int64) for sign in (-1, 1))
        cells = gathered(scene, pick_kernels.cells_in_box(np.asarray(scene.cell_coords), low, high))
        if pick_kernels.neighbourhood(cells.points, cells.coords, cells.offsets, scene.layers, cells.rows, scene.cell_size,
                                      place, radius)[0]:
            return False
    return True
