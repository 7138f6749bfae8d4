"""The lines in which a cut meets the meshes beside a scan, for sheets and drawings: each mesh with its name and colour.

Meshes are cut by the plane alone: a plan at its height, a section along its line, an elevation at its cut plane; what lies
behind is not drawn.  Clips and the ends of a line cut them as they do points.  Frame: paper coordinates, file units.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...common.fonts import families
from ...common.text import counted, printable
from ...picture.clip import Clip, active, contains, normals
from ...picture.meshes.mesh_layer import MeshLayer, shown_meshes
from ...readers.meshes.mesh_store import mesh_of
from ...work.comparing.compared_model import placed_vertices
from ...work.sheets.cut_lines import Polyline
from ...work.sheets.mesh_cut import Segments, cut_segments, joined_lines, parts_kept, tolerance_of
from .cut import Cut

if TYPE_CHECKING:
    from .orthographic import Extent

MODEL_COLOURS: tuple[tuple[str, int], ...] = (("#1f5fbf", 5), ("#b3261e", 1), ("#1b7f3b", 3), ("#8a2be2", 6), ("#b06000", 30),
                                              ("#007c89", 4))
"""sRGB, dark enough for white paper, and index of AutoCAD's colours: of the first mesh, the second, and so on, again from the
first where there are more."""
_BESIDE = 0.1
"""Of the longer side of what was measured: so far around it the sheet goes where meshes do."""


@dataclass(frozen=True, eq=False)
class ModelLines:
    """name: of a mesh.  colour: (sRGB, index of AutoCAD's).  lines: longest first."""

    name: str
    colour: tuple[str, int]
    lines: tuple[Polyline, ...]

    @property
    def text(self) -> str:
        """For a legend."""
        return f"model {printable(self.name)}"


def model_lines(meshes: Sequence[MeshLayer], cut: Cut, clips: tuple[Clip, ...]) -> tuple[ModelLines, ...]:
    """Of the meshes that are shown; those that the plane does not meet are left out.  clips: of the selection.  Reads meshes
    that are not in memory.  Raises InputError, one line, where one cannot be read."""
    depth = cut.near if cut.kind == "elevation" else 0.0
    found: list[ModelLines] = []
    for number, layer in enumerate(shown_meshes(tuple(meshes)) if np.isfinite(depth) else ()):
        mesh = mesh_of(layer.path)
        paper = cut.paper(placed_vertices(layer, mesh))
        segments = _clipped(cut_segments(paper, mesh.faces, depth), cut, depth, clips)
        if lines := joined_lines(segments, tolerance_of(paper)) if len(segments.ends) else []:
            found.append(ModelLines(layer.name, MODEL_COLOURS[number % len(MODEL_COLOURS)], tuple(lines)))
    return tuple(found)


def _clipped(segments: Segments, cut: Cut, depth: float, clips: tuple[Clip, ...]) -> Segments:
    used = active(clips)
    sides = [side for side in (cut.left, cut.rightmost) if np.isfinite(side)]
    if not (used or sides) or not len(segments.ends):
        return segments
    one, other = segments.ends[:, 0], segments.ends[:, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = [(side - one[:, 0]) / (other[:, 0] - one[:, 0]) for side in sides]
        for clip in used:
            values = [(_in_file(end, depth, cut) - np.array(clip.centre)) @ normals(clip).T for end in (one, other)]
            crossings += [(bound - values[0][:, row]) / (values[1][:, row] - values[0][:, row])
                          for row in range(3) for bound in (-1.0, 1.0)]

    def keeps(paper: np.ndarray) -> np.ndarray:
        inside = (paper[:, 0] >= cut.left) & (paper[:, 0] <= cut.rightmost)
        return inside & contains(used, _in_file(paper, depth, cut)) if used else inside

    return parts_kept(segments, np.stack(crossings, axis=1), keeps)


def _in_file(paper: np.ndarray, depth: float, cut: Cut) -> np.ndarray:
    """(n, 3) file coordinates of (n, 2) paper coordinates in the plane of a cut."""
    return np.column_stack([paper, np.full(len(paper), depth)]) @ cut.axes + np.array(cut.origin)


def widened(extent: "Extent", models: Sequence[ModelLines]) -> "Extent":
    """The extent of points, wider by what meshes have near them."""
    low, high, count = extent[0].copy(), extent[1].copy(), extent[2]
    room = _BESIDE * float((high - low)[:2].max())
    least, most = low[:2] - room, high[:2] + room
    for line in (line for model in models for line in model.lines):
        low[:2] = np.minimum(low[:2], np.clip(line.vertices.min(axis=0), least, most))
        high[:2] = np.maximum(high[:2], np.clip(line.vertices.max(axis=0), least, most))
    return low, high, count


def model_text(models: Sequence[ModelLines], unit: str) -> list[str]:
    """What of which mesh was drawn, in lines."""
    return [f"{counted(len(model.lines), 'line')} of {model.text}, {sum(line.length for line in model.lines):.4g} {unit} in all"
            for model in models]


def draw_models(page: Any, models: Sequence[ModelLines], width: float, *, placed=lambda paper: paper, edge: Any = None,
                corner: tuple[float, float] | None = None, traced: str | None = None) -> None:
    """Draws lines and their legend into matplotlib axes.

    width: of lines, points.  placed: coordinates of the axes of (n, 2) paper coordinates.  edge: a patch that cuts lines.
    corner: upper left one of the drawing in the axes' coordinates, where the legend lies; None: of the axes.  traced: colour of
    traced lines, which the legend names, too; None: there are none.
    """
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=traced, linewidth=width, label="lines of the points")] if traced else []
    for model in models:
        for line in model.lines:
            ring = np.concatenate([line.vertices, line.vertices[:1]]) if line.closed else line.vertices
            for drawn in page.plot(*placed(ring).T, color=model.colour[0], linewidth=width, solid_joinstyle="miter"):
                if edge is not None:
                    drawn.set_clip_path(edge)
        handles.append(Line2D([], [], color=model.colour[0], linewidth=width, label=model.text))
    if not models:
        return
    place = {} if corner is None else {"bbox_to_anchor": corner, "bbox_transform": page.transData}
    legend = page.legend(handles=handles, loc="upper left", fontsize=6, framealpha=0.92, edgecolor="#c9cdd2", fancybox=False,
                         borderaxespad=0.8, **place)
    legend.get_frame().set_linewidth(0.5)
    for text in legend.get_texts():
        text.set_parse_math(False)
        text.set_fontfamily(families(text.get_text()))
