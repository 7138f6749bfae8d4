"""What the colours of the points that are shown mean: for the legend over the picture, and over a saved one."""

from typing import TYPE_CHECKING

from ...picture.views import POINT_VIEWS
from ...render.raster.edit_block import ends_of
from ...work.measuring.measure_text import unit_name
from ...work.pictures.picture_legend import Legend
from ...work.pictures.points_legend import legend_of

if TYPE_CHECKING:
    from .session import Session

_TINT = "provenance of pixels"


def shown_legend(session: "Session") -> Legend | None:
    """The legend of what is shown now: of the tint by provenance, else of points coloured by a comparison or an attribute; None
    where they have their own colours, or another view than of points is shown."""
    work, scene = session.work, session.scene
    if scene is None:
        return None
    if work.tint:
        return Legend(_TINT, work.tint_rows) if work.tint_rows else None
    drawn = set(session.screen.drawn)
    if work.changes is not None and work.change_legend is not None:
        if work.dates is not None and session.view_settings.split:
            drawn = {session.screen.drawn[-1]}  # only the side of the date after has them
        return work.change_legend if drawn <= set(POINT_VIEWS) else None
    if not drawn <= set(POINT_VIEWS):
        return None
    unit = unit_name(work.facts(scene.meta).metres_per_unit)
    return legend_of(session.document, scene, unit, lambda: ends_of(session.document, scene, session.camera))
