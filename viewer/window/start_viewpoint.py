"""Where a visit begins: standing inside the scan where that makes sense, else looking at it from outside.

Frame: file coordinates, world up = +z, file units; ``metre`` is file units in a metre (taken as 1 where the file does
not say).  Works on a few hundred thousand points of the coarse layers, which are a uniform subsample.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from viewer.camera import Camera, from_fov
from viewer.tools.standing_place import FIELD_OF_VIEW, OUTSIDE_DIRECTION, overview_position, standing_view
from viewer.window.navigation import FlyState, looking
from viewer.window.notices import ScanNotice

if TYPE_CHECKING:
    from viewer.grid.scene import Scene

_SAMPLE = 400_000
_BLACK = 8  # of 255
_DARK = 0.22  # median level below which a scan counts as dark
_CROSSING = 12.0  # seconds to fly across the scene


@dataclass(frozen=True, eq=False)
class Survey:
    """points: (n, 3) float64.  lit: (n,) bool, not black: nobody photographed the black ones.
    low, high: (3,) float64, where 98 % of them lie along each axis.
    spacing, metre, speed: file units (a second).  limits: slowest and fastest flying speed.
    brightness: median level of the lit points, 0 to 1."""

    points: np.ndarray
    lit: np.ndarray
    low: np.ndarray
    high: np.ndarray
    spacing: float
    metre: float
    speed: float
    limits: tuple[float, float]
    brightness: float = 0.5


def survey(scene: "Scene") -> Survey:
    """What the start needs to know of a scene."""
    from viewer.grid.scene import unpack

    ends = scene.offsets[len(scene.cell_coords) :: len(scene.cell_coords)]
    whole_layers = int(ends[max(0, int(np.searchsorted(ends, _SAMPLE, side="right")) - 1)])
    points, rgb, _, _ = unpack(scene, slice(0, whole_layers))
    low, high = np.percentile(points, [1.0, 99.0], axis=0)
    metres = scene.meta.get("metres_per_unit")
    metre = 1.0 / metres if metres else 1.0
    diagonal = max(float(np.linalg.norm(high - low)), 10 * scene.step)
    spacing = min(max(float(scene.spacing), scene.step), diagonal)
    speed = max(diagonal / _CROSSING, 5 * spacing)
    level = rgb.max(axis=1)
    lit = level > _BLACK
    brightness = float(np.median(level[lit])) / 255 if lit.any() else 0.0
    limits = (min(spacing, speed) / 4, 4 * diagonal)
    return Survey(points, lit, low, high, spacing, metre, speed, limits, brightness)


def darkness(seen: Survey) -> ScanNotice | None:
    """A notice about a scan whose points are dark, else None."""
    if seen.brightness >= _DARK:
        return None
    return ScanNotice(f"This scan is dark: half of its points are below {100 * seen.brightness:.0f} % of full brightness.")


def start_state(scene: "Scene", seen: Survey, aspect: float) -> FlyState:
    """At a scanner, else at eye height where most was measured, else outside with everything in view."""
    view = standing_view(scene, seen)
    if view is None:
        return overview(seen, aspect, np.array(OUTSIDE_DIRECTION), seen.speed)
    walking = float(np.clip(seen.speed, 0.8 * seen.metre, 4.0 * seen.metre))
    return looking(*view, walking)


def start_camera(scene: "Scene", width: int, height: int) -> Camera:
    """The camera a visit to ``scene`` begins with, width and height in pixels."""
    state = start_state(scene, survey(scene), width / height)
    return from_fov(width, height, FIELD_OF_VIEW, state.camera_to_world)


def overview(seen: Survey, aspect: float, direction: np.ndarray, speed: float) -> FlyState:
    """Looking along ``direction`` (3,) from as far as it takes to see everything.  aspect: width over height."""
    return looking(overview_position(seen, aspect, direction), direction, speed)
