"""Linear light as 12-bit integers, in which sums of a million points are exact and fit 32 bits; and the sRGB curve.

A camera's pixel averages light, not sRGB values: where several points fall into a pixel, the mean in linear light was 0.4 dB
closer to registered pictures.  Each sRGB level has its own 12-bit value, so that a single point keeps its colour.  The curve is
that of IEC 61966-2-1.
"""

import numpy as np

LEVELS = 4096
"""Levels of linear light; 12 bits are the fewest in which all 256 sRGB levels differ."""


LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
"""Relative luminance of linear red, green and blue (ITU-R BT.709, whose primaries sRGB has)."""


def to_linear(srgb) -> np.ndarray:
    """sRGB 0..1 to linear 0..1, any shape."""
    srgb = np.asarray(srgb, np.float64)
    return np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)


def to_srgb(linear) -> np.ndarray:
    """Linear 0..1 to sRGB 0..1, any shape."""
    linear = np.clip(linear, 0, 1)
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055)


TO_LINEAR = np.rint(to_linear(np.arange(256) / 255) * (LEVELS - 1)).astype(np.int64)
"""(256,) sRGB 0..255 -> linear light 0..4095."""

TO_SRGB = np.searchsorted((TO_LINEAR[1:] + TO_LINEAR[:-1]) / 2, np.arange(LEVELS), side="right").astype(np.uint8)
"""(4096,) linear light -> the sRGB level with the nearest linear light, the higher one in a tie."""
