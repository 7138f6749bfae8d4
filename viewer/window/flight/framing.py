"""Views from outside as the window flies to them.  Frame: file coordinates, world up = +z, file units."""

from dataclasses import dataclass

import numpy as np

from ...work.places.outside_view import framed_position, outside_view
from ...work.places.standing_place import Sampled, overview_position
from .navigation import FlyState, view_along


@dataclass(frozen=True)
class Side:
    """From where a scan is looked at.  label: on its button.  what: in a few words.  direction: of view, in a world whose z is
    up; not of length 1."""

    label: str
    what: str
    direction: tuple[float, float, float]


SIDES = {
    "top": Side("Top", "The whole scene from above, +y up", (0.0, 1e-6, -1.0)),
    "front": Side("Front", "The whole scene along +y", (0.0, 1.0, 0.0)),
    "side": Side("Right", "The whole scene from its right, along -x", (-1.0, 0.0, 0.0)),
    "iso": Side("Iso", "The whole scene from a corner above it", (-1.0, 1.0, -0.82)),
    "bottom": Side("Bottom", "The whole scene from below, +x to the right", (0.0, 1e-6, 1.0)),
    "back": Side("Back", "The whole scene from behind, along -y", (0.0, -1.0, 0.0)),
    "left": Side("Left", "The whole scene from its left, along +x", (1.0, 0.0, 0.0)),
}


def overview(seen: Sampled, aspect: float, direction: np.ndarray, speed: float) -> FlyState:
    """Looking along ``direction`` (3,) from as far as it takes to see everything.  aspect: width over height."""
    return view_along(overview_position(seen, aspect, direction), direction, speed)


def from_side(seen: Sampled, aspect: float, side: str, speed: float) -> FlyState:
    """The whole scan from one of SIDES."""
    direction = np.array(SIDES[side].direction)
    return view_along(framed_position(seen, aspect, direction / np.linalg.norm(direction)), direction, speed)


def from_outside(seen: Sampled, aspect: float, speed: float) -> FlyState:
    """The whole scan, from the side from which most of it is seen and lit."""
    return view_along(*outside_view(seen, aspect), speed)
