"""Colours: points by attribute with a legend; tones of the picture; point size and lighting.

Colours by attribute, point size and eye-dome lighting act where points are shown: in the raw and filtered views.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from ...grid.scene import unpack
from ...picture.colour_modes import COLOUR_BY, RAMPS, Need, PointValue
from ...picture.look import MOST_POINT_SIZE, TONES, Look
from ...picture.views import POINT_VIEWS
from ...render.raster.edit_block import ends_of
from ..kit import icons
from ..kit.number_field import number_inputs
from ..kit.sliders import slider_float, slider_int
from ..kit.widgets import tooltip_beside
from ..session.colour_legend import shown_legend
from .editing import edit
from .tool import Overlay, Tool, ToolContext

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ..kit.overlay import OverlayCanvas

_SAMPLE = 200_000  # points that tell whether a scan has intensities


def missing(scene: "Scene", colour_by: str) -> str | None:
    """Why a scan cannot be coloured by an attribute, None where it can."""
    needs = COLOUR_BY[colour_by].needs
    return None if needs is None or _HAS[needs](scene) else needs.value


def _has_intensity(scene: "Scene") -> bool:
    """A grid of an earlier version does not say."""
    return scene.attributes.low is not None or bool(unpack(scene, slice(0, min(scene.count, _SAMPLE)))[2].any())


_HAS: "dict[Need, Callable[[Scene], bool]]" = {
    Need.INTENSITY: _has_intensity,
    Need.CLASSES: lambda scene: scene.attributes.has_classes,
    Need.STATIONS: lambda scene: len(scene.meta.scans) > 1,
}


class AttributeLegend(Overlay):
    """What the colours mean of points that have not the scan's own, or of pixels tinted by provenance."""

    name = "colour legend"

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        legend = shown_legend(context.session)
        if legend is None:
            return
        from ..kit.legend import draw_legend, draw_ramp

        if legend.ramp is None:
            draw_legend(overlay, legend.rows, legend.title)
        else:
            draw_ramp(overlay, legend.ramp, legend.title, legend.low, legend.high)


_NAMES = {"edl": "eye-dome lighting"}
"""Names of sliders that are not their fields'."""


class Colours(Tool):
    """Its panel holds the look; the pointer flies as usual."""

    name, label, icon, key = "colours", "Colours", icons.COLOURS, "C"
    help = "colour points by attribute; exposure, white balance, point size, lighting"

    def __init__(self) -> None:
        self._missing: WeakKeyDictionary[Scene, dict[str, str | None]] = WeakKeyDictionary()

    def _change(self, context: ToolContext, gesture: str, **fields: object) -> None:
        label = f"Change {gesture.replace('_', ' ')}"
        edit(context, label, ("look", gesture), look=replace(context.document.look, **fields))  # type: ignore[arg-type]

    def panel(self, ui: Any, context: ToolContext) -> None:
        look, scene = context.document.look, context.scene
        if scene is None:
            return
        if scene not in self._missing:
            self._missing[scene] = {name: missing(scene, name) for name in COLOUR_BY}
        ui.text_unformatted("colour by")
        ui.set_next_item_width(-1)
        if ui.begin_combo("##colour by", look.colour_by):
            for name, mode in COLOUR_BY.items():
                why = self._missing[scene][name]
                if mode.needs is Need.CLASSES and context.document.reclassified:
                    why = None
                ui.begin_disabled(why is not None)
                if ui.selectable(name, name == look.colour_by)[0] and name != look.colour_by:
                    recolours = mode.value is not PointValue.COLOUR
                    self._change(context, "colour_by", colour_by=name, low=None, high=None)
                    if recolours and context.session.view_settings.shown_settings.view not in POINT_VIEWS:
                        context.session.view_settings.show_points()
                        context.toast("Colours by attribute show in the raw and filtered views")
                    elif not recolours:
                        context.session.view_settings.show_colours()
                ui.end_disabled()
                if ui.is_item_hovered(ui.HoveredFlags_.allow_when_disabled):
                    tooltip_beside(ui, why or mode.text)
            ui.end_combo()
        if COLOUR_BY[look.colour_by].legend == "ramp":
            self._ramp(ui, context, look)
        if look.recolours and context.session.view_settings.shown_settings.view not in POINT_VIEWS:
            ui.text_wrapped("Filled and neural views know the scan's own colours only.")
        for name, tone in TONES.items():
            self._slider(ui, context, name, -tone.most, tone.most, tone.shown)
        self._points(ui, context, look)
        ui.begin_disabled(look == Look())
        if ui.button("Back to the scan's look"):
            edit(context, "Reset the look", look=Look())
        ui.end_disabled()

    def _ramp(self, ui: Any, context: ToolContext, look: Look) -> None:
        assert context.scene is not None
        ui.set_next_item_width(-1)
        if ui.begin_combo("##ramp", look.ramp):
            for name in RAMPS:
                if ui.selectable(name, name == look.ramp)[0]:
                    self._change(context, "ramp", ramp=name)
            ui.end_combo()
        low, high = ends_of(context.document, context.scene, context.camera)
        layout = context.scene.attributes
        stored = COLOUR_BY[look.colour_by].value is PointValue.INTENSITY
        shown = (layout.in_file(low), layout.in_file(high)) if stored else (low, high)
        ui.set_next_item_width(-1)
        changed, ends = number_inputs(ui, "##range", shown, "%.4g")
        if changed:
            low, high = (layout.as_stored(float(end)) if stored else float(end) for end in ends)
            self._change(context, "range", low=low, high=high)
        if ui.is_item_hovered():
            tooltip_beside(ui, "lowest and highest value of the colour ramp")

    def _slider(self, ui: Any, context: ToolContext, name: str, least: float, most: float, form: str) -> None:
        look = context.document.look
        ui.text_unformatted(_NAMES.get(name, name.replace("_", " ")))
        ui.set_next_item_width(-1)
        changed, value = slider_float(f"##{name}", getattr(look, name), least, most, form)
        if changed and least <= value <= most:
            self._change(context, name, **{name: float(value)})
        if ui.is_item_deactivated():
            context.session.work.history.end_gesture()

    def _points(self, ui: Any, context: ToolContext, look: Look) -> None:
        off = not context.session.view_settings.shows_points
        ui.begin_disabled(off)
        ui.text_unformatted("point size")
        ui.set_next_item_width(-1)
        changed, size = slider_int("##point size", look.point_size, 1, MOST_POINT_SIZE, "%d px")
        if changed and 1 <= size <= MOST_POINT_SIZE:
            self._change(context, "point_size", point_size=int(size))
        self._slider(ui, context, "edl", 0.0, 1.0, "%.2f")
        ui.end_disabled()
        if off:
            ui.text_wrapped("Point size and eye-dome lighting act in the raw and filtered views, which show points.")
