"""What F12 draws over the picture where that is chosen: measurements, notes, the legend of recoloured points with the scale bar
of an orthographic view."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...common.fonts import boxes_line
from ...common.text import counted
from ...picture.drawn_lines import Area
from ...work.measuring.measure_text import labels_of, unit_name
from ...work.pictures.measured_picture import with_measurements
from ...work.pictures.noted_picture import mark_areas, with_notes
from ...work.pictures.picture_legend import Legend, with_legend
from ...work.pictures.picture_scale_bar import with_scale_bar
from ..session.colour_legend import shown_legend

if TYPE_CHECKING:
    import numpy as np

    from ...picture.camera import Camera
    from ...work.measuring.measurement import Measurement
    from ...work.notes.annotation import Annotation
    from ..session.session import Session


@dataclass(frozen=True)
class OverPicture:
    """unit: of the measurements, as a person reads it.  scale_bar: whether it is drawn.  metres_per_unit: of its lengths."""

    measurements: "tuple[Measurement, ...]" = ()
    unit: str = ""
    notes: "tuple[Annotation, ...]" = ()
    legend: Legend | None = None
    scale_bar: bool = False
    metres_per_unit: float | None = None

    def drawn(self, picture: "np.ndarray", camera: "Camera") -> "np.ndarray":
        """The picture, (H, W, 3 or 4) uint8, with it.  camera: at the picture's size."""
        taken: list[Area] = mark_areas(camera, self.notes)
        picture = with_measurements(picture, camera, self.measurements, self.unit, taken)
        picture = with_notes(picture, camera, self.notes, taken=taken, measurements=self.measurements)
        if self.scale_bar:
            picture = with_scale_bar(picture, camera, self.metres_per_unit)
        return with_legend(picture, self.legend) if self.legend is not None else picture

    @property
    def text(self) -> str:
        """" with 2 measurements and its legend", "" where nothing is drawn."""
        kinds = (self.measurements, "measurement"), (self.notes, "note")
        parts = [counted(len(found), name) for found, name in kinds if found]
        parts += ["its legend"] if self.legend is not None else []
        parts += ["its scale bar"] if self.scale_bar else []
        return f" with {', '.join(parts[:-1])}{' and ' if len(parts) > 1 else ''}{parts[-1]}" if parts else ""

    @property
    def boxes(self) -> str:
        """A line about letters of it that no font here has; "" where there are none."""
        texts = [*labels_of(self.measurements, self.unit), *(note.title(number) for number, note in enumerate(self.notes))]
        texts += [self.legend.title, *(text for _, text in self.legend.rows)] if self.legend is not None else []
        return boxes_line(texts)


def over_picture(session: "Session") -> OverPicture:
    """What is to be drawn over a picture that is saved now."""
    work, document = session.work, session.document
    if session.scene is None:
        return OverPicture()
    metres = work.facts(session.scene.meta).metres_per_unit
    measurements = document.measurements if work.shot_measured else ()
    notes = document.annotations if work.shot_noted else ()
    return OverPicture(measurements, unit_name(metres), notes, shown_legend(session) if work.shot_legend else None,
                       work.shot_legend and session.camera.orthographic is not None, metres)
