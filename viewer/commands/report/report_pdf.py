"""The report as a PDF of A4 pages: what was scanned, viewpoints, notes and measurements, with pictures."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError
from ...common.text import coordinate, counted
from ...work.comparing.distance_statistics import change_words
from ...work.measuring.measure_text import unit_name, value_text
from ...work.measuring.measurement import KINDS
from ...work.notes.annotation import STATUSES, is_address, time_of
from ...work.notes.attached_picture import attached_picture
from ...work.viewpoint import Viewpoint
from ..comparing.distance_histogram import draw_histogram, shown_unit
from ..section.sheet import short_reference
from .pages import FOOT_TEXT, WIDTH, Pages
from .view_pictures import view_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ...grid.scene import Scene
    from ...picture.dates.date_comparison import DateComparison
    from ...work.comparing.distance_statistics import Statistics
    from ...work.document import Document
    from ...work.notes.annotation import Annotation

Picture = Callable[[Viewpoint, "tuple[Annotation, ...]", tuple[int, ...]], np.ndarray]
"""Of a view with notes, whose numbers are given: (H, W, 3) uint8."""
_BESIDE = (104.0, 66.0)
"""Millimetres: width of a note's view where a picture is attached, and most of the attached one's width and height."""
_ALONE = 126.0
_HISTOGRAM = (66.0, 20.0)
"""Millimetres: height of a comparison's histogram, and of the texts and the ramp below it."""
_SHARPEST = 900
"""Pixels of an attached picture's longer side: 340 an inch."""


@dataclass(frozen=True)
class Wording:
    """title: of the report.  author, date: as they are to be written, "" for none."""

    title: str
    author: str = ""
    date: str = ""


def report_pages(scene: "Scene", document: "Document", views: Sequence[Viewpoint], wording: Wording, picture: Picture,
                 problem: Callable[[str], object], done: Callable[[], object],
                 changes: "Statistics | None" = None) -> "list[Figure]":  # fmt: skip
    """The pages.  views: viewpoints to show.  problem: is told, in a line, what is left out.  done: called after each picture
    (:func:`picture_count`).  changes: of the comparison that the document shows in colours."""
    pages = Pages(" · ".join(part for part in (wording.title, wording.author, wording.date, FOOT_TEXT) if part))
    notes = document.annotations
    numbers = tuple(range(len(notes)))
    _cover(pages, scene, document, wording)
    if document.view is not None:
        pages.pictures([(picture(document.view, notes, numbers), WIDTH)])
        done()
    if changes is not None and document.edits.comparison is not None:
        _comparison(pages, document.edits.comparison, changes, unit_name(scene.meta.metres_per_unit))
    if views:
        pages.gap(4.0)
        pages.heading("Viewpoints", follows=130.0)
        for view in views:
            pages.room(128.0)
            pages.line([(0.0, view.name)], 11, bold=True)
            pages.pictures([(picture(view, notes, numbers), WIDTH)])
            pages.gap(3.0)
            done()
    if notes:
        pages.gap(4.0)
        pages.heading("Notes", follows=110.0)
        for number, note in enumerate(notes):
            _note(pages, number, note, document, unit_name(scene.meta.metres_per_unit), picture, problem)
            done()
    if document.measurements:
        pages.gap(4.0)
        _measurements(pages, document, unit_name(scene.meta.metres_per_unit))
    return pages.finished()


def _comparison(pages: Pages, comparison: "DateComparison", found: "Statistics", unit: str) -> None:
    """What was compared, what was found, and the histogram of the distances with their colours."""
    pages.gap(4.0)
    pages.heading("Comparison", follows=_HISTOGRAM[0] + 24.0)
    pages.line([(0.0, f"{comparison.after[0]}, compared with {comparison.before[0]}")])
    factor, shown = shown_unit(found.limit, unit)
    if found.known:
        pages.text(f"median {found.median * factor:.3g} {shown}, standard deviation {found.sd * factor:.3g} {shown}, "
                   f"uncertainty ± {found.uncertainty * factor:.3g} {shown} (median, 95 %; dashed)", 9, quiet=True)
    for line in change_words(found):
        pages.text(line, 9, quiet=True)
    pages.gap(2.0)
    what = "distance from the model" if comparison.with_model else "distance after - before"
    draw_histogram(pages.diagram(*_HISTOGRAM), found, factor, f"{what}, {shown}")


def picture_count(document: "Document", views: Sequence[Viewpoint]) -> int:
    """How often :func:`report_pages` says that it has gone on."""
    return (document.view is not None) + len(views) + len(document.annotations)


def _cover(pages: Pages, scene: "Scene", document: "Document", wording: Wording) -> None:
    pages.heading(wording.title, 20)
    if about := " · ".join(part for part in (wording.author, wording.date) if part):
        pages.text(about, 10, quiet=True)
    pages.gap(3.0)
    unit, crs = unit_name(scene.meta.metres_per_unit), scene.meta.crs
    size = np.asarray(scene.bounds[1]) - np.asarray(scene.bounds[0])
    for scan in document.scans:
        pages.text(Path(scan.path).name + ("" if scan.visible else " (not shown)"), 9.5)
    facts = [f"{scene.count:,} points", f"extent {size[0]:.1f} x {size[1]:.1f} x {size[2]:.1f} {unit}"]
    facts += [short_reference(crs)] if crs else []
    pages.text(" · ".join(facts), 9, quiet=True)
    states = [f"{many} {status.name.lower()}" for key, status in STATUSES.items()
              if (many := sum(note.status == key for note in document.annotations))]
    notes = counted(len(document.annotations), "note") + f" ({', '.join(states)})" * bool(states)
    pages.text(f"{notes} · {counted(len(document.measurements), 'measurement')}", 9, quiet=True)
    pages.gap(3.0)


def _note(pages: Pages, number: int, note: "Annotation", document: "Document", unit: str, picture: Picture,
          problem: Callable[[str], object]) -> None:  # fmt: skip
    """One note: its title and status, its view and the attached picture side by side, its text, place and link."""
    status, view = STATUSES[note.status], view_of(note, document)
    shown: list[tuple[np.ndarray, float]] = []
    attached = _attached(note, problem)
    if view is not None:
        shown.append((picture(view, (note,), (number,)), _BESIDE[0] if attached is not None else _ALONE))
    if attached is not None:
        height, width = attached.shape[:2]
        shown.append((attached, min(_BESIDE[1], _BESIDE[1] * width / height)))
    tallest = max((wide * image.shape[0] / image.shape[1] for image, wide in shown), default=0.0)
    pages.room(tallest + 24.0)
    pages.rule()
    title = note.title(number)
    pages.line([(4.5, f"{number + 1}   {title}")], 11, bold=True, mark=status.rgb, right=status.name)
    if shown:
        pages.gap(1.0)
        pages.pictures(shown)
    if note.text.strip() != title:
        pages.text(note.text.strip())
    x, y, z = map(coordinate, note.position)
    place = f"x {x}   y {y}   z {z} {unit}"
    made = time_of(note)
    pages.text(place + (f" · {made:%Y-%m-%d %H:%M} UTC" if made is not None else ""), 8, quiet=True)
    if note.picture and attached is None:
        pages.text(f"attached picture {Path(note.picture).name}: not there, or not readable", 8, quiet=True)
    if is_address(note.link):
        pages.text(note.link, 8, quiet=True)
    pages.gap(3.0)


def _attached(note: "Annotation", problem: Callable[[str], object]) -> np.ndarray | None:
    if not note.picture:
        return None
    try:
        return attached_picture(note.picture, _SHARPEST)[0]
    except InputError as error:
        problem(str(error))
        return None


def _measurements(pages: Pages, document: "Document", unit: str) -> None:
    pages.heading("Measurements")
    pages.line([(0.0, "name"), (56.0, "kind"), (96.0, "value (uncertainty: 95 %)")], 8, quiet=True)
    pages.rule()
    for made in document.measurements:
        pages.line([(0.0, made.name), (56.0, KINDS[made.kind].name), (96.0, value_text(made, unit))], 9)
