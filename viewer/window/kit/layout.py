"""Where things are in the window: the scene list at the left, the look panel at the right, the status bar, and the picture.

The picture has the space that they leave, so that the camera frames what is uncovered.  Lengths are pixels of the
interface; ``scale`` is pixels per design unit (theme.Theme.scale).  No imgui and no GL.
"""

from dataclasses import dataclass

RAIL, SCENES, LOOK, STATUS = 44.0, 232.0, 316.0, 30.0
"""Widths of a folded panel, of the scene list and of the look panel, and the height of the status bar; design units."""
NARROW = 900.0
"""Width of the window below which the panels fold to their icons; design units."""
LEAST_PICTURE = 300.0
"""Width of the picture below which an open panel lies over it; design units."""


@dataclass(frozen=True)
class Rect:
    """A rectangle, pixels of the interface."""

    left: float
    top: float
    width: float
    height: float


@dataclass(frozen=True)
class Layout:
    """scenes, look: the two panels, open or folded.  status: the status bar.  None where the interface is hidden.
    covering: whether an open panel lies over the picture."""

    picture: Rect
    scenes: Rect | None = None
    look: Rect | None = None
    status: Rect | None = None
    covering: bool = False


@dataclass
class Panels:
    """Which panels are open.  Below NARROW they fold; above it those that were open before open again."""

    scenes: bool = True
    look: bool = True

    def __post_init__(self) -> None:
        self._narrow = False
        self._before = (True, True)

    def fit(self, width: float, scale: float) -> None:
        """Takes note of the window's width."""
        narrow = width < NARROW * scale
        if narrow and not self._narrow:
            self._before = (self.scenes, self.look)
            self.scenes = self.look = False
        elif self._narrow and not narrow:
            self.scenes, self.look = self.scenes or self._before[0], self.look or self._before[1]
        self._narrow = narrow


def arrange(width: float, height: float, scale: float, panels: Panels) -> Layout:
    """The layout of a window with a scene.  width, height: of the window."""
    rail, bar = RAIL * scale, min(STATUS * scale, height / 4)
    tall = height - bar
    left = min(SCENES * scale, width - 2 * rail) if panels.scenes else rail
    right = min(LOOK * scale, width - 2 * rail) if panels.look else rail
    taken_left, taken_right, covering = left, right, False
    if width - left - right < LEAST_PICTURE * scale:
        taken_left, taken_right, covering = rail, rail, panels.scenes or panels.look
    picture = Rect(taken_left, 0.0, max(width - taken_left - taken_right, 1.0), max(tall, 1.0))
    scenes, look = Rect(0.0, 0.0, left, tall), Rect(width - right, 0.0, right, tall)
    return Layout(picture, scenes, look, Rect(0.0, tall, width, bar), covering)
