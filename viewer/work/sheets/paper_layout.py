"""Sheets of standard paper: which parts of it hold what, and the scale that fits.

Frame: millimetres of paper, the origin in the lower left corner of the sheet, y up.
"""

from dataclasses import dataclass

import numpy as np

from ...common.errors import InputError, Option

SIZES: dict[str, tuple[float, float]] = {
    "A4": (210.0, 297.0), "A3": (297.0, 420.0), "A2": (420.0, 594.0), "A1": (594.0, 841.0), "A0": (841.0, 1189.0),
}  # fmt: skip
"""Name -> shorter and longer side (ISO 216), smallest paper first."""
DPI = {"A4": 300, "A3": 300, "A2": 300, "A1": 200, "A0": 150}
"""Pixels an inch of the picture unless given: at most 35 million pixels, 1.4 GB while it is drawn."""
ORIENTATIONS = ("landscape", "portrait")
STEPS = (1.0, 2.0, 5.0, 10.0)
"""Standard scales are 1 to these, times powers of ten (ISO 5455); from 1:5 on."""
LARGEST = 5.0
_BINDING, _MARGIN = 20.0, 10.0
"""From the left edge, where sheets are bound, and from the others, to the frame (ISO 5457)."""
_LABELS = 5.0
"""Width of the band of coordinates between the frame and the drawing."""
_BLOCK = 36.0
"""Height of the strip with title block, scale bar and north arrow."""
_CLEAR = 2.0
"""Between the drawing and its edge, at least."""
Rectangle = tuple[float, float, float, float]
"""Left, bottom, width, height."""


@dataclass(frozen=True)
class Layout:
    """A sheet.  size: a key of SIZES.  orientation: one of ORIENTATIONS."""

    size: str
    orientation: str

    @property
    def sides(self) -> tuple[float, float]:
        """Width and height of the sheet."""
        short, long = SIZES[self.size]
        return (long, short) if self.orientation == "landscape" else (short, long)

    @property
    def frame(self) -> Rectangle:
        """Everything printed lies within."""
        width, height = self.sides
        return _BINDING, _MARGIN, width - _BINDING - _MARGIN, height - 2 * _MARGIN

    @property
    def strip(self) -> Rectangle:
        """The lowest part of the frame: title block, scale bar, north arrow."""
        left, bottom, width, _ = self.frame
        return left, bottom, width, _BLOCK

    @property
    def area(self) -> Rectangle:
        """Where the drawing lies; coordinates are written around it."""
        left, bottom, width, height = self.frame
        return left + _LABELS, bottom + _BLOCK + _LABELS, width - 2 * _LABELS, height - _BLOCK - 2 * _LABELS

    @property
    def room(self) -> tuple[float, float]:
        """Width and height of what a drawing may be."""
        return self.area[2] - 2 * _CLEAR, self.area[3] - 2 * _CLEAR

    @property
    def dpi(self) -> int:
        """Pixels an inch of the picture unless given."""
        return DPI[self.size]


def standard_scale(least: float) -> float:
    """The smallest N of the standard scales 1:N that is not below ``least`` (above 0)."""
    if least <= LARGEST:
        return LARGEST
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(step * power for step in STEPS if step * power >= least * (1 - 1e-12)))


def fitted(size: str, orientation: str | None, extent: tuple[float, float], scale: float | None) -> tuple[Layout, float]:
    """The layout and the scale for something of ``extent`` (width, height), metres.

    orientation: None chooses that which leaves the larger scale, or the room that is used better.  scale: N of 1:N; None: the
    largest standard one that fits.  Raises InputError where a given scale does not fit, with the paper and the scale that do.
    """
    layouts = [Layout(size, each) for each in ORIENTATIONS if orientation in (None, each)]
    needed = [needed_scale(layout, extent) for layout in layouts]
    best = int(np.argmin(needed))
    layout, least = layouts[best], needed[best]
    if scale is None:
        return layout, standard_scale(least)
    if least <= scale * (1 + 1e-9):
        return layout, scale
    wide, high = (side * 1000 / scale for side in extent)
    larger = next((name for name in SIZES if any(needed_scale(Layout(name, each), extent) <= scale
                                                 for each in ORIENTATIONS if orientation in (None, each))), None)
    papers: tuple[str | Option, ...] = (Option("--paper", larger), " or ") if larger else ()
    room = " x ".join(f"{side:.0f}" for side in layout.room)
    raise InputError(f"the drawing would be {wide:.0f} x {high:.0f} mm, {size} {layout.orientation} has room for {room} mm",
                     option="--scale", value=f"1:{scale:g}",
                     remedy=("choose ", *papers, Option("--scale", f"1:{standard_scale(least):g}")))


def needed_scale(layout: Layout, extent: tuple[float, float]) -> float:
    """N of the scale 1:N at which ``extent`` (width, height), metres, fills the room."""
    return max(1000.0 * side / room for side, room in zip(extent, layout.room, strict=True))


def grid_step(scale: float, metres: float, apart: float) -> float:
    """File units between two lines of the coordinate grid: 1, 2 or 5 times a power of ten, at least ``apart`` mm on paper."""
    least = apart / 1000 * scale / metres
    power = 10.0 ** np.floor(np.log10(least))
    return float(next(step * power for step in STEPS if step * power >= least * (1 - 1e-12)))


def grid_places(low: float, high: float, step: float) -> np.ndarray:
    """The multiples of ``step`` from ``low`` to ``high``, file units."""
    return np.arange(np.ceil(low / step - 1e-9), np.floor(high / step + 1e-9) + 1) * step + 0.0  # no -0


def grid_text(value: float, step: float) -> str:
    """A coordinate with the decimals that the step of the grid has."""
    return f"{value:.{max(0, -int(np.floor(np.log10(step) + 1e-9)))}f}"
