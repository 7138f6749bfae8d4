"""The start viewpoint: standing inside where the scan surrounds the eye, else looking at the whole of it from outside.

Frame: file coordinates and units; world up = +z unless a person called another direction up.  ``metre`` is file units per metre
(taken as 1 where the file does not say).  Works on a few hundred thousand points of the coarse layers, a uniform
subsample.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...picture.camera import Camera, from_fov
from ...work.places.standing_place import FIELD_OF_VIEW, SceneSample, sample_scene
from ...work.places.start_view import standing_view
from ...work.places.up_axis import Z_UP, turned, up_axis_offer, upright_axes
from ...work.scan_files import main_place
from ..kit.notices import Brighten, CallUp, ScanNotice
from .framing import from_outside
from .navigation import FlyState, view_along

if TYPE_CHECKING:
    from ...grid.scene import Scene

_DARK = 0.22
"""Median level, 0 to 1, below which a scan counts as dark: 4 % of full light, two stops below a grey card.  pumpA.e57 has 0.12,
five other scans 0.37 to 0.54.  With half none of the six counts as dark, with twice street_corner.laz does as well."""
_MIDDLE = 0.4
"""Median level that brightening aims at: a little below a photographer's grey card (18 % linear, 0.46), for highlights."""
_MOST_STOPS = 3.0
"""More shows noise only."""
_CROSSING = 12.0  # seconds to fly across the scene


@dataclass(frozen=True, eq=False)
class Survey(SceneSample):
    """speed: of flying at first, file units a second.  limits: slowest and fastest flying speed."""

    speed: float
    limits: tuple[float, float]


def survey(scene: "Scene") -> Survey:
    """What the start needs to know of a scene."""
    seen = sample_scene(scene)
    speed = speed_in(seen)
    return Survey(**vars(seen), speed=speed, limits=(min(seen.spacing, speed) / 4, 4 * seen.diagonal))


def speed_in(seen: SceneSample) -> float:
    """File units a second that suit a scan."""
    return max(seen.diagonal / _CROSSING, 5 * seen.spacing)


def darkness(seen: Survey) -> ScanNotice | None:
    """A notice about a scan whose points are dark, else None."""
    if seen.brightness >= _DARK:
        return None
    text = f"This scan is dark: half of its points are below {100 * seen.brightness:.0f} % of full brightness."
    return ScanNotice(text, Brighten())


def brightening(seen: Survey) -> float:
    """Stops of exposure, 0 to _MOST_STOPS in steps of a quarter, that bring the median level of a dark scan to _MIDDLE."""
    levels = np.array([max(seen.brightness, 1 / 255), _MIDDLE])
    linear = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)  # sRGB, IEC 61966-2-1
    return float(np.clip(np.round(4 * np.log2(linear[1] / linear[0])) / 4, 0.0, _MOST_STOPS))


def lying(seen: Survey, up: Sequence[float]) -> ScanNotice | None:
    """A notice about a scan that seems to lie on its side while ``up`` (3,) is up, else None."""
    name = up_axis_offer(seen) if tuple(up) == Z_UP else None
    if name is None:
        return None
    text = f"This scan seems to lie on its side: {name} looks like up (Scene has the other axes)."
    return ScanNotice(text, CallUp(name))


def start_state(scene: "Scene", seen: Survey, aspect: float, up: Sequence[float] = Z_UP) -> FlyState:
    """At a scanner or at eye height where the scan surrounds that place, else outside with everything in view.

    aspect: width over height of the picture.  up: (3,) unit vector, file coordinates.
    """
    near = near_survey(seen)
    return state_of(standing_view(scene, near, upright_axes(up)), near, aspect, up)


def near_survey(seen: Survey) -> Survey:
    """The survey of the place with most points, where the points lie far apart; else ``seen``.  Flying is as fast as there."""
    near, places = main_place(seen)
    return seen if places == 1 else replace(near, speed=speed_in(near))


def far_apart(seen: Survey) -> ScanNotice | None:
    """A notice about a scan whose points lie in several places far apart, else None."""
    places = main_place(seen)[1]
    if places == 1:
        return None
    return ScanNotice(f"The points lie in {places} places far apart. The view begins at the place with most points; a click on "
                      "the name of a file shows that file.")


def state_of(view: tuple[np.ndarray, np.ndarray] | None, seen: Survey, aspect: float, up: Sequence[float]) -> FlyState:
    """The same from what :func:`viewer.work.places.start_view.standing_view` found."""
    upright = upright_axes(up)
    if view is not None:
        walking = float(np.clip(seen.speed, 0.8 * seen.metre, 4.0 * seen.metre))
        return view_along(*view, walking, upright)
    state = from_outside(turned(seen, upright), aspect, seen.speed)
    return view_along(upright @ state.position, upright @ state.forward, state.speed, upright)


def start_camera(scene: "Scene", width: int, height: int) -> Camera:
    """The start viewpoint of ``scene``, width and height in pixels."""
    state = start_state(scene, survey(scene), width / height)
    return from_fov(width, height, FIELD_OF_VIEW, state.camera_to_world)
