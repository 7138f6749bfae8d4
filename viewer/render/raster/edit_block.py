"""Edits as shaders read them: which points are drawn, and in which colour.

Clips, hidden stations and hidden ghosts (viewer.picture.edits) remove points, the look colours them by an attribute, dimmed
ghosts are a faint grey.  A picture without edits runs programs compiled without them.  With edits, cells that clips remove
completely are not drawn, and the rest is decided point by point (shaders/common_edits.glsl).
References: viewer.picture.clip.contains and viewer.picture.colour_modes.levels.
Frame: clips and heights in file coordinates, float64; handed to the GPU in the view frame relative to the camera, float32.
"""

from dataclasses import replace
from typing import TYPE_CHECKING
from weakref import WeakKeyDictionary

import numpy as np

from ...grid.place.hidden_grids import hidden_cells, table_numbers
from ...grid.records.point_marks import DROPPED, HAS_CLASS, SELECTED
from ...grid.scene import unpack
from ...picture.clip import MOST_CLIPS, active, group, may_contain, normals
from ...picture.colour_modes import COLOUR_BY, LEVELS, PointValue, colours_of

if TYPE_CHECKING:
    from ...grid.records.point_marks import PointMarks
    from ...grid.scene import Scene
    from ...picture.camera import Camera
    from ...picture.edits import Edits
    from ..culling.cull import DrawList

BLOCK = np.dtype([
    ("clip_rows", "<f4", (3 * MOST_CLIPS, 4)), ("clip_groups", "<u4", 4), ("hidden", "<u4", 8), ("upward", "<f4", 4),
    ("ramp", "<f4", 4), ("mode", "<u4", 4), ("table", "<u4", LEVELS), ("hidden_classes", "<u4", 8), ("marks", "<u4", 256),
])  # fmt: skip
"""The uniform block Edits of common_edits.glsl (std140)."""
DIMMED_LEAST, DIMMED_SHIFT = 40, 2
"""A dimmed point is grey: this level, and its own brightness shifted right by this many bits:
40 to 103, darker than the middle and lighter than a black background."""
SELECTED_COLOUR = (255, 170, 0)
"""Orange, mixed in equal parts with the colour of a selected point.  Chosen by eye."""
DEFINES = {"EDITED": 1, "MOST_CLIPS": MOST_CLIPS, "DIMMED_LEAST": DIMMED_LEAST, "DIMMED_SHIFT": DIMMED_SHIFT,
           "MARK_HAS_CLASS": HAS_CLASS, "MARK_SELECTED": SELECTED, "MARK_DROPPED": DROPPED,
           "SELECTED_HALF": sum(level // 2 << 8 * n for n, level in enumerate(SELECTED_COLOUR)),
           **{f"BY_{value.name}": int(value) for value in PointValue}}
"""Constants of common_edits.glsl."""
_SAMPLE = 200_000
"""Points whose attributes determine the ends of a colour ramp.  Of so
many the share beyond a percentile of 0.5 has a standard error of 0.016 % (sqrt(0.005 * 0.995 / 200,000))."""
_INTENSITIES: "WeakKeyDictionary[Scene, tuple[float, float]]" = WeakKeyDictionary()


def block_of(edits: "Edits", scene: "Scene", camera: "Camera", marks: "PointMarks | None" = None) -> bytes:
    """The uniform block Edits for a picture, as bytes.  marks: of the scene's points; None: none is marked."""
    data = np.zeros((), BLOCK)
    rotation = camera.view_rotation
    groups = np.zeros(3, np.uint32)
    clips = active(edits.clips)
    for number, clip in enumerate(clips):
        rows = normals(clip)
        data["clip_rows"][3 * number : 3 * number + 3, :3] = rows @ rotation.T
        data["clip_rows"][3 * number : 3 * number + 3, 3] = rows @ (camera.position - np.array(clip.centre))
        groups[group(clip)] |= np.uint32(1 << number)
    data["clip_groups"] = (len(clips), *groups)
    hidden = table_numbers(scene, scene.hidden_stations(edits))
    for name, numbers in (("hidden", hidden), ("hidden_classes", edits.hidden_classes)):
        for number in numbers:
            if 0 <= number < LEVELS:
                data[name][number // 32] |= np.uint32(1 << number % 32)
    if marks is not None:
        data["marks"] = marks.table
    data["mode"][3] = bool(edits.hidden_classes) and edits.changes is None  # marks of levels have no classes: they leave out
    low, high = ends_of(edits, scene, camera)
    mode = COLOUR_BY[edits.look.colour_by]
    up = np.array(mode.axis or edits.up)
    data["upward"] = (*(rotation @ up), up @ camera.position - low)
    data["ramp"][:2] = low, (LEVELS - 1) / (high - low) if high > low else 1e30
    layout = scene.attributes
    data["ramp"][2:] = layout.low or 0, layout.step
    data["mode"][1] = layout.has_classes
    if scene.marked is not None and edits.ghosts == "dimmed":
        data["mode"][2] = scene.marked.station + 1
    data["mode"][0] = mode.value
    colours = colours_of(edits.look.colour_by, edits.look.ramp).astype(np.uint32)
    if edits.changes is not None and edits.changes.colours is not None:
        data["mode"][0] = PointValue.CLASS
        colours[: len(edits.changes.colours)] = edits.changes.colours
    data["table"] = colours[:, 0] | colours[:, 1] << 8 | colours[:, 2] << 16
    return data.tobytes()


def tinted(rgb: np.ndarray) -> np.ndarray:
    """(n, 3) uint8: colours of points (n, 3) uint8 as selected points have them; common_edits.glsl does the same."""
    return rgb // 2 + np.array(SELECTED_COLOUR, np.uint8) // 2


def dimmed(rgb: np.ndarray) -> np.ndarray:
    """(n, 3) uint8: colours of points (n, 3) uint8 as dimmed ghosts have them; common_edits.glsl does the same."""
    grey = rgb.astype(np.uint32) @ np.array([77, 150, 29], np.uint32) >> 8
    return np.repeat((DIMMED_LEAST + (grey >> DIMMED_SHIFT)).astype(np.uint8)[:, None], 3, axis=1)


def ends_of(edits: "Edits", scene: "Scene", camera: "Camera | None" = None) -> tuple[float, float]:
    """The attribute at the two ends of the ramp: as the look says, else as the scan's points have it.

    camera: for distances; None: those are told from the middle of the scan.
    """
    low, high = edits.look.low, edits.look.high
    if (low is None or high is None) and COLOUR_BY[edits.look.colour_by].legend == "ramp":
        least, most = _extremes(edits, scene, camera)
        low, high = least if low is None else low, most if high is None else high
    return low or 0.0, high or 0.0


def _extremes(edits: "Edits", scene: "Scene", camera: "Camera | None") -> tuple[float, float]:
    """Least and greatest of the attribute: coordinates and distances of the scan's bounds, intensities of 99 % of a sample."""
    mode = COLOUR_BY[edits.look.colour_by]
    if mode.value is PointValue.INTENSITY:
        if scene not in _INTENSITIES:
            intensity = unpack(scene, slice(0, min(scene.count, _SAMPLE)))[2]  # the coarsest layers: evenly from the whole scan
            low, high = np.percentile(intensity, [0.5, 99.5]) if len(intensity) else (0.0, 0.0)
            _INTENSITIES[scene] = float(low), float(high)
        return _INTENSITIES[scene]
    corners = np.array([[scene.bounds[i >> k & 1, k] for k in range(3)] for i in range(8)])
    if mode.value is PointValue.ALONG:
        values = corners @ np.array(mode.axis or edits.up)
        return float(values.min()), float(values.max())
    eye = camera.position if camera is not None else scene.bounds.mean(axis=0)
    return 0.0, float(np.linalg.norm(corners - eye, axis=1).max())


def without_clipped_cells(draw: "DrawList", edits: "Edits", scene: "Scene") -> "DrawList":
    """The draw list without the runs of cells that clips remove completely, and of grids that are hidden."""
    clips, gone = active(edits.clips), hidden_cells(scene, frozenset(edits.hidden_stations))
    if (not clips and gone is None) or len(draw.cells) == 0:
        return draw
    centre = scene.origin + (scene.cell_coords[draw.cells] + 0.5) * scene.cell_size
    left = may_contain(clips, centre, 0.5 * scene.cell_size)[draw.slot]
    if gone is not None:
        left &= ~gone[draw.cells[draw.slot]]
    count = draw.count[left]
    return replace(draw, first=draw.first[left], count=count, slot=draw.slot[left], points=int(count.sum()))
