"""Perspective or orthographic: changing between them so that what is in the middle of the picture keeps its size; and turns
of the view cube."""

from typing import TYPE_CHECKING

from ..flight.cube_regions import Region, view_of
from ..kit.notices import ToastSubject
from .around_point import measured_under

if TYPE_CHECKING:
    from .tool import ToolContext


def change_projection(context: "ToolContext") -> None:
    """Makes an orthographic picture of a perspective one, or the other way round; says which."""
    session = context.session
    if context.scene is None:
        return
    depth = depth_of_middle(context)
    if session.flight.orthographic is None:
        session.flight.to_orthographic(depth)
        said = "Orthographic: drag to orbit, right drag to pan, the wheel zooms; X for perspective"
        coloured = context.viewport.frame is not None and context.viewport.frame.facts.photographs
        if coloured or session.work.photo is not None:
            said += ". Photographs show in perspective only"
    else:
        session.flight.to_perspective(depth)
        said = "Perspective"
    session.notices.toast(said, seconds=3.0, subject=ToastSubject.PROJECTION)
    session.picture.renew()


def depth_of_middle(context: "ToolContext") -> float:
    """View depth of what is measured in the middle of the picture; else of the middle of the scan, or a distance like it."""
    camera = context.camera
    point = measured_under(context, (camera.width / 2, camera.height / 2))
    middle = context.session.flight.middle
    depths = [float((place - camera.position) @ camera.forward) for place in (point, middle) if place is not None]
    found = next((depth for depth in depths if depth > 0), None)
    return found if found is not None else max(abs(depths[-1]), camera.orthographic or context.session.flight.state.speed)


def turn_to(context: "ToolContext", region: Region) -> None:
    """Turns about what is in the middle of the picture until the camera sees a region of the view cube from outside."""
    flight, camera = context.session.flight, context.camera
    if context.scene is not None:
        depth = depth_of_middle(context)
        pivot = camera.unproject([(camera.cx, camera.cy)], depth)[0]
        flight.turn_about(pivot, *view_of(region, flight.state.yaw))
