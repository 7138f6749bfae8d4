"""What the colours of the points that are shown mean: for the legend over the picture, and over a saved one."""

from typing import TYPE_CHECKING

from ...picture.colour_modes import CLASSES, COLOUR_BY, PointValue, category_colours, colours_of
from ...picture.views import POINT_VIEWS
from ...render.raster.edit_block import ends_of
from ...work.measuring.measure_text import unit_name
from ...work.pictures.picture_legend import Legend
from ...work.places.pick import station_name

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from .session import Session

_MOST_ROWS = 12
_TINT = "provenance of pixels"


def shown_legend(session: "Session") -> Legend | None:
    """The legend of what is shown now: of the tint by provenance, else of points coloured by an attribute; None where they have
    their own colours, or another view than of points is shown."""
    look, scene = session.document.look, session.scene
    if scene is not None and session.work.tint:
        return Legend(_TINT, session.work.tint_rows) if session.work.tint_rows else None
    if scene is not None and session.work.changes is not None and session.work.change_legend is not None:
        return session.work.change_legend if set(session.screen.drawn) <= set(POINT_VIEWS) else None
    if scene is None or not look.recolours or not set(session.screen.drawn) <= set(POINT_VIEWS):
        return None
    if COLOUR_BY[look.colour_by].legend != "ramp":
        return _listed(look.colour_by, scene, {change.code for change in session.document.reclassified})
    mode = COLOUR_BY[look.colour_by]
    low, high = ends_of(session.document, scene, session.camera)
    unit = f" {unit_name(session.work.facts(scene.meta).metres_per_unit)}"
    if mode.value is PointValue.INTENSITY:
        low, high, unit = scene.attributes.in_file(low), scene.attributes.in_file(high), ""
    return Legend(mode.text, ramp=colours_of(look.colour_by, look.ramp), low=f"{low:.4g}{unit}", high=f"{high:.4g}{unit}")


def _listed(colour_by: str, scene: "Scene", given: set[int]) -> Legend:
    """Of classes or stations, the first of them where there are many.  given: classes that points have in the document."""
    mode, colours = COLOUR_BY[colour_by], category_colours(colour_by)
    if mode.legend == "stations":
        named = [(number, station_name(scene, number)) for number in range(min(max(len(scene.meta.scans), 1), 256))]
    else:
        named = [(code, f"{code} {CLASSES.get(code, ('other',))[0]}")
                 for code in sorted({*scene.attributes.classes, *given})]
    title = mode.text + (f" (first {_MOST_ROWS} of {len(named)})" if len(named) > _MOST_ROWS else "")
    return Legend(title, [(tuple(int(c) for c in colours[number]), name) for number, name in named[:_MOST_ROWS]])  # type: ignore[misc]
