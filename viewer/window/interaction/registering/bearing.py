"""A line that a person clicks on the scan that is moved, to give it a bearing: to north, or along a wall.

Its ends are kept in the coordinates of the scan's own file; degrees clockwise from the y axis.
"""

from dataclasses import dataclass, field
from math import atan2, degrees
from typing import TYPE_CHECKING

import numpy as np

from ....common.rigid_transform import Rows, moved_points
from .clicked_pairs import own

if TYPE_CHECKING:
    from ...kit.overlay import OverlayCanvas


@dataclass(eq=False)
class BearingLine:
    """asks: whether a click sets an end.  places: (3,) each, own coordinates of the file.  bearing: at first that of the line,
    then as typed."""

    asks: bool = False
    places: list[np.ndarray] = field(default_factory=list)
    bearing: float = 0.0

    @property
    def complete(self) -> bool:
        """Whether both ends are there."""
        return len(self.places) == 2

    def add(self, place: np.ndarray, transform: Rows) -> None:
        """An end was clicked, (3,) document coordinates.  transform: of the scan now."""
        if self.places:
            x, y, _ = place - moved_points(transform, self.places[0][None])[0]
            self.bearing = degrees(atan2(x, y)) % 360
        self.places.append(own(place, transform))
        self.asks = not self.complete

    def draw(self, overlay: "OverlayCanvas", transform: Rows) -> None:
        """The line and its ends, as far as they are there."""
        if self.places:
            ends = moved_points(transform, np.array(self.places))
            overlay.polyline(list(ends), "warn", 2.0)
            for place in ends:
                overlay.marker(place, "warn", 4.0)

    def toggle(self) -> None:
        """Begins a line, or gives it up."""
        begun = self.asks or bool(self.places)
        self.clear()
        self.asks = not begun

    def clear(self) -> None:
        """There is no line."""
        self.asks, self.places = False, []
