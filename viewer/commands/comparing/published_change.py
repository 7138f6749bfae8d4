"""The comparison that a project shows, in a publication: the colours of its distances, histogram, legend and words."""

import base64
import io
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ...common.text import printable
from ...picture.point_sets import PointLevels
from ...work.comparing.distance_statistics import change_words
from ...work.comparing.facing import TEXTS
from ...work.comparing.scene_changes import coloured, distances_in
from ...work.measuring.measure_text import unit_name
from .distance_histogram import draw_histogram, shown_unit

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.edits import Edits

CHANGE = "change"
"""The name of that view."""
_SIZE, _DPI = (3.5, 2.9), 192
"""Inches, and pixels an inch: twice those that the page shows, so that letters of 9 points have 12 of its pixels."""


@dataclass(frozen=True, eq=False)
class PublishedChange:
    """levels: of the scene's points.  data: what the page is told: ``picture``, a PNG in base64, and ``text``, lines,
    the first of them says what is compared."""

    levels: PointLevels
    data: dict[str, Any]


def published_change(scene: "Scene", edits: "Edits") -> PublishedChange:
    """The distances of the comparison of ``edits``, whatever of it is shown now.  Raises InputError where it cannot be made."""
    assert edits.comparison is not None
    comparison = replace(edits.comparison, shown="change")
    made = distances_in(scene, comparison, edits.meshes)
    shown = coloured(scene, made, edits, comparison)
    found, unit = shown.found, unit_name(scene.meta.metres_per_unit)
    factor, named = shown_unit(found.limit, unit)
    lines = [f"{printable(comparison.after[0])} compared with {printable(comparison.before[0])}"]
    if found.known:
        lines.append(f"median {found.median * factor:.3g} {named}, standard deviation {found.sd * factor:.3g} {named}, "
                     f"uncertainty ± {found.uncertainty * factor:.3g} {named} (median, 95 %; dashed)")
    lines += [f"positive (red) is {TEXTS[made.distances.rule]}", *change_words(found)]
    what = "distance from the model" if comparison.with_model else "distance after - before"
    picture = _figure(found, factor, f"{what}, {named}")
    return PublishedChange(shown.levels, {"picture": base64.b64encode(picture).decode("ascii"), "text": "\n".join(lines)})


def _figure(found: Any, factor: float, title: str) -> bytes:
    """A PNG of the histogram, whose axis is the legend of the colours."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=_SIZE, dpi=_DPI, facecolor="white")
    FigureCanvasAgg(figure)
    page = figure.add_axes((0.17, 0.31, 0.73, 0.63))
    draw_histogram(page, found, factor, title)
    page.locator_params(axis="x", nbins=4)
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=_DPI, metadata={"Software": None})
    return data.getvalue()
