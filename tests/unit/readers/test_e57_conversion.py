"""The compiled conversion of E57 fields equals that of NumPy, on random values with damage among them."""

import numpy as np
import pytest

from pointglass.viewer.readers.e57.e57_conversion import converted
from pointglass.viewer.readers.source import stretch


def reference(xyz, colours, intensity, uncoloured, unmeasured, valid, *, shift, colour_range, intensity_range, narrow):
    """The same in NumPy, step by step over whole columns."""
    valid = np.ones(len(xyz[0]), bool) if valid is None else valid
    rgb = levels = None
    with np.errstate(invalid="ignore", over="ignore"):
        placed = np.stack(xyz, axis=1)[valid] + shift
        if colours:
            rgb = stretch(np.stack(colours, axis=1), *colour_range)[valid]
            rgb = ((rgb + 128.0) / 257.0).astype(np.uint8) if narrow else rgb
            if uncoloured is not None:
                rgb[uncoloured[valid] != 0] = 0
        if intensity is not None:
            levels = stretch(intensity, *intensity_range)[valid]
            if unmeasured is not None:
                levels[unmeasured[valid] != 0] = 0
    return placed, rgb, levels


def column(rng, low, high, count=3000):
    """Values around a range, and some that are no numbers."""
    values = np.where(rng.random(count) < 0.5, rng.integers(low, high + 1, count), rng.uniform(2 * low - high, 2 * high, count))
    values[rng.integers(count, size=30)] = rng.choice([np.nan, np.inf, -np.inf, 1e300, -0.0], 30)
    return values


@pytest.mark.parametrize("narrow", [True, False])
@pytest.mark.parametrize("given", ["all", "places", "colours", "marks"])
def test_conversion_equals_that_of_numpy(seed, narrow, given):
    rng = np.random.default_rng(seed)
    high = 255 if narrow else 65535
    xyz = tuple(column(rng, -50, 50) for _ in range(3))
    colours = tuple(column(rng, 0, high) for _ in range(3)) if given != "places" else ()
    intensity = column(rng, 0, 2047) if given in ("all", "marks") else None
    marks = [rng.integers(0, 2, 3000).astype(float) if given == "marks" else None for _ in range(2)]
    valid = rng.random(3000) < 0.7 if given != "all" else None
    for intensity_range in ((0.0, 1.0), (0.0, 2047.0), (5.0, 5.0)):
        facts = {"shift": rng.normal(size=3) * 1e5, "colour_range": (0.0, float(high)), "intensity_range": intensity_range,
                 "narrow": narrow}  # fmt: skip
        expected = reference(xyz, colours, intensity, *marks, valid, **facts)
        for one, other in zip(expected, converted(xyz, colours, intensity, *marks, valid, **facts), strict=True):
            assert (one is None) == (other is None)
            if one is not None:
                np.testing.assert_array_equal(one, other, strict=True)
