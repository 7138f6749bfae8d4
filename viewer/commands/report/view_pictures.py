"""The pictures of a report: views of a document as it looks at the scan, with its measurements and notes drawn over them, the
legend of what points are coloured by, and the scale bar of orthographic views."""

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...picture.spec import PictureSpec
from ...picture.views import POINT_VIEWS
from ...render.raster.edit_block import ends_of
from ...work.comparing.scene_changes import changes_of
from ...work.measuring.measure_text import unit_name
from ...work.pictures.measured_picture import with_measurements
from ...work.pictures.noted_picture import mark_areas, with_notes
from ...work.pictures.picture_legend import with_legend
from ...work.pictures.picture_scale_bar import with_scale_bar
from ...work.pictures.points_legend import change_legend, legend_of

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...render.renderer import Renderer
    from ...work.comparing.distance_statistics import Statistics
    from ...work.document import Document
    from ...work.notes.annotation import Annotation
    from ...work.pictures.picture_legend import Legend
    from ...work.viewpoint import Viewpoint

SIZE = (1200, 800)
"""Pixels of a picture: 170 pixels an inch, as wide as a page of A4 is between its margins."""
_KEPT = 16
"""Pictures of views that are kept for the next notes: 46 MB."""
_EDGE = 0.05
"""Share of a picture's sides within which a place counts as at its edge."""


class ViewPictures:
    """Renders views of a document, one after the other.  size: (width, height) in pixels."""

    def __init__(self, renderer: "Renderer", document: "Document", size: tuple[int, int] = SIZE):
        self._renderer, self._document, self.size = renderer, document, size
        scene, edits = renderer.scene, document.edits
        self._unit, self._edits, self._changes = unit_name(scene.meta.metres_per_unit), edits, changes_of(scene, edits)
        if self._changes is not None:
            self._edits = replace(edits, changes=self._changes.levels)
        self._drawn: dict[tuple, np.ndarray] = {}
        """Views with nothing drawn over them: many notes are written from one place."""

    def picture(self, view: "Viewpoint", notes: "tuple[Annotation, ...]", numbers: tuple[int, ...]) -> np.ndarray:
        """(H, W, 3) uint8: the view with all measurements and these notes.  numbers: of the notes, from 0."""
        from ...render.described_picture import picture_of

        document = self._document
        camera, key = view.camera(*self.size), (view.camera_to_world, view.vertical_fov, view.orthographic)
        if key not in self._drawn:
            if len(self._drawn) >= _KEPT:
                del self._drawn[next(iter(self._drawn))]
            spec = PictureSpec(camera, document.settings, edits=self._edits, background=document.background)
            self._drawn[key] = picture_of(self._renderer, spec)
        taken = mark_areas(camera, notes)
        picture = with_measurements(self._drawn[key], camera, document.measurements, self._unit, taken)
        picture = with_scale_bar(picture, camera, self._renderer.scene.meta.metres_per_unit)
        if (legend := self._legend(camera)) is not None:
            picture = with_legend(picture, legend)
        return with_notes(picture, camera, notes, numbers, taken, document.measurements)

    @property
    def changes(self) -> "Statistics | None":
        """Figures of the comparison whose distances colour the points; None where none does."""
        shown = self._changes is not None and self._changes.levels.colours is not None
        return self._changes.found if shown and self._changes is not None else None

    def _legend(self, camera: "Camera") -> "Legend | None":
        """Of the colours of points; None where they have their own."""
        if self._document.settings.view not in POINT_VIEWS:
            return None
        if (changes := self.changes) is not None:
            comparison = self._edits.comparison
            return change_legend(changes.limit, self._unit,
                                 with_model=comparison is not None and comparison.with_model)
        scene = self._renderer.scene
        return legend_of(self._edits, scene, self._unit, lambda: ends_of(self._edits, scene, camera))


def view_of(note: "Annotation", document: "Document", size: tuple[int, int] = SIZE) -> "Viewpoint | None":
    """From where a note is seen: where it was written, else the first view of the document that has it in its picture."""
    views = [note.view, document.view, *document.viewpoints]
    return next((view for view in views if view is not None and in_sight(note, view, size)), note.view)


def in_sight(note: "Annotation", view: "Viewpoint", size: tuple[int, int] = SIZE) -> bool:
    """Whether a note lies in the picture of a view, not at its edge; it may be hidden there."""
    (pixel,), (depth,) = view.camera(*size).project(np.array([note.position]))
    sides = np.array(size)
    return bool(depth > 0 and (pixel > _EDGE * sides).all() and (pixel < (1 - _EDGE) * sides).all())


def renderer_for(scene: "Scene", document: "Document") -> "Renderer":
    """A renderer with a context of its own, set up for the document's view; release both (:func:`released`).

    Raises DeviceError where there is no OpenGL, InputError where weights do not fit.
    """
    from ...render.device.context import create_context
    from ...render.renderer import Renderer
    from ...work.ghosts import prepared

    if document.settings.view == "neural":
        from ....model.common.process.torch_process import prepare_inference

        prepare_inference()
    return Renderer(create_context(), prepared(scene, document.ghosts))


def released(renderer: "Renderer") -> None:
    """Releases a renderer of :func:`renderer_for` and its context."""
    context = renderer.context
    renderer.release()
    context.release()


def as_reported(document: "Document") -> "Document":
    """The document with a background that paper has: the window's where its own is transparent."""
    return replace(document, background="plain") if document.background == "transparent" else document
