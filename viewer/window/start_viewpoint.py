"""The start viewpoint: standing inside where the scan surrounds the eye, else looking at the whole of it from outside.

Frame: file coordinates, world up = +z, file units; ``metre`` is file units per metre (taken as 1 where the file does
not say).  Works on a few hundred thousand points of the coarse layers, which are a uniform subsample.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from viewer.camera import Camera, from_fov
from viewer.tools.standing_place import FIELD_OF_VIEW, SceneSample, sample_scene, standing_view
from viewer.window.framing import from_outside
from viewer.window.navigation import FlyState, looking
from viewer.window.notices import ScanNotice

if TYPE_CHECKING:
    from viewer.grid.scene import Scene

_DARK = 0.22  # median level below which a scan counts as dark
_CROSSING = 12.0  # seconds to fly across the scene


@dataclass(frozen=True, eq=False)
class Survey(SceneSample):
    """speed: of flying at first, file units a second.  limits: slowest and fastest flying speed."""

    speed: float
    limits: tuple[float, float]


def survey(scene: "Scene") -> Survey:
    """What the start needs to know of a scene."""
    seen = sample_scene(scene)
    speed = max(seen.diagonal / _CROSSING, 5 * seen.spacing)
    return Survey(**vars(seen), speed=speed, limits=(min(seen.spacing, speed) / 4, 4 * seen.diagonal))


def darkness(seen: Survey) -> ScanNotice | None:
    """A notice about a scan whose points are dark, else None."""
    if seen.brightness >= _DARK:
        return None
    return ScanNotice(f"This scan is dark: half of its points are below {100 * seen.brightness:.0f} % of full brightness.")


def start_state(scene: "Scene", seen: Survey, aspect: float) -> FlyState:
    """At a scanner or at eye height where the scan surrounds that place, else outside with everything in view.

    aspect: width over height of the picture.
    """
    view = standing_view(scene, seen)
    if view is not None:
        walking = float(np.clip(seen.speed, 0.8 * seen.metre, 4.0 * seen.metre))
        return looking(*view, walking)
    return from_outside(seen, aspect, seen.speed)


def start_camera(scene: "Scene", width: int, height: int) -> Camera:
    """The camera a visit to ``scene`` begins with, width and height in pixels."""
    state = start_state(scene, survey(scene), width / height)
    return from_fov(width, height, FIELD_OF_VIEW, state.camera_to_world)
