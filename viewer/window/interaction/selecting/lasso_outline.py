"""The outline of a lasso on the picture: drawn with the left button held, or set corner by corner by clicks."""

from typing import TYPE_CHECKING

import numpy as np

from ..tool import PointerEvent, ToolContext

if TYPE_CHECKING:
    from ....picture.camera import Camera
    from ...kit.overlay import OverlayCanvas

_STEP = 3.0
"""Design units between two corners of a line drawn by hand."""


class LassoOutline:
    """corners: of the picture, pixels.  camera: of the picture in which it was begun."""

    def __init__(self) -> None:
        self.corners: list[tuple[float, float]] = []
        self.camera: Camera | None = None
        self._pressed: tuple[float, float] | None = None
        self._drawn = False  # by hand, not by clicks

    def __bool__(self) -> bool:
        return bool(self.corners)

    def drop(self) -> None:
        """There is no outline any more."""
        self.corners, self.camera, self._pressed, self._drawn = [], None, None, False

    def take(self, event: PointerEvent, context: ToolContext) -> bool:
        """Handles an event of the left button.  Returns whether the outline is complete."""
        if event.kind == "press":
            self.camera = self.camera or context.camera
            self._pressed = event.position
        elif event.kind == "move" and self._pressed is not None:
            near = self.corners[-1] if self._drawn else self._pressed
            if np.hypot(event.position[0] - near[0], event.position[1] - near[1]) >= context.pixels(_STEP):
                if not self._drawn and not self.corners:
                    self._drawn, self.corners = True, [self._pressed]
                if self._drawn:
                    self.corners.append(event.position)
        elif event.kind in ("release", "leave"):
            self._pressed = None
            if self._drawn:
                return len(self.corners) >= 3 or self.drop() or False
            if event.clicks == 1:
                self.corners.append(event.position)
            return event.clicks == 2 and len(self.corners) >= 3
        return False

    def take_back(self) -> None:
        """Drops the last corner set by a click."""
        if self.corners and not self._drawn:
            self.corners.pop()
        if not self.corners:
            self.drop()

    def draw(self, overlay: "OverlayCanvas", pointer: tuple[float, float] | None) -> None:
        """Draws it with a line to the pointer."""
        ahead = [pointer] if pointer is not None and self.corners and not self._drawn else []
        if len(self.corners) + len(ahead) >= 2:
            overlay.outline([*self.corners, *ahead], "warn")
