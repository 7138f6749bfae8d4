"""What the colours of points mean: the legend of a look or a comparison, for the window, saved pictures and reports."""

from collections.abc import Callable
from typing import TYPE_CHECKING

from ...picture.colour_modes import CLASSES, COLOUR_BY, PointValue, category_colours, colours_of
from ..comparing.change_levels import ramp_of_legend
from ..places.pick import station_name
from .picture_legend import Legend

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.edits import Edits

_MOST_ROWS = 12


def legend_of(edits: "Edits", scene: "Scene", unit: str, ends: Callable[[], tuple[float, float]]) -> Legend | None:
    """The legend of points coloured by an attribute; None where they have their own colours.  unit: of lengths.
    ends: gives the attribute at the two ends of the ramp (viewer.render.raster.edit_block.ends_of)."""
    look = edits.look
    if not look.recolours:
        return None
    mode = COLOUR_BY[look.colour_by]
    if mode.legend != "ramp":
        return _listed(look.colour_by, scene, {change.code for change in edits.reclassified})
    low, high = ends()
    text = f" {unit}"
    if mode.value is PointValue.INTENSITY:
        low, high, text = scene.attributes.in_file(low), scene.attributes.in_file(high), ""
    return Legend(mode.text, ramp=colours_of(look.colour_by, look.ramp), low=f"{low:.4g}{text}", high=f"{high:.4g}{text}")


def change_legend(limit: float, unit: str, *, with_model: bool = False) -> Legend:
    """Of a comparison.  limit: where its colours end, to both sides, file units.  with_model: of a scan from a mesh."""
    title = "distance from the model" if with_model else "distance after - before"
    return Legend(title, (), ramp_of_legend(), f"-{limit:.4g} {unit}", f"{limit:.4g} {unit}")


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
