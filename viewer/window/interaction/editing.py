"""What all tools share to change the document: one step that can be undone, undo and redo, and picking; and the camera as text.

Their keys are in viewer.window.interaction.controls.
"""

from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import PointglassError
from ...picture.clip import vector
from ...picture.composition import split_column
from ...preprocess.scan_description import ScanDescription
from ...work.fits.measured import in_scene
from ...work.fits.silhouette import beyond_silhouette
from ...work.measuring.measure_text import unit_name
from ...work.measuring.measurement import MeasuredPoint
from ...work.meshes.pick_mesh import ON_MODEL
from ...work.pictures.shot_metadata import camera_line, parse_camera_line
from ...work.places.pick import Kept, Picked, pick, surface_around
from ...work.selection import Selection
from ..kit.worker import Worker
from .meshes.seen_mesh import seen_mesh

if TYPE_CHECKING:
    from ...render.frame import Frame
    from .tool import ToolContext

END_SECONDS = 30.0
"""Seconds that a closing window waits for work in the background, which stops at its next progress report."""
RADIUS = 10.0
"""Design units (kit.theme) around the pointer within which a measured point is taken."""


def edit(context: "ToolContext", label: str, gesture: object = None, **changes: object) -> None:
    """Changes the document as one step; see DocumentState.edit (viewer.window.session.work)."""
    context.session.work.edit(label, gesture, **changes)


def copy_camera(context: "ToolContext") -> None:
    """Puts the camera into the clipboard, as a line of text."""
    if context.scene is not None:
        context.clipboard.write(camera_line(context.camera))
        context.toast("Copied the camera; Ctrl+V flies to it, also in another window")


def paste_camera(context: "ToolContext") -> None:
    """Flies to the camera in the clipboard, with its field of view."""
    try:
        camera = parse_camera_line(context.clipboard.read())
    except PointglassError as error:
        context.toast(str(error))
        return
    context.session.flight.show(camera)
    context.renew_picture()


def step(context: "ToolContext", *, redo: bool) -> None:
    """One step forward or back; says which."""
    work = context.session.work
    label = work.redo() if redo else work.undo()
    verb = "Redo" if redo else "Undo"
    context.toast(f"{verb}: {label}" if label is not None else f"Nothing to {verb.lower()}")


def ended(worker: Worker | None, context: "ToolContext", failure: str) -> Worker | None:
    """A worker that has ended, else None.  failure: title of the dialog that says why it failed."""
    if worker is None or not worker.finished:
        return None
    if worker.error is not None:
        context.session.notices.say(failure, worker.error)
    return worker


def end(worker: Worker | None) -> None:
    """Cancels a worker and waits until it has removed what it was writing."""
    if worker is not None:
        worker.cancel()
        worker.join(END_SECONDS)


def unit_of(context: "ToolContext") -> str:
    """The unit of the scan shown."""
    return unit_name(metres_per_unit(context))


def facts_of(context: "ToolContext") -> ScanDescription:
    """Of the scan shown: unit and reference system as the person assigned them, else as the file says."""
    return context.session.work.facts(context.scene.meta) if context.scene is not None else ScanDescription()


def metres_per_unit(context: "ToolContext") -> float | None:
    """Of the scan shown; None where it is not known."""
    return facts_of(context).metres_per_unit


def drawn_points(context: "ToolContext") -> "Kept | None":
    """Which points of the scan shown are drawn: left by clips, not hidden; None: all."""
    selection = points_in_sight(context)
    return None if selection is None or selection.everything else selection.keeps


def side_at(context: "ToolContext", position: tuple[float, float]) -> int | None:
    """0 at the left and 1 at the right of a handle between two dates; None where the whole picture shows the same points."""
    chosen, sides = context.session.view_settings, context.session.work.dates
    if sides is None or not chosen.split or not context.viewport.sides.frames:
        return None
    return int(position[0] >= split_column(chosen.split_at, context.session.area.size[0]))


def frame_at(context: "ToolContext", position: tuple[float, float]) -> "Frame | None":
    """The last picture at a position of it: of the side there, where two dates are shown."""
    side = side_at(context, position)
    return context.viewport.frame if side is None else context.viewport.sides.frames[side]


def points_at(context: "ToolContext", position: tuple[float, float]) -> "Kept | None":
    """As :func:`drawn_points`, of the side at a position, where two dates are shown."""
    side, scene, dates = side_at(context, position), context.scene, context.session.work.dates
    if side is None or scene is None or dates is None:
        return drawn_points(context)
    selection = Selection.in_sight(scene, dates.edits(context.session.work.shown_edits)[side])
    return None if selection.everything else selection.keeps


def points_in_sight(context: "ToolContext") -> Selection | None:
    """The points of the scan shown that are drawn now; None where none is shown."""
    scene = context.scene
    return None if scene is None else Selection.in_sight(scene, context.session.work.shown_edits)


class Pointing:
    """Finds measured points under the pointer, in the depth and the mask of the last picture.  Whether that is at rest, so that
    it tells what a click means, WaitingClicks knows.  meshes: whether places on meshes count, where one is seen."""

    def __init__(self, *, meshes: bool = False) -> None:
        self._meshes = meshes
        self._last: tuple[tuple[Frame, float, tuple[float, float]], Picked | None] | None = None

    def at(self, context: "ToolContext", position: tuple[float, float] | None, radius: float = RADIUS, *,
           wait: bool = True) -> Picked | None:
        """The measured point nearest to a position in the picture, None where there is none within ``radius`` design units,
        or while the camera moves.  wait: for the picture to be read; otherwise None until it has been."""
        scene = context.scene
        if scene is None or position is None or context.session.flight.moving:
            return None
        if (frame := frame_at(context, position)) is None:
            return None
        if self._last is not None and self._last[0][0] is frame and self._last[0][1:] == (radius, position):
            return self._last[1]
        read = context.viewport.pixels.read
        mask, depth = read(frame, "mask", wait=wait), read(frame, "depth", wait=wait)
        if mask is None or depth is None:
            return None
        height, width = depth.shape
        camera = context.camera
        scale = height / camera.height
        sized = camera if (width, height) == (camera.width, camera.height) else camera.resized(width, height)
        at = position[0] * scale, position[1] * scale
        found = seen_mesh(context, frame, sized, at, mask, depth, wait=wait) if self._meshes else None
        if found is None:
            found = pick(scene, sized, mask, depth, at, radius=context.pixels(radius) * scale,
                         kept=points_at(context, position))
        self._last = (frame, radius, position), found
        return found

    def clicked(self, context: "ToolContext", position: tuple[float, float]) -> Picked | None:
        """The measured point at a click; where there is none, a line says so."""
        found = self.at(context, position)
        if found is None:
            context.toast("No measured point here: this pixel is filled or background")
        return found


def measured_point(context: "ToolContext", picked: Picked) -> MeasuredPoint:
    """A picked point with the spacing and noise of the surface around it, and how far that may go on where the camera sees its
    silhouette there; of a place on a mesh the place alone."""
    scene, place = context.scene, np.array(picked.position)
    assert scene is not None
    if picked.index == ON_MODEL:  # as exact as the model
        return MeasuredPoint(picked.position, scan=picked.station)
    around = surface_around(scene, picked.position)
    spacing = around.spacing if np.isfinite(around.spacing) else scene.spacing
    beyond = beyond_silhouette(in_scene(scene, place, drawn_points(context)), spacing, context.camera.sight_of(place))
    return MeasuredPoint(picked.position, spacing, around.noise, picked.station,
                         beyond=None if beyond is None else vector(beyond))
