"""The rows of the Compare tool in the inspector: which scans, how they are compared, what came of it, and how it is shown."""

from typing import Any, Protocol

import numpy as np

from ....work.comparing.compare import METHODS
from ....work.comparing.distance_statistics import change_words
from ....work.comparing.facing import TEXTS
from ....work.comparing.scene_changes import Coloured, SceneDistances
from ....work.scan_files import FilePart
from ...kit.number_field import number_input, say_at_field
from ...kit.widgets import tooltip_beside, work_rows
from ...kit.worker import Worker
from ..tool import ToolContext

_SHOWN = {"change": "show the change", "after": "show the scan after", "before": "show the scan before"}
_FROM_MODEL = {"change": "show the distances", "after": "show the scan's own colours"}
_SHARES = {"95 %": 0.95, "99 %": 0.99}
_GRAPH = 64.0
"""Design units: height of the histogram."""


class Comparing(Protocol):
    """What the panel shows and changes: viewer.window.interaction.comparing.compare_tool.Compare."""

    before: int
    after: int
    method: str
    registration: float
    made: SceneDistances | None
    coloured: Coloured | None
    worker: Worker | None

    @property
    def exporting(self) -> Worker | None: ...
    def parts(self, context: ToolContext) -> list[FilePart]: ...
    def names(self, context: ToolContext) -> list[str]: ...
    def model(self, context: ToolContext) -> int | None: ...
    def unit(self, context: ToolContext) -> str: ...
    def choose(self, before: int, after: int) -> None: ...
    def start(self, context: ToolContext) -> None: ...
    def show_beside(self, context: ToolContext, on: bool) -> None: ...
    def show(self, context: ToolContext, **chosen: Any) -> None: ...
    def show_share(self, context: ToolContext, share: float) -> None: ...
    def show_model(self, context: ToolContext, on: bool) -> None: ...
    def put_away(self, context: ToolContext) -> None: ...
    def open_other(self, context: ToolContext) -> None: ...
    def export(self, context: ToolContext) -> None: ...


def draw_panel(ui: Any, tool: Comparing, context: ToolContext) -> None:
    """All rows.  ui: the ``imgui`` module, inside a window."""
    parts, names = len(tool.parts(context)), tool.names(context)
    if len(names) < 2:
        if parts:
            ui.text_wrapped("Two scans are compared that are open together, such as a room last year and now; or a scan with a "
                            "model of the tool Meshes.")
            if ui.button("Open a second scan…"):
                tool.open_other(context)
        else:
            ui.text_wrapped("Scans can be compared once all points are read and their files are told apart.")
        return
    model = tool.model(context)
    earlier = [number for number in range(len(names)) if parts > 1 or number >= parts]
    chosen = _file(ui, "compared with" if parts == 1 else "before", names, earlier, tool.before)
    if chosen is not None:
        swapped = tool.before if tool.before < parts else (chosen + 1) % parts
        tool.choose(chosen, swapped if chosen == tool.after else tool.after)
    chosen = _file(ui, "scan" if model is not None else "after", names, list(range(parts)), tool.after)
    if chosen is not None:
        tool.choose(tool.after if chosen == tool.before else tool.before, chosen)
    _method(ui, tool, context)
    if tool.worker is not None:
        work_rows(ui, tool.worker)
        return
    if ui.button("Compare"):
        tool.start(context)
    if model is None:
        _beside(ui, tool, context)
    if tool.made is not None and tool.coloured is not None:
        ui.separator()
        _result(ui, tool, context)


def _beside(ui: Any, tool: Comparing, context: ToolContext) -> None:
    shown = context.session.view_settings.split and context.session.work.dates is not None
    changed, on = ui.checkbox("side by side (V)", shown)
    if changed:
        tool.show_beside(context, on)
    if ui.is_item_hovered():
        tooltip_beside(ui, "the scan before left and the scan after right of a handle; each side can have its own view")


def _file(ui: Any, label: str, names: list[str], offered: list[int], number: int) -> int | None:
    """A choice among the files and meshes offered; the number of another one where it was chosen."""
    chosen = None
    ui.text_unformatted(label)
    ui.set_next_item_width(-1)
    if ui.begin_combo(f"##{label}", names[number] if number < len(names) else ""):
        for at in offered:
            ui.push_id(at)
            if ui.selectable(names[at], at == number)[0] and at != number:
                chosen = at
            ui.pop_id()
        ui.end_combo()
    return chosen


def _method(ui: Any, tool: Comparing, context: ToolContext) -> None:
    if tool.model(context) is not None:
        ui.text_wrapped("Each point to the nearest triangle; positive is outside, as the triangles are oriented.")
    else:
        _methods(ui, tool)
    ui.text_unformatted(f"registration unsure by, {tool.unit(context)}")
    ui.set_next_item_width(-1)
    changed, value = number_input(ui, "##registration", tool.registration, "%.4g")
    if value >= 0:
        tool.registration = value
    elif changed:
        say_at_field(ui, f"{value:g}: expected 0 or more; it stays as it was")
    if ui.is_item_hovered():
        tooltip_beside(ui, "95 %, as Align and `pointglass align` state it; it is added to the uncertainty of each distance")


def _methods(ui: Any, tool: Comparing) -> None:
    ui.text_unformatted("method")
    ui.set_next_item_width(-1)
    if ui.begin_combo("##method", tool.method):
        for name, text in METHODS.items():
            if ui.selectable(name, name == tool.method)[0]:
                tool.method = name
            if ui.is_item_hovered():
                tooltip_beside(ui, text)
        ui.end_combo()


def _result(ui: Any, tool: Comparing, context: ToolContext) -> None:
    comparison = context.document.comparison
    assert tool.made is not None and tool.coloured is not None
    if comparison is None:
        return
    found, unit = tool.coloured.found, tool.unit(context)
    ui.set_next_item_width(-1)
    texts = _FROM_MODEL if comparison.with_model else _SHOWN
    if ui.begin_combo("##shown", texts[comparison.shown]):
        for name, text in texts.items():
            if ui.selectable(text, comparison.shown == name)[0] and comparison.shown != name:
                tool.show(context, shown=name)
        ui.end_combo()
    if comparison.with_model:
        named = [layer for layer in context.document.meshes if layer.name == comparison.before[0]][comparison.model :]
        changed, on = ui.checkbox("show the model", bool(named) and named[0].visible)
        if changed:
            tool.show_model(context, on)
        if ui.is_item_hovered():
            tooltip_beside(ui, "it covers the points behind its surfaces")
    if found.known:
        ui.text_wrapped(f"median {found.median:.3g}, sd {found.sd:.3g} {unit}; unsure by {found.uncertainty:.3g} (95 %)")
        if ui.is_item_hovered() and context.scene is not None:
            tooltip_beside(ui, f"of the points as they are shown, coordinates rounded to {context.scene.step:.2g} {unit}:\n"
                               "Export and `pointglass compare` read the files, and the last digits may differ")
    for line in change_words(found):
        ui.text_wrapped(line)
    shares = found.bins[1:-1].astype(np.float32)
    ui.plot_histogram("##distances", shares, scale_min=0.0, scale_max=float(max(shares.max(initial=0.0), 1.0)),
                      graph_size=(ui.get_content_region_avail().x, context.theme.px(_GRAPH)))  # fmt: skip
    if ui.is_item_hovered():
        tooltip_beside(ui, f"how many points have which distance, from -{found.limit:.4g} to {found.limit:.4g} {unit}\n"
                           f"positive (red): {TEXTS[tool.made.distances.rule]}")
    ui.text_unformatted(f"colours end at ±, {unit}")
    ui.set_next_item_width(-1)
    changed, value = number_input(ui, "##range", found.limit, "%.4g")
    if changed and value > 0:
        tool.show(context, limit=value)
    elif changed:
        say_at_field(ui, f"{value:g}: expected a distance above 0; it stays as it was")
    if ui.button("auto"):
        tool.show(context, limit=None)
    for label, share in _SHARES.items():
        ui.same_line()
        if ui.button(label):
            tool.show_share(context, share)
        if ui.is_item_hovered():
            tooltip_beside(ui, f"the colours end where {label} of the distances end")
    changed, on = ui.checkbox("certain changes only", comparison.certain)
    if changed:
        tool.show(context, certain=on)
    if ui.is_item_hovered():
        tooltip_beside(ui, "points that changed by less than their uncertainty are grey")
    if tool.exporting is not None:
        ui.text_wrapped(tool.exporting.label or tool.exporting.title)
    elif ui.button("Export…"):
        tool.export(context)
    if ui.is_item_hovered():
        tooltip_beside(ui, "LAZ with distances, CSV and a picture, as `pointglass compare` writes them")
    ui.same_line()
    if ui.button("Own colours"):
        tool.put_away(context)
