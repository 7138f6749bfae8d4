"""Where things are in the window: the outliner at the left, the inspector at the right, the status bar, and the picture.

The picture has the space that they leave, so that the camera frames what is uncovered; a folded panel leaves all of it.
Lengths are pixels of the interface; ``scale`` is pixels per design unit (theme.Theme.scale).  No imgui and no GL.
"""

from dataclasses import dataclass

OUTLINER, INSPECTOR = (0.145, 180.0, 260.0), (0.17, 216.0, 316.0)
"""Width of a panel: its share of the window's, at least and at most so many design units.  At 1280 the picture has 68 %."""
STATUS = 30.0
"""Height of the status bar; design units."""
NARROW = 960.0
"""Width of the window below which the panels fold; design units."""
LEAST_PICTURE = 300.0
"""Width of the picture below which an open panel lies over it; design units."""
UNCOVERED = 44.0
"""Width beside a panel in a window that is narrower than it; design units."""


@dataclass(frozen=True)
class Rect:
    """A rectangle, pixels of the interface."""

    left: float
    top: float
    width: float
    height: float

    @property
    def right(self) -> float:
        return self.left + self.width


@dataclass(frozen=True)
class Layout:
    """outliner, inspector: the two panels, None where folded.  status: the status bar.  All None where the interface is
    hidden.  covering: whether an open panel lies over the picture."""

    picture: Rect
    outliner: Rect | None = None
    inspector: Rect | None = None
    status: Rect | None = None
    covering: bool = False

    @property
    def uncovered(self) -> Rect:
        """The part of the picture that no panel covers."""
        left = max(self.picture.left, self.outliner.right if self.outliner else 0.0)
        right = min(self.picture.right, self.inspector.left if self.inspector else self.picture.right)
        return Rect(left, self.picture.top, max(right - left, 1.0), self.picture.height)


@dataclass
class Panels:
    """Which panels are open.  Below NARROW they fold; above it those that were open before open again.  cube: whether the view
    cube is shown."""

    outliner: bool = True
    inspector: bool = True
    cube: bool = True

    def __post_init__(self) -> None:
        self._narrow = False
        self._before = (True, True)

    def fit(self, width: float, scale: float) -> None:
        """Takes note of the window's width."""
        narrow = width < NARROW * scale
        if narrow and not self._narrow:
            self._before = (self.outliner, self.inspector)
            self.outliner = self.inspector = False
        elif self._narrow and not narrow:
            self.outliner, self.inspector = self.outliner or self._before[0], self.inspector or self._before[1]
        self._narrow = narrow


def arrange(width: float, height: float, scale: float, panels: Panels) -> Layout:
    """The layout of a window with a scene.  width, height: of the window."""
    bar = min(STATUS * scale, height / 4)
    tall = height - bar
    left = _panel_width(OUTLINER, width, scale) if panels.outliner else 0.0
    right = _panel_width(INSPECTOR, width, scale) if panels.inspector else 0.0
    covering = width - left - right < LEAST_PICTURE * scale and left + right > 0
    picture = Rect(0.0, 0.0, width, tall) if covering else Rect(left, 0.0, width - left - right, tall)
    outliner = Rect(0.0, 0.0, left, tall) if panels.outliner else None
    inspector = Rect(width - right, 0.0, right, tall) if panels.inspector else None
    return Layout(picture, outliner, inspector, Rect(0.0, tall, width, bar), covering)


def _panel_width(wanted: tuple[float, float, float], width: float, scale: float) -> float:
    share, least, most = wanted
    return min(min(max(share * width, least * scale), most * scale), max(width - UNCOVERED * scale, 1.0))
