"""Stands at a place, or where a photograph was taken with the photograph over the view."""

import numpy as np

from ....readers.photographs.posed_photograph import PosedPhotograph
from ...flight.navigation import view_along
from ...session.work import ShownPhoto
from ..tool import ToolContext


def stand_at(context: ToolContext, place: np.ndarray, direction: np.ndarray | None = None) -> None:
    """Puts the camera there, (3,) file coordinates, looking as before or along ``direction``."""
    flight = context.session.flight
    ahead = flight.state.forward if direction is None else direction
    flight.go(view_along(place, ahead, flight.state.speed))
    context.renew_picture()


def show_photo(context: ToolContext, photo: PosedPhotograph) -> None:
    """Looks at the photograph's middle from its place."""
    context.session.work.photo = ShownPhoto(photo)
    stand_at(context, photo.position, photo.forward)
