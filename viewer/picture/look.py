"""The look: by what points are coloured, and how a finished picture is developed.

Two parts, both plain NumPy here, which the shaders are tested against:

- **Colour by attribute**: every point gets a colour from its intensity, height, class, station or distance instead of its RGB,
  before the points of a pixel are averaged (shaders/common_recolour.glsl).
- **Development** of the finished picture: point size and eye-dome lighting (raw and filtered views, which show points), then
  exposure, white balance and brightness as one table of 256 levels a channel, exact to the byte.

Colours are sRGB levels, uint8; pictures are premultiplied by alpha as in viewer.render.frame.
"""

from dataclasses import dataclass

import numpy as np

from ..common.errors import InputError

COLOUR_BY: dict[str, str] = {
    "rgb": "the scan's own colours",
    "intensity": "strength of the returned laser pulse, as stored",
    "height": "coordinate along the up axis",
    "class": "classification of the file (LAS codes)",
    "station": "scan, or station of a scan",
    "distance": "distance from the camera",
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
"""Evenly spaced colours between which is interpolated; viridis and turbo as matplotlib has them."""
CLASSES: dict[int, tuple[str, tuple[int, int, int]]] = {
    0: ("never classified", (150, 150, 150)), 1: ("unclassified", (180, 180, 180)), 2: ("ground", (165, 112, 60)),
    3: ("low vegetation", (150, 200, 90)), 4: ("medium vegetation", (90, 170, 60)), 5: ("high vegetation", (30, 120, 40)),
    6: ("building", (225, 90, 70)), 7: ("low point (noise)", (255, 0, 255)), 8: ("model key point", (255, 220, 60)),
    9: ("water", (60, 130, 230)), 10: ("rail", (120, 100, 160)), 11: ("road surface", (95, 95, 105)),
    13: ("wire, guard", (250, 210, 120)), 14: ("wire, conductor", (250, 180, 40)), 15: ("transmission tower", (210, 140, 200)),
    16: ("wire connector", (250, 150, 90)), 17: ("bridge deck", (130, 160, 190)), 18: ("high noise", (200, 0, 200)),
}  # fmt: skip
"""Codes of ASPRS LAS 1.4 (R15, table 17) and a colour each, chosen by eye; others get one of STATION_COLOURS."""
STATION_COLOURS = (
    (76, 136, 230), (240, 150, 60), (90, 190, 100), (225, 85, 95), (160, 120, 215), (165, 115, 85), (235, 135, 195),
    (130, 135, 145), (200, 200, 70), (70, 200, 210), (40, 90, 160), (250, 200, 150),
)  # fmt: skip
"""In turn; chosen by eye to be told apart on dark and light."""
LEVELS = 256
EXPOSURE_RANGE = 5.0
"""Stops up or down."""
MOST_POINT_SIZE = 15
EDL_GAIN = 300.0
"""Of eye-dome lighting at strength 1, as in CloudCompare's and Potree's shaders."""


@dataclass(frozen=True)
class Look:
    """colour_by: a key of COLOUR_BY.  ramp: a key of RAMPS.  low, high: the attribute at the ends of the ramp, in its own unit;
    None: the scan's extremes.

    exposure: stops (doublings of linear light).  brightness: -1..1, a gamma of 2**-brightness, which keeps black and white.
    temperature: -1 (bluer) to 1 (warmer), tint: -1 (greener) to 1 (more magenta); half a stop per unit.
    point_size: pixels, 1 to MOST_POINT_SIZE.  edl: strength of eye-dome lighting, 0 (none) to 1; both in raw and filtered
    views.
    """

    colour_by: str = "rgb"
    ramp: str = "viridis"
    low: float | None = None
    high: float | None = None
    exposure: float = 0.0
    brightness: float = 0.0
    temperature: float = 0.0
    tint: float = 0.0
    point_size: int = 1
    edl: float = 0.0

    def __post_init__(self) -> None:
        for name, table in (("colour_by", COLOUR_BY), ("ramp", RAMPS)):
            if getattr(self, name) not in table:
                raise InputError(f"{name} {getattr(self, name)!r}: expected one of {', '.join(table)}")
        limits = {"exposure": EXPOSURE_RANGE, "brightness": 1.0, "temperature": 1.0, "tint": 1.0}
        for name, most in limits.items():
            if not abs(getattr(self, name)) <= most:
                raise InputError(f"{name} {getattr(self, name)!r}: expected a number from {-most:g} to {most:g}")
        for name in ("low", "high"):
            value = getattr(self, name)
            if value is not None and not np.isfinite(value):
                raise InputError(f"{name} {value!r}: expected a finite number")
        if not (1 <= self.point_size <= MOST_POINT_SIZE and self.point_size == int(self.point_size)):
            raise InputError(f"point size {self.point_size!r}: expected whole pixels from 1 to {MOST_POINT_SIZE}")
        if not 0 <= self.edl <= 1:
            raise InputError(f"eye-dome lighting {self.edl!r}: expected a strength from 0 to 1")

    @property
    def develops(self) -> bool:
        """Whether the finished picture's tones change."""
        return any((self.exposure, self.brightness, self.temperature, self.tint))

    @property
    def shapes_points(self) -> bool:
        """Whether points look other than one pixel each, flat."""
        return self.point_size > 1 or self.edl > 0


def ramp_colours(name: str) -> np.ndarray:
    """(256, 3) uint8: a key of RAMPS, interpolated."""
    knots = np.array(RAMPS[name], np.float64)
    at = np.linspace(0, len(knots) - 1, LEVELS)
    return np.stack([np.rint(np.interp(at, np.arange(len(knots)), knots[:, c])) for c in range(3)], 1).astype(np.uint8)


def category_colours(colour_by: str) -> np.ndarray:
    """(256, 3) uint8: the colour of each class (``class``) or station (``station``) number."""
    colours = np.array([STATION_COLOURS[i % len(STATION_COLOURS)] for i in range(LEVELS)], np.uint8)
    if colour_by == "class":
        for code, (_, colour) in CLASSES.items():
            colours[code] = colour
    return colours


def table_of(look: Look) -> np.ndarray:
    """(256, 3) uint8: the colours that the levels of the attribute get."""
    return category_colours(look.colour_by) if look.colour_by in ("class", "station") else ramp_colours(look.ramp)


def levels(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Rows of the ramp, (n,) intp, of attribute values: 0 at ``low`` and below, 255 at ``high`` and above, to the nearest.

    Where high <= low everything at or below low is 0 and the rest 255."""
    if not high > low:
        return np.where(np.asarray(values, np.float64) <= low, 0, LEVELS - 1)
    share = (np.asarray(values, np.float64) - low) / (high - low)
    return np.floor(np.clip(share, 0.0, 1.0) * (LEVELS - 1) + 0.5).astype(np.intp)


def tone_curves(look: Look) -> np.ndarray:
    """(256, 3) uint8: what each sRGB level of red, green and blue becomes.

    Exposure and white balance multiply linear light; the gains keep the luminance of grey (Rec. 709 weights).  Brightness is a
    gamma on the sRGB levels.
    """
    gains = 2.0 ** (0.5 * np.array([look.temperature + 0.5 * look.tint, -look.tint, -look.temperature + 0.5 * look.tint]))
    gains *= 2.0**look.exposure / (gains @ (0.2126, 0.7152, 0.0722))
    light = _to_linear(np.arange(LEVELS)[:, None] / (LEVELS - 1)) * gains
    levels_ = _to_srgb(np.clip(light, 0.0, 1.0)) ** (2.0**-look.brightness)
    return np.rint(levels_ * (LEVELS - 1)).astype(np.uint8)


def _to_linear(srgb: np.ndarray) -> np.ndarray:
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def _to_srgb(linear: np.ndarray) -> np.ndarray:
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)


def toned(image: np.ndarray, curves: np.ndarray) -> np.ndarray:
    """A premultiplied picture (H, W, 4) uint8 after ``tone_curves``; alpha stays.  Whole numbers: shaders give these bytes."""
    alpha = image[..., 3:].astype(np.int64)
    straight = np.minimum((image[..., :3].astype(np.int64) * 255 + alpha // 2) // np.maximum(alpha, 1), 255)
    colour = np.stack([curves[straight[..., c], c] for c in range(3)], axis=-1).astype(np.int64)
    return np.concatenate([(colour * alpha + 127) // 255, alpha], axis=-1).astype(np.uint8)


def disc(size: int) -> list[tuple[int, int]]:
    """Offsets (dx, dy) of the pixels that a point of ``size`` pixels covers, itself first, then by distance."""
    low, high = -((size - 1) // 2), size // 2
    middle = (low + high) / 2
    found = [(x, y) for y in range(low, high + 1) for x in range(low, high + 1)
             if (x - middle) ** 2 + (y - middle) ** 2 <= (size / 2) ** 2]
    return sorted(found, key=lambda at: (at[0] ** 2 + at[1] ** 2, at[1], at[0]))


def enlarged(image: np.ndarray, depth: np.ndarray, size: int) -> tuple[np.ndarray, np.ndarray]:
    """Pixels drawn as discs of ``size`` pixels, the nearest in front.  image: (H, W, 4) uint8; depth: (H, W) float32, +inf
    where ``image`` holds nothing.  Returns both, enlarged; of equal depths the one whose centre is nearer wins."""
    height, width = depth.shape
    out, nearest = image.copy(), depth.copy()
    for dx, dy in disc(size)[1:]:
        y0, y1, x0, x1 = max(dy, 0), height + min(dy, 0), max(dx, 0), width + min(dx, 0)
        if y0 >= y1 or x0 >= x1:
            continue
        here, there = np.s_[y0:y1, x0:x1], np.s_[y0 - dy : y1 - dy, x0 - dx : x1 - dx]
        front = depth[there] < nearest[here]
        nearest[here] = np.where(front, depth[there], nearest[here])
        out[here] = np.where(front[..., None], image[there], out[here])
    return out, nearest


def eye_dome(depth: np.ndarray, strength: float, radius: int = 1) -> np.ndarray:
    """(H, W) float64 in 0..1: what eye-dome lighting multiplies colours with (Boucheny 2009).

    ``exp(-EDL_GAIN * strength * mean(max(0, log2(z) - log2(z_neighbour))))`` over the eight neighbours at ``radius``;
    neighbours that hold nothing or lie outside count 0, an empty pixel is 1.
    """
    log = np.where(np.isfinite(depth), np.log2(np.where(np.isfinite(depth), depth, 1.0)), np.inf)
    padded = np.pad(log, radius, constant_values=np.inf)
    height, width = depth.shape
    total = np.zeros(depth.shape)
    for dy in (-radius, 0, radius):
        for dx in (-radius, 0, radius):
            if dx or dy:
                other = padded[radius + dy : radius + dy + height, radius + dx : radius + dx + width]
                with np.errstate(invalid="ignore"):
                    total += np.where(np.isfinite(log) & np.isfinite(other), np.maximum(0.0, log - other), 0.0)
    return np.exp(-EDL_GAIN * strength * total / 8)
