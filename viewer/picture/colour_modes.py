"""By what points are coloured: the table of colour modes, and the colours that each gives.

A mode shows one of the values that the rasterisers know of a point (PointValue), through a colour ramp or a colour for each
class or station.  Look, window, legend, shaders and compiled loops read the table: a new mode of such a value is one row here.
A new value is an entry of PointValue, a line each in shaders/common_edits.glsl and viewer/render/raster/point_loops.py, and the
ends of its ramp in viewer/render/raster/edit_block.py.
"""

from dataclasses import dataclass
from enum import Enum, IntEnum
from typing import Literal

import numpy as np

LEVELS = 256


class PointValue(IntEnum):
    """What of a point is shown.  Shaders have the numbers as BY_NAME; new values come last, as compiled loops that are kept on
    disk hold the numbers."""

    COLOUR = 0
    INTENSITY = 1
    ALONG = 2
    """Coordinate along an axis."""
    CLASS = 3
    STATION = 4
    DISTANCE = 5
    """From the camera."""


class Need(Enum):
    """What a scan must have: the reason that is shown where it lacks it."""

    INTENSITY = "this scan has no intensity"
    CLASSES = "this scan has no classification"
    STATIONS = "this scan is a single station"


@dataclass(frozen=True)
class ColourMode:
    """text: for people.  legend: how colours are explained and chosen: a ramp between two ends, or a list.

    axis: unit vector, file frame, of PointValue.ALONG; None: the up axis.
    """

    text: str
    value: PointValue
    legend: Literal["none", "ramp", "classes", "stations"] = "ramp"
    needs: Need | None = None
    axis: tuple[float, float, float] | None = None


COLOUR_BY: dict[str, ColourMode] = {
    "rgb": ColourMode("the scan's own colours", PointValue.COLOUR, "none"),
    "intensity": ColourMode("strength of the returned laser pulse, as stored", PointValue.INTENSITY, needs=Need.INTENSITY),
    "height": ColourMode("coordinate along the up axis", PointValue.ALONG),
    "class": ColourMode("classification of the file (LAS codes)", PointValue.CLASS, "classes", Need.CLASSES),
    "station": ColourMode("scan, or station of a scan", PointValue.STATION, "stations", Need.STATIONS),
    "distance": ColourMode("distance from the camera", PointValue.DISTANCE),
}
"""What points are coloured by.  The network and the hole fill know RGB only: with anything else the picture shows points."""
RAMPS: dict[str, tuple[tuple[int, int, int], ...]] = {
    "viridis": ((68, 1, 84), (72, 24, 106), (71, 45, 123), (66, 64, 134), (59, 82, 139), (51, 99, 141), (44, 114, 142),
                (38, 130, 142), (33, 145, 140), (31, 160, 136), (40, 174, 128), (63, 188, 115), (94, 201, 98), (132, 212, 75),
                (173, 220, 48), (216, 226, 25), (253, 231, 37)),
    "turbo": ((48, 18, 59), (64, 64, 162), (70, 107, 227), (66, 148, 255), (40, 188, 235), (24, 221, 194), (50, 242, 152),
              (109, 254, 98), (164, 252, 60), (205, 236, 52), (238, 207, 58), (253, 172, 52), (251, 126, 33), (235, 80, 14),
              (208, 47, 5), (169, 22, 1), (122, 4, 3)),
    "grey": ((0, 0, 0), (255, 255, 255)),
}  # fmt: skip
"""Evenly spaced colours between which is interpolated; viridis (van der Walt and Smith) and turbo (Mikhailov) as
matplotlib has them."""
CLASSES: dict[int, tuple[str, tuple[int, int, int]]] = {
    0: ("never classified", (150, 150, 150)), 1: ("unclassified", (180, 180, 180)), 2: ("ground", (165, 112, 60)),
    3: ("low vegetation", (150, 200, 90)), 4: ("medium vegetation", (90, 170, 60)), 5: ("high vegetation", (30, 120, 40)),
    6: ("building", (225, 90, 70)), 7: ("low point (noise)", (255, 0, 255)), 8: ("model key point", (255, 220, 60)),
    9: ("water", (60, 130, 230)), 10: ("rail", (120, 100, 160)), 11: ("road surface", (95, 95, 105)),
    13: ("wire, guard", (250, 210, 120)), 14: ("wire, conductor", (250, 180, 40)), 15: ("transmission tower", (210, 140, 200)),
    16: ("wire connector", (250, 150, 90)), 17: ("bridge deck", (130, 160, 190)), 18: ("high noise", (200, 0, 200)),
}  # fmt: skip
"""Codes of ASPRS LAS 1.4 (R15, table 17) and a colour each; others get one of STATION_COLOURS.  Vegetation is green, water
blue, wires yellow.  The nearest two differ by 8.5 (CIEDE2000: wire and model key point); ground, buildings, roads, rails,
bridges and water differ by 12 and more, kinds of vegetation by 10.7.  Seen by a deuteranope (Machado 2009), building and medium
vegetation differ by 1.4 only."""
STATION_COLOURS = (
    (76, 136, 230), (240, 150, 60), (90, 190, 100), (225, 85, 95), (160, 120, 215), (165, 115, 85), (235, 135, 195),
    (130, 135, 145), (200, 200, 70), (70, 200, 210), (40, 90, 160), (250, 200, 150),
)  # fmt: skip
"""In turn.  The nearest two differ by 14 (CIEDE2000), of the first six by 19; the contrast to black is at least 3.1 : 1, to
white 1.5 : 1.  Seen without red or green cones (Machado 2009) the nearest two differ by 2.5 and 4.5."""


def ramp_colours(name: str) -> np.ndarray:
    """(256, 3) uint8: a key of RAMPS, interpolated."""
    knots = np.array(RAMPS[name], np.float64)
    at = np.linspace(0, len(knots) - 1, LEVELS)
    return np.stack([np.rint(np.interp(at, np.arange(len(knots)), knots[:, c])) for c in range(3)], 1).astype(np.uint8)


def category_colours(colour_by: str) -> np.ndarray:
    """(256, 3) uint8: the colour of each class or station number, in a mode whose legend lists them."""
    colours = np.array([STATION_COLOURS[i % len(STATION_COLOURS)] for i in range(LEVELS)], np.uint8)
    if COLOUR_BY[colour_by].legend == "classes":
        for code, (_, colour) in CLASSES.items():
            colours[code] = colour
    return colours


def colours_of(colour_by: str, ramp: str) -> np.ndarray:
    """(256, 3) uint8: the colours that the levels of the attribute get in a mode."""
    return category_colours(colour_by) if COLOUR_BY[colour_by].legend in ("classes", "stations") else ramp_colours(ramp)


def levels(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Rows of the ramp, (n,) intp, of attribute values: 0 at ``low`` and below, 255 at ``high`` and above, to the nearest.

    Where high <= low everything at or below low is 0 and the rest 255."""
    if not high > low:
        return np.where(np.asarray(values, np.float64) <= low, 0, LEVELS - 1)
    share = (np.asarray(values, np.float64) - low) / (high - low)
    return np.floor(np.clip(share, 0.0, 1.0) * (LEVELS - 1) + 0.5).astype(np.intp)
