"""The volume in a clip box, found on a thread and added to the measurements: of what lies above the lowest face of the box."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....picture.clip import Box, vector
from ....work.document import unique_name
from ....work.fits.measured import in_scene
from ....work.measuring.height_grid import MOST, volume_in_box
from ....work.measuring.measurement import MeasuredPoint, Measurement
from ....work.selection import Selection
from ...kit.widgets import tooltip_beside
from ...kit.worker import Worker
from ..editing import edit, ended

if TYPE_CHECKING:
    from ....work.document import Document
    from ....work.history import History
    from ..tool import ToolContext

LABEL = "Measure the volume in it"


class BoxVolume:
    """worker: of the volume that is being found."""

    def __init__(self) -> None:
        self.worker: Worker | None = None
        self._history: History[Document] | None = None  # of the work that the volume belongs to

    def panel(self, ui: Any, context: "ToolContext", box: Box) -> None:
        """The button of a chosen box."""
        ui.begin_disabled(self.worker is not None)
        if ui.button(LABEL):
            self.start(context, box)
        ui.end_disabled()
        if ui.is_item_hovered():
            tooltip_beside(ui, "Volume between the lowest face of the box and the surface measured in it, such as a heap")

    def start(self, context: "ToolContext", box: Box) -> None:
        """Finds the volume in a box of the points that are not hidden."""
        scene, document = context.scene, context.document
        assert scene is not None
        place, up = np.array(box.centre), np.array(document.up)
        others = replace(document, clips=tuple(clip for clip in document.clips if clip != box))
        kept = Selection.in_sight(scene, others).keeps  # points beneath the box tell where nothing is in it
        local = replace(box, centre=(0.0, 0.0, 0.0))

        def work() -> Measurement:
            found, corners = volume_in_box(in_scene(scene, place, kept, MOST), local, scene.spacing, up, scene.step)
            axis = np.array(box.axes)[np.abs(np.array(box.axes) @ up).argmax()]
            points = tuple(MeasuredPoint(vector(place + corner)) for corner in corners)
            return Measurement("volume", points, f"Volume in {box.name}", vector(axis if axis @ up > 0 else -axis),
                               replace(found, place=vector(place + found.place)))

        self._history = context.session.work.history
        self.worker = Worker(work, f"Measuring the volume in {box.name}", context.wake)

    def follow(self, context: "ToolContext") -> None:
        """Adds the volume that has been found, where its work is still open."""
        done = ended(self.worker, context, "The volume was not measured")
        if done is None:
            return
        self.worker = None
        if done.error is not None or done.cancelled or context.session.work.history is not self._history:
            return
        made: Measurement = done.result
        name = unique_name(made.name, (item.name for item in context.document.measurements))
        edit(context, f"Measure {name}", measurements=(*context.document.measurements, replace(made, name=name)))
        context.toast(f"{name}: it is in the list of measurements")
