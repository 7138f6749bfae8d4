"""The look: by what points are coloured, and how a finished picture is developed.

Two parts, both plain NumPy here, which the shaders are tested against:

- **Colour by attribute** (viewer.picture.colour_modes): every point gets a colour from its intensity, height, class, station or
  distance instead of its RGB, before the points of a pixel are averaged (shaders/common_edits.glsl).
- **Development** of the finished picture: point size and eye-dome lighting (raw and filtered views, which show points), then
  exposure, white balance and brightness as one table of 256 levels a channel, exact to the byte.

Colours are sRGB levels, uint8; pictures are premultiplied by alpha as in viewer.render.frame.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from ...model.common.linear_light import LUMINANCE, to_linear, to_srgb
from ..common.errors import InputError
from .colour_modes import COLOUR_BY, LEVELS, RAMPS, PointValue

MOST_POINT_SIZE = 15
EDL_GAIN = 300.0
"""Of eye-dome lighting at strength 1, as in CloudCompare's and Potree's shaders."""


@dataclass(frozen=True)
class Tone:
    """What a field of Look does to the finished picture's tones.  most: it goes from -most to most; 0 does nothing.

    shown: how the window prints it.  curve: (sRGB levels in 0..1, the value) -> levels, clipped to 0..1 afterwards; None: it is
    one of the gains of linear light in :func:`tone_curves`.
    """

    most: float
    shown: str = "%+.2f"
    curve: Callable[[np.ndarray, float], np.ndarray] | None = None


def tone(most: float, shown: str = "%+.2f", curve: Callable[[np.ndarray, float], np.ndarray] | None = None) -> Any:
    """A field of Look that changes tones: its range, its slider and what it does; a new one needs nothing else."""
    return field(default=0.0, metadata={"tone": Tone(most, shown, curve)})


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
    exposure: float = tone(5.0, "%+.2f stops")
    brightness: float = tone(1.0, curve=lambda levels, value: levels ** (2.0**-value))
    temperature: float = tone(1.0)
    tint: float = tone(1.0)
    point_size: int = 1
    edl: float = 0.0

    def __post_init__(self) -> None:
        for name, table in (("colour_by", COLOUR_BY), ("ramp", RAMPS)):
            if getattr(self, name) not in table:
                raise InputError(f"expected one of {', '.join(table)}", option=name, value=getattr(self, name))
        for name, row in TONES.items():
            if not abs(getattr(self, name)) <= row.most:
                raise InputError(f"expected a number from {-row.most:g} to {row.most:g}", option=name,
                                 value=getattr(self, name))
        for name in ("low", "high"):
            value = getattr(self, name)
            if value is not None and not np.isfinite(value):
                raise InputError("expected a finite number", option=name, value=value)
        if not (1 <= self.point_size <= MOST_POINT_SIZE and self.point_size == int(self.point_size)):
            raise InputError(f"expected whole pixels from 1 to {MOST_POINT_SIZE}", option="point size", value=self.point_size)
        if not 0 <= self.edl <= 1:
            raise InputError("expected a strength from 0 to 1", option="eye-dome lighting", value=self.edl)

    @property
    def recolours(self) -> bool:
        """Whether points are coloured by an attribute."""
        return COLOUR_BY[self.colour_by].value is not PointValue.COLOUR

    @property
    def develops(self) -> bool:
        """Whether the finished picture's tones change."""
        return any(getattr(self, name) for name in TONES)

    @property
    def shapes_points(self) -> bool:
        """Whether points look other than one pixel each, flat."""
        return self.point_size > 1 or self.edl > 0


TONES: dict[str, Tone] = {row.name: row.metadata["tone"] for row in fields(Look) if "tone" in row.metadata}
"""The fields of Look that change tones, in the order of their sliders."""


def tone_curves(look: Look) -> np.ndarray:
    """(256, 3) uint8: what each sRGB level of red, green and blue becomes.

    Exposure and white balance multiply linear light; the gains keep the luminance of grey (BT.709).  Brightness is a
    gamma on the sRGB levels.
    """
    gains = 2.0 ** (0.5 * np.array([look.temperature + 0.5 * look.tint, -look.tint, -look.temperature + 0.5 * look.tint]))
    gains *= 2.0**look.exposure / (gains @ LUMINANCE)
    light = to_linear(np.arange(LEVELS)[:, None] / (LEVELS - 1)) * gains
    levels = to_srgb(light)
    for name, row in TONES.items():
        if row.curve is not None:
            levels = row.curve(levels, getattr(look, name))
    return np.rint(np.clip(levels, 0.0, 1.0) * (LEVELS - 1)).astype(np.uint8)


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
