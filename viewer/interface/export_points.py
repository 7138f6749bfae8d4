"""Exports points for Python: what is left of a scan by boxes and stations, as ``pointglass export`` writes it."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..commands.exporting.command import export
from ..commands.exporting.splat_export import budget_of
from ..common.errors import InputError
from ..picture.clip import Clip, box_around
from ..picture.regions import LAST_CLASS
from ..work.selection import Selection

if TYPE_CHECKING:
    from ..grid.scene import Scene

_log = logging.getLogger(__name__)


def export_points(scene: Scene, path: Path, clip: npt.ArrayLike | None, stations: Iterable[int] | None, exposures: str,
                  all_columns: bool, reproject: str | None, classes: Iterable[int] | None = None,
                  splats: bool = False, budget: int | None = None) -> int:  # fmt: skip
    """See Scan.export."""
    if exposures not in ("as-scanned", "matched"):
        raise InputError("expected as-scanned or matched", option="exposures", value=exposures)
    if budget is not None:
        budget = budget_of(str(budget))
    selection = Selection(scene, within=_boxes(clip), hidden=_hidden(scene, stations), classes=_codes(classes))

    def note(text: str) -> None:
        _log.warning("%s: %s", path, text)

    return export(selection, path, matched=exposures == "matched", all_columns=all_columns, reproject=reproject, splats=splats,
                  budget=budget, note=note)


def _boxes(clip: npt.ArrayLike | None) -> tuple[Clip, ...]:
    if clip is None:
        return ()
    try:
        corners = np.array(clip, np.float64)
    except (TypeError, ValueError):
        corners = np.empty(0)
    boxes = corners[None] if corners.ndim == 2 else corners
    if boxes.shape[1:] != (2, 3) or len(boxes) == 0 or not np.isfinite(boxes).all():
        raise InputError("expected [[xmin, ymin, zmin], [xmax, ymax, zmax]] in file coordinates, or several", option="clip",
                         value=clip)
    if not (boxes[:, 1] > boxes[:, 0]).all():
        raise InputError(f"clip {clip!r}: each maximum must be greater than its minimum")
    return tuple(box_around(boxes[n, 0], boxes[n, 1], "clip") for n in range(len(boxes)))


def _whole(numbers: Iterable[int]) -> list[int]:
    """Raises TypeError where one is no whole number: 0.7 is not station 0, and a mask is no list of stations."""
    found = list(numbers)
    if any(isinstance(number, bool) for number in found):
        raise TypeError("a boolean")
    return [index(number) for number in found]


def _codes(classes: Iterable[int] | None) -> frozenset[int] | None:
    """The classes that are written."""
    if classes is None:
        return None
    try:
        found = frozenset(_whole(classes))
    except TypeError:
        found = frozenset()
    if not found or not all(0 <= code <= LAST_CLASS for code in found):
        raise InputError(f"expected codes from 0 to {LAST_CLASS}, such as [2, 6]", option="classes", value=classes)
    return found


def _hidden(scene: Scene, stations: Iterable[int] | None) -> frozenset[int]:
    """The stations that are left out."""
    if stations is None:
        return frozenset()
    count = len(scene.meta.scans)
    try:
        wanted = _whole(stations)
    except TypeError:
        raise InputError("expected rows of Scan.stations, such as [0, 2]", option="stations", value=stations) from None
    for number in wanted:
        if not 0 <= number < count:
            raise InputError(f"row {number}; the scan has {count} stations, counted from 0", option="stations")
    if not wanted:
        raise InputError("names no station", option="stations", remedy="give None for all")
    return frozenset(range(count)) - frozenset(wanted)
