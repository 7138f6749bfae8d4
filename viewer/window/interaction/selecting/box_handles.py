"""The box of a selection: put around a clicked point, its faces dragged by their handles, its numbers typed."""

from typing import TYPE_CHECKING, Any

import numpy as np

from ....picture.clip import Box, Vector, vector
from ..clipping.clip_numbers import clip_fields
from ..clipping.clip_tool import EDGES, GRIP, along_axis, extent_of, handles, with_face_moved
from ..tool import PointerEvent, ToolContext

if TYPE_CHECKING:
    from ...kit.overlay import OverlayCanvas

_FIRST = 0.05
"""Of the scan's extent: half the side of a new box."""
_LEAST = 1e-4


class BoxHandles:
    """box: None until a point has been clicked."""

    def __init__(self) -> None:
        self.box: Box | None = None
        self._face: int | None = None
        self._grabbed = 0.0
        self._start: Box | None = None

    def put(self, context: ToolContext, place: Vector) -> None:
        """Puts the box around a place; a new one is a cube."""
        half = self.box.half if self.box is not None else vector(np.full(3, _FIRST * extent_of(context)))
        self.box = Box(place, half, name="selection box")

    def pointer(self, event: PointerEvent, context: ToolContext) -> bool:
        """Takes hold of a face, drags it, lets it go.  Returns whether the event was used."""
        if event.kind == "press" and event.button == "left" and self.box is not None:
            return self._grab(event.position, self.box, context)
        if self._face is None or self._start is None:
            return False
        if event.kind == "move":
            place, normal = handles(self._start)[self._face]
            along = along_axis(*context.ray(event.position), place, normal)
            if along is not None:
                moved = with_face_moved(self._start, self._face, along - self._grabbed, _LEAST * extent_of(context))
                self.box = moved if isinstance(moved, Box) else self.box
        if event.kind in ("release", "leave"):
            self._face = self._start = None
        return True

    def _grab(self, position: tuple[float, float], box: Box, context: ToolContext) -> bool:
        found = handles(box)
        pixels, _ = context.camera.project([place for place, _ in found])
        away = np.nan_to_num(np.linalg.norm(pixels - position, axis=1), nan=np.inf)
        face = int(away.argmin())
        along = along_axis(*context.ray(position), *found[face]) if away[face] <= context.pixels(GRIP) else None
        if along is None:
            return False
        self._face, self._grabbed, self._start = face, along, box
        return True

    def draw(self, overlay: "OverlayCanvas") -> None:
        """Edges and handles."""
        if self.box is None:
            return
        corners = self.box.corners
        for a, b in EDGES:
            overlay.line(corners[a], corners[b], "warn", 1.5)
        for number, (place, _) in enumerate(handles(self.box)):
            overlay.marker(place, "accent" if number == self._face else "warn", 7.0, "diamond")

    def panel(self, ui: Any, places: int, context: ToolContext) -> None:
        """Its numbers.  places: decimals."""
        if self.box is not None and context.scene is not None:
            clip_fields(ui, self.box, places, context.scene.bounds, self._typed)

    def _typed(self, _what: str, clip: Any, _field: str) -> None:
        self.box = clip
