"""Measurements and notes of a scan that is moved: what was picked on it stays on it.

A point of a measurement, and a note, say which scan they were picked on.  Frame: document coordinates, float64, file units.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...common.rigid_transform import Rows, combined, moved_points, rows_of, turned_directions
from ...picture.clip import vector
from ..document import Document
from ..fits.fit import Fit
from ..measuring.measurement import MeasuredPoint, Measurement
from ..notes.annotation import Annotation


@dataclass(frozen=True)
class Carried:
    """measurements, annotations: all of the document, those of the moved scan at their new places.  moved: how many followed.
    left: how many stay although they may be of it: volumes and profiles, which are measured along the vertical and the ground
    of their place, and notes and points of which the scan is not known."""

    measurements: tuple[Measurement, ...]
    annotations: tuple[Annotation, ...]
    moved: int
    left: int


def only_of(names: Sequence[Collection[str]], number: int) -> Callable[[str], bool]:
    """Tells whether a name is that of a scan of file ``number``, and of no other file.  names: of the scans of each file."""
    own = set(names[number]).difference(*(other for at, other in enumerate(names) if at != number))
    return own.__contains__


def carried(document: Document, motion: Rows, of_it: Callable[[str], bool]) -> Carried:
    """What becomes of measurements and notes where a scan moves.  motion: from where it is.  of_it: whether a name is its."""
    moved = left = 0
    measurements, annotations = [], []
    for made in document.measurements:
        points = tuple(_point(point, motion) if of_it(point.scan) else point for point in made.points)
        of_scan = any(of_it(point.scan) for point in made.points)  # also one that lies where the scan is turned about
        follows = of_scan and made.volume is None and made.profile is None
        moved += follows
        left += not follows and (of_scan or any(not point.scan for point in made.points))
        measurements.append(replace(made, points=points) if follows else made)
    for note in document.annotations:
        follows = bool(note.scan) and of_it(note.scan)
        moved += follows
        left += not note.scan
        annotations.append(_note(note, motion) if follows else note)
    return Carried(tuple(measurements), tuple(annotations), moved, left)


def _place(place: tuple[float, float, float], motion: Rows) -> tuple[float, float, float]:
    return vector(moved_points(motion, np.array([place]))[0])


def _turned(direction: tuple[float, float, float], motion: Rows) -> tuple[float, float, float]:
    return vector(turned_directions(motion, np.array([direction]))[0])


def _point(point: MeasuredPoint, motion: Rows) -> MeasuredPoint:
    return replace(point, position=_place(point.position, motion), fit=None if point.fit is None else _fit(point.fit, motion),
                   beyond=None if point.beyond is None else _turned(point.beyond, motion))


def _fit(fit: Fit, motion: Rows) -> Fit:
    return replace(fit, place=_place(fit.place, motion), direction=_turned(fit.direction, motion))


def _note(note: Annotation, motion: Rows) -> Annotation:
    """With the view in which it was written, which shows it from there."""
    view = note.view
    if view is not None:
        turned = combined(motion, rows_of(np.array(view.camera_to_world)))
        view = replace(view, camera_to_world=turned)
    return replace(note, position=_place(note.position, motion), view=view)
