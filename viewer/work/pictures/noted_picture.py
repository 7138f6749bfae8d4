"""Notes drawn over a finished picture of any size: a square of the colour of their status, and their title."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ..notes.annotation import STATUSES
from .drawn_over import EDGE, seen_places, unit_length, with_shapes

if TYPE_CHECKING:
    from ...picture.camera import Camera
    from ...picture.drawn_lines import Area
    from ..measuring.measurement import Measurement
    from ..notes.annotation import Annotation

_MARK, _RIM = 6.0, 1.5
"""Half the width of a mark, and of its dark rim, design units (:mod:`.drawn_over`)."""


def mark_areas(camera: "Camera", notes: "Sequence[Annotation]") -> "list[Area]":
    """Where the marks of notes lie in a picture of the camera's size, pixels: no label is to be put there."""
    half = (_MARK + _RIM) * unit_length(camera.height)
    seen = seen_places(camera, [note.position for note in notes])
    return [(x - half, y - half, 2 * half, 2 * half) for x, y in seen]


def with_notes(picture: np.ndarray, camera: "Camera", notes: "Sequence[Annotation]", numbers: Sequence[int] = (),
               taken: "Sequence[Area]" = (), measurements: "Sequence[Measurement]" = ()) -> np.ndarray:
    """The picture with notes over it.

    picture: (H, W, 3) or (H, W, 4) uint8, premultiplied; it is not changed.  camera: of it, at its size.  numbers: of the
    notes, from 0; none: all are given, in order.  taken: where other labels and marks lie, pixels.  measurements: in
    the picture, to whose points no title is to seem to belong.
    """
    if not notes:
        return picture
    places = [np.array(note.position) for note in notes]
    numbers = numbers or range(len(notes))

    def draw(on: Any, large: "Camera", unit: float) -> None:
        seen, depths = large.project(np.array(places))
        for note, (x, y), depth in zip(notes, seen, depths, strict=True):
            if depth > 0 and abs(x) < 1e6 and abs(y) < 1e6:
                for half, colour in ((_MARK + _RIM, EDGE), (_MARK, (*STATUSES[note.status].rgb, 255))):
                    half *= unit
                    on.rectangle([x - half, y - half, x + half, y + half], fill=colour)

    titles = [note.title(number) for note, number in zip(notes, numbers, strict=True)]
    ends = [point.position for measurement in measurements for point in measurement.points]
    labelled = with_shapes(picture, camera, lambda on, large, unit: None, places, titles, list(taken), ends)
    return with_shapes(labelled, camera, draw, [], [])  # no label covers a mark
