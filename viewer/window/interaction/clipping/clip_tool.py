"""Clip: boxes and slabs with handles.  A handle sits on each face; dragging it moves that face along its normal.

The rule of how clips combine is that of viewer.picture.clip; everything is a step in the document's history.
"""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ....picture.clip import MOST_CLIPS, Box, Clip, Slab, active, box_around, vector
from ....work.document import replaced, unique_name, without
from ...kit import icons
from ..editing import edit, end, metres_per_unit, unit_of
from ..outline import Group, Row
from ..tool import KeyEvent, Overlay, PointerEvent, Tool, ToolContext
from .box_volume import BoxVolume
from .clip_numbers import clip_fields, limited_field, size_limits

if TYPE_CHECKING:
    from ...kit.overlay import OverlayCanvas
    from ...kit.worker import Worker

GRIP = 14.0
"""Logical pixels around a handle that take hold of it."""
EDGES = [(i, i | 1 << k) for i in range(8) for k in range(3) if not i >> k & 1]
"""Of a box: numbers of the two corners of each."""
_MARGIN = 0.01
"""Of the scan's extent along an axis: how far a new box reaches beyond it."""
_LEAST = 1e-4
"""Of the scan's extent: the smallest half size that dragging leaves."""


def handles(clip: Clip) -> list[tuple[np.ndarray, np.ndarray]]:
    """(place, outward unit normal) of each face, file coordinates."""
    centre = np.array(clip.centre)
    if isinstance(clip, Slab):
        normal = np.array(clip.normal)
        return [(centre + sign * clip.thickness / 2 * normal, sign * normal) for sign in (-1.0, 1.0)]
    axes = np.array(clip.axes)
    return [(centre + sign * clip.half[k] * axes[k], sign * axes[k]) for k in range(3) for sign in (-1.0, 1.0)]


def along_axis(origin: np.ndarray, ray: np.ndarray, place: np.ndarray, axis: np.ndarray) -> float | None:
    """How far from ``place`` along the unit vector ``axis`` the point lies that is nearest to a viewing ray.

    origin, ray: (3,) start and unit direction.  None where the ray runs along the axis.
    """
    cosine = float(axis @ ray)
    spread = 1.0 - cosine**2
    if spread < 1e-4:
        return None
    way = origin - place
    return float((way @ axis - cosine * (way @ ray)) / spread)


def with_face_moved(clip: Clip, face: int, by: float, least: float) -> Clip:
    """The clip with one face (a row of :func:`handles`) moved outward; the opposite face stays.  least: smallest half size."""
    axis, sign = divmod(face, 2)
    outward = 1.0 if sign else -1.0
    if isinstance(clip, Slab):
        half = max(clip.thickness / 2 + by / 2, least)
        shift = outward * (half - clip.thickness / 2) * np.array(clip.normal)
        return replace(clip, thickness=2 * half, centre=vector(np.array(clip.centre) + shift))
    half = max(clip.half[axis] + by / 2, least)
    shift = outward * (half - clip.half[axis]) * np.array(clip.axes[axis])
    sizes = list(clip.half)
    sizes[axis] = half
    return replace(clip, half=vector(np.array(sizes)), centre=vector(np.array(clip.centre) + shift))


def turned(clip: Clip, degrees: float, up: np.ndarray) -> Clip:
    """The clip turned about the up axis through its centre."""
    angle, axis = np.radians(degrees), np.asarray(up, np.float64)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    rotation = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    if isinstance(clip, Slab):
        return replace(clip, normal=vector(rotation @ np.array(clip.normal)))
    a, b, c = (vector(row) for row in np.array(clip.axes) @ rotation.T)
    return replace(clip, axes=(a, b, c))


def slab_outline(slab: Slab, extent: float) -> list[np.ndarray]:
    """Two (4, 3) squares, file coordinates: the slab's planes as they are drawn."""
    normal = np.array(slab.normal)
    side = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    side /= np.linalg.norm(side)
    other = np.cross(normal, side)
    square = np.array([side + other, side - other, -side - other, -side + other]) * extent / 2
    return [np.array(slab.centre) + sign * slab.thickness / 2 * normal + square for sign in (-1.0, 1.0)]


def extent_of(context: ToolContext) -> float:
    """The scan's largest extent, file units."""
    assert context.scene is not None
    return float(np.ptp(context.scene.bounds, axis=0).max())


class ClipOutlines(Overlay):
    """The edges of all active clips."""

    name = "clips"

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        if context.scene is None:
            return
        for clip in active(context.document.clips):
            colour = "bad" if clip.removes else "accent"
            if isinstance(clip, Box):
                corners = clip.corners
                for a, b in EDGES:
                    overlay.line(corners[a], corners[b], colour, 1.5)
            else:
                for square in slab_outline(clip, extent_of(context)):
                    overlay.polyline(square, colour, 1.5, closed=True)


class ClipTool(Tool):
    """Adds clips, drags their faces, turns and removes them."""

    name, label, icon, key = "clip", "Clip", icons.CLIP, "B"
    help = "clip boxes and slabs: drag a face by its handle"
    cursor = "hand"

    def __init__(self) -> None:
        self.chosen = 0
        self._face: int | None = None  # dragged
        self._grabbed = 0.0  # where on the axis the handle was taken hold of
        self._start: Clip | None = None
        self._dragged: Clip | None = None  # the clip as the drag has left it
        self._gesture = 0
        self.volume = BoxVolume()

    def _clip(self, context: ToolContext) -> Clip | None:
        clips = context.document.clips
        self.chosen = min(self.chosen, max(len(clips) - 1, 0))
        return clips[self.chosen] if clips else None

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        clip = self._clip(context)
        if clip is None or context.scene is None or not clip.active:
            return False
        if event.kind == "press" and event.button == "left":
            return self._grab(event.position, clip, context)
        if self._face is None or self._start is None:
            return False
        if clip is not self._dragged:  # it was undone or deleted meanwhile: the drag has ended, and changes no other clip
            self._face = self._start = None
            return True
        if event.kind == "move":
            place, normal = handles(self._start)[self._face]
            along = along_axis(*context.ray(event.position), place, normal)
            if along is not None:
                moved = with_face_moved(self._start, self._face, along - self._grabbed, _LEAST * extent_of(context))
                self._store(context, f"Move a face of {clip.name}", moved, ("face", self._gesture))
                self._dragged = self._clip(context)
        if event.kind in ("release", "leave"):
            self._face = self._start = None
        return True

    def _grab(self, position: tuple[float, float], clip: Clip, context: ToolContext) -> bool:
        """Takes hold of the handle under the pointer.  Returns whether there is one."""
        found = handles(clip)
        pixels, _ = context.camera.project([place for place, _ in found])
        with np.errstate(invalid="ignore"):
            away = np.linalg.norm(pixels - position, axis=1)
        if not (np.nan_to_num(away, nan=np.inf) <= context.pixels(GRIP)).any():
            return False
        face = int(np.nanargmin(away))
        along = along_axis(*context.ray(position), *found[face])
        if along is None:
            context.toast("This face is seen edge-on along its normal; look from another side to move it")
            return True
        self._face, self._grabbed, self._start, self._dragged = face, along, clip, clip
        self._gesture += 1
        return True

    def _store(self, context: ToolContext, label: str, clip: Clip, gesture: object = None) -> None:
        edit(context, label, gesture, clips=replaced(context.document.clips, self.chosen, clip))

    def key_event(self, event: KeyEvent, context: ToolContext) -> bool:
        if event.key == "DELETE" and event.kind == "press" and self._clip(context) is not None:
            edit(context, "Delete clip", clips=without(context.document.clips, self.chosen))
            return True
        return False

    def left(self, context: ToolContext) -> None:
        self._face = self._start = None

    def draw(self, overlay: "OverlayCanvas", context: ToolContext) -> None:
        clip = self._clip(context)
        if clip is None or context.scene is None or not clip.active:
            return
        for number, (place, _) in enumerate(handles(clip)):
            overlay.marker(place, "warn" if number == self._face else "accent", 7.0, "diamond")

    def add(self, context: ToolContext, kind: str) -> None:
        """Adds a box around the scan, which hides nothing yet, or a level or upright slab through its middle."""
        assert context.scene is not None
        low, high = context.scene.bounds
        middle, size = (low + high) / 2, np.maximum(high - low, 1e-6 * extent_of(context))
        name = unique_name({"box": "Box", "level": "Plan", "upright": "Section"}[kind],
                           (clip.name for clip in context.document.clips))
        up = np.array(context.document.up)
        if kind == "box":
            made: Clip = box_around(low - _MARGIN * size, high + _MARGIN * size, name)
        else:
            ahead = context.camera.forward - up * (context.camera.forward @ up)
            normal = up if kind == "level" or np.linalg.norm(ahead) < 1e-6 else ahead / np.linalg.norm(ahead)
            made = Slab(vector(middle), vector(normal), float(0.1 * size.max()), name=name)
        self.chosen = len(context.document.clips)
        edit(context, f"Add {name}", clips=(*context.document.clips, made))

    def outline(self, context: ToolContext) -> tuple[Group]:
        clips = context.document.clips

        def choose(number: int) -> None:
            self.chosen, self.wanted = number, True

        return (Group(
            "Clips", icons.CLIP, len(clips),
            lambda number: Row(clips[number].name, shown=clips[number].active, chosen=number == self.chosen), choose,
            show=lambda number, on: self._turn(context, number, on),
            rename=lambda number, name: edit(context, "Rename clip", ("clip", number),
                                             clips=replaced(clips, number, replace(clips[number], name=name))),
            commands={"Delete": lambda number: edit(context, f"Delete {clips[number].name}", clips=without(clips, number))},
        ),)  # fmt: skip

    def _turn(self, context: ToolContext, number: int, on: bool) -> None:
        """Turns a clip on or off, as far as so many can be on at once."""
        clips = context.document.clips
        if on and len(active(clips)) >= MOST_CLIPS:
            context.toast(f"{MOST_CLIPS} clips can be active at once; turn one off")
        else:
            edit(context, f"Turn {clips[number].name} {'on' if on else 'off'}",
                 clips=replaced(clips, number, replace(clips[number], active=on)))

    def panel(self, ui: Any, context: ToolContext) -> None:
        full = len(active(context.document.clips)) >= MOST_CLIPS
        ui.begin_disabled(full)
        for kind, label in (("box", "+ Box"), ("level", "+ Plan"), ("upright", "+ Section")):
            if ui.button(label):
                self.add(context, kind)
            if kind != "upright":
                ui.same_line()
        ui.end_disabled()
        if full:
            ui.text_wrapped(f"{MOST_CLIPS} clips can be active at once; turn one off.")
        clips = context.document.clips
        if not clips:
            ui.text_wrapped("A clip hides what lies outside it, or inside. Its faces are dragged by their handles.")
        for number, clip in enumerate(clips):
            ui.push_id(number)
            changed, on = ui.checkbox("##active", clip.active)
            if changed:
                self._turn(context, number, on)
            ui.same_line()
            if ui.selectable(clip.name, number == self.chosen)[0]:
                self.chosen = number
            ui.pop_id()
        chosen = self._clip(context)
        if chosen is not None:
            self._settings(ui, context, chosen)

    def _settings(self, ui: Any, context: ToolContext, clip: Clip) -> None:
        ui.separator()
        changed, removes = ui.checkbox("remove the inside", clip.removes)
        if changed:
            self._store(context, f"Invert {clip.name}", replace(clip, removes=removes))
        if isinstance(clip, Slab):
            thickness = limited_field(ui, "thickness", clip.thickness, f"%.4g {unit_of(context)} thick",
                                      size_limits(extent_of(context)))
            if thickness is not None:
                self._store(context, f"Thickness of {clip.name}", replace(clip, thickness=thickness), "thickness")
        metres = metres_per_unit(context)
        assert context.scene is not None
        clip_fields(ui, clip, max(0, min(6, round(3 + np.log10(metres)))) if metres else 3, context.scene.bounds,
                    lambda what, typed, field: self._store(context, what, typed, ("typed", field)))
        for degrees in (-15.0, 15.0):
            if ui.button(f"turn {degrees:+.0f}°"):
                self._store(context, f"Turn {clip.name}", turned(clip, degrees, np.array(context.document.up)))
            if degrees < 0:
                ui.same_line()
        if ui.button("Delete"):
            edit(context, f"Delete {clip.name}", clips=without(context.document.clips, self.chosen))
        if isinstance(clip, Box) and not clip.removes:
            self.volume.panel(ui, context, clip)

    def follow(self, context: ToolContext) -> None:
        self.volume.follow(context)

    @property
    def workers(self) -> "tuple[Worker | None]":
        return (self.volume.worker,)

    def close(self) -> None:
        end(self.volume.worker)
