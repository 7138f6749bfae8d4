"""How the picture is made, from the tables of ``viewer/picture/settings.py``: a choice added there appears here.

What most people want is at the top in plain words; "Advanced" holds the rest.  A choice that has no effect or cannot be
made is disabled, and its tooltip says why.
"""

import sys
from dataclasses import replace

from imgui_bundle import ImVec2, imgui

from ...picture.background import COLOURS
from ...picture.settings import BACKGROUNDS, CHOICES, Settings
from ...picture.views import VIEWS
from ..flight.space_mouse import FASTEST, SLOWEST
from ..kit.sliders import CLAMP, LOGARITHMIC, slider_float, slider_int
from ..kit.theme import Theme
from ..kit.widgets import (  # fmt: skip
    button,
    combo,
    heading,
    hint,
    label,
    section,
    setting,
    slider,
)
from ..planning.networks import missing_qualities
from ..session.panel_actions import Actions
from ..session.session import Session
from .mouse_choice import draw_mouse_choice

_LOD_DEFAULT = 4.0
_SHIPPED = "shipped"
_NO_FILTER = "The filter is off."
_NO_NETWORK = "Only the neural view uses the network."


def draw_look(session: Session, actions: Actions, style: Theme) -> None:
    """The rows, in the window that is open.  Every change is a new Settings record, requested of the session."""
    old = session.view_settings.shown_settings
    new = _look(session, actions, old, style)
    imgui.dummy(ImVec2(0, style.px(4)))
    if section("Advanced", style):
        new = _advanced(session, new, style)
    imgui.dummy(ImVec2(0, style.px(4)))
    usual = new == Settings(view=new.view)
    if button("Back to defaults", style, width=-1, disabled="Everything is as it was at first." if usual else ""):
        new = Settings(view=new.view)
    if new != old:
        actions.request(new)


def _look(session: Session, actions: Actions, new: Settings, style: Theme) -> Settings:
    chosen = session.view_settings
    neural = "neural" in (new.view, *chosen.sides)
    label("quality", CHOICES["quality"][new.quality], style)
    quality = combo("##quality", new.quality, CHOICES["quality"], style, disabled=missing_qualities(new))
    if quality != new.quality:
        new = replace(new, quality=quality)
    label("detail", _NO_NETWORK if not neural else "From smooth to every measured grain; in the middle, what the scan's noise "
          "suggests", style)
    imgui.begin_disabled(not neural)
    changed, detail = slider_float("##detail", new.detail, 0.0, 2.0, _detail_text(new.detail))
    imgui.end_disabled()
    hint("" if neural else _NO_NETWORK, style)
    if changed and 0.0 <= detail <= 2.0:
        new = replace(new, detail=detail)
    label("compare", "Two views side by side (V)", style)
    changed, on = imgui.checkbox("##compare", chosen.split)
    if changed:
        actions.compare(on)
    imgui.same_line()
    imgui.set_next_item_width(-1)
    imgui.begin_disabled(not chosen.split)
    left = combo("##left side", chosen.left, CHOICES["view"], style,
                 names={view: row.title for view, row in VIEWS.items()})
    imgui.end_disabled()
    hint("" if chosen.split else "Tick the box to compare two views.", style)
    if left != chosen.left:
        actions.choose_left(left)
    table = {name: BACKGROUNDS[name] for name in COLOURS}
    label("background", f"Behind everything that was neither measured nor filled: {table[chosen.background]}", style)
    background = combo("##background", chosen.background, table, style)
    if background != chosen.background:
        actions.choose_background(background)
    draw_mouse_choice(session.flight.mouse, actions, style)
    if session.flight.twist is not None:
        label("3D mouse", "How fast the camera, or where drags orbit the scene, follows its cap", style)
        changed, factor = slider_float("##twist", session.flight.twist_speed, SLOWEST, FASTEST, "%.2f", CLAMP | LOGARITHMIC)
        if changed:
            actions.choose_twist_speed(factor)
    label("in flight", "Holds a steady frame rate while the camera moves: a lower resolution, fewer points and the filled view "
          "where needed; full quality at rest", style)
    changed, quick = imgui.checkbox("keep up", session.picture.adaptive_lod.keep_up)
    if changed:
        actions.keep_up(quick)
    return new


def _advanced(session: Session, new: Settings, style: Theme) -> Settings:
    heading("Hidden points", style)
    new = setting(new, "filter", "filter", style)
    off = new.filter == "off"
    label("strength", "Multiplies the depth tolerance; 1 is the preset's own, less keeps fewer points", style)
    imgui.begin_disabled(off)
    new = replace(new, filter_strength=slider("##strength", new.filter_strength, 0.1, 10.0, "%.2f"))
    imgui.end_disabled()
    hint(_NO_FILTER if off else "", style)
    label("levels", "Levels of the depth pyramid; auto is the preset's own", style)
    imgui.begin_disabled(off)
    changed, value = slider_int("##levels", new.filter_levels or 0, 0, 12, "auto" if new.filter_levels is None else "%d")
    imgui.end_disabled()
    hint(_NO_FILTER if off else "", style)
    if changed and 0 <= value <= 12:
        new = replace(new, filter_levels=value or None)
    heading("Points", style)
    every = new.lod is None
    label("density", "Points drawn per pixel that a cell covers; every point where the box is not ticked", style)
    ticked, on = imgui.checkbox("##lod", not every)
    if ticked:
        new = replace(new, lod=_LOD_DEFAULT if on else None)
    imgui.same_line()
    imgui.set_next_item_width(-1)
    imgui.begin_disabled(every)
    value = slider("##lod points", new.lod or _LOD_DEFAULT, 0.25, 32.0, "every point" if every else "%.2f a pixel")
    imgui.end_disabled()
    if new.lod is not None:
        new = replace(new, lod=value)
    new = setting(new, "stations", "stations", style)
    new = setting(new, "soft_z", "soft depth", style)
    new = setting(new, "raster", "rasteriser", style)
    heading("Network", style)
    new = _own_weights(new, session, style)
    new = setting(new, "precision", "precision", style)
    return setting(new, "device", "device", style, disabled=_missing_devices())


def _missing_devices() -> dict[str, str]:
    """Devices that cannot be used -> the reason, as far as that is known without loading torch for it."""
    torch = sys.modules.get("torch")
    if torch is None or torch.cuda.is_available():
        return {}
    return {"cuda": "torch sees no CUDA device here; `pointglass doctor` says more."}


def _detail_text(detail: float) -> str:
    """What stands in the slider: imgui puts the number where the format asks for one."""
    return "by the noise" if abs(detail - 1.0) < 0.02 else "%.2f smoother" if detail < 1.0 else "%.2f finer"


def _own_weights(settings: Settings, session: Session, style: Theme) -> Settings:
    """A row that chooses among a person's own weights, where there are any."""
    own = session.view_settings.own_weights
    if not own and settings.weights is None:
        return settings
    names = {str(path): name for name, path in own.items()}
    if settings.weights is not None:
        names.setdefault(settings.weights, settings.weights.rpartition("/")[2])
    table = {_SHIPPED: "the weights that came with pointglass", **{name: path for path, name in names.items()}}
    value = _SHIPPED if settings.weights is None else names[settings.weights]
    label("weights", "Your own weights, made by `pointglass train`", style)
    chosen = combo("##weights", value, table, style)
    path = next((path for path, name in names.items() if name == chosen), None)
    return settings if chosen == value else replace(settings, weights=path)
