"""Views from outside as the window flies to them.  Frame: file coordinates, world up = +z, file units."""

import numpy as np

from ...work.places.outside_view import outside_view
from ...work.places.standing_place import Sampled, overview_position
from .navigation import FlyState, view_along


def overview(seen: Sampled, aspect: float, direction: np.ndarray, speed: float) -> FlyState:
    """Looking along ``direction`` (3,) from as far as it takes to see everything.  aspect: width over height."""
    return view_along(overview_position(seen, aspect, direction), direction, speed)


def from_outside(seen: Sampled, aspect: float, speed: float) -> FlyState:
    """The whole scan, from the side from which most of it is seen and lit."""
    return view_along(*outside_view(seen, aspect), speed)
