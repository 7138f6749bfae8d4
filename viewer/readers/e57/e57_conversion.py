"""Fields of an E57 as coordinates, colours and intensities, in one compiled loop.

The reference implementation, in NumPy, is in tests/unit/readers/test_e57_conversion.py.
"""

import numpy as np

from ....model.common.jit import compiled

_NONE, _ALL = np.empty(0), np.empty(0, np.bool_)


def converted(
    xyz: tuple[np.ndarray, ...], colours: tuple[np.ndarray, ...], intensity: np.ndarray | None, uncoloured: np.ndarray | None,
    unmeasured: np.ndarray | None, valid: np.ndarray | None, *, shift: np.ndarray, colour_range: tuple[float, float],
    intensity_range: tuple[float, float], narrow: bool,
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:  # fmt: skip
    """Coordinates (k, 3) float64, moved by ``shift`` (3,); colours (k, 3), uint8 where ``narrow``, else uint16, or None;
    intensities (k,) uint16, or None.

    xyz, colours: columns (n,) float64; no colours: ().  uncoloured, unmeasured: (n,) not 0 where a colour or an intensity is
    missing.  valid: (n,) bool, which records are points; None: all.  colour_range, intensity_range: what becomes 0 and the
    highest value.
    """
    count = len(xyz[0]) if valid is None else int(np.count_nonzero(valid))
    placed = np.empty((count, 3))
    narrow_rgb = np.empty((count if colours and narrow else 0, 3), np.uint8)
    wide_rgb = np.empty((count if colours and not narrow else 0, 3), np.uint16)
    levels = np.empty(0 if intensity is None else count, np.uint16)
    x, y, z = map(_doubles, xyz)
    red, green, blue = map(_doubles, colours or (None, None, None))
    low, factor = _scale(*colour_range)
    least, rise = _scale(*intensity_range)
    _convert(x, y, z, red, green, blue, _doubles(intensity), _doubles(uncoloured), _doubles(unmeasured),
             _ALL if valid is None else valid, _doubles(shift), low, factor, least, rise, placed, narrow_rgb, wide_rgb,
             levels)  # fmt: skip
    return placed, (narrow_rgb if narrow else wide_rgb) if colours else None, None if intensity is None else levels


def _doubles(column: np.ndarray | None) -> np.ndarray:
    """The column as the loop takes it; None: an empty one."""
    return _NONE if column is None else np.ascontiguousarray(column, np.float64)


def _scale(low: float, high: float) -> tuple[float, float]:
    """Offset and factor of ``viewer.readers.source.stretch``."""
    return float(low), 65535.0 / (high - low) if high > low else 0.0


@compiled(inline="always")
def _stretched(value, low, factor):
    """``viewer.readers.source.stretch`` of a value."""
    scaled = (value - low) * factor
    scaled = 0.0 if np.isnan(scaled) else scaled
    return np.uint16(min(max(scaled + 0.5, 0.0), 65535.0))


@compiled(nogil=True)
def _convert(x, y, z, red, green, blue, intensity, uncoloured, unmeasured, valid, shift, low, factor, least, rise, xyz, narrow,
             wide, levels):  # fmt: skip
    """See ``converted``; arrays of no values are empty."""
    k = 0
    for i in range(x.shape[0]):
        if valid.size > 0 and not valid[i]:
            continue
        xyz[k, 0], xyz[k, 1], xyz[k, 2] = x[i] + shift[0], y[i] + shift[1], z[i] + shift[2]
        if red.size > 0:
            lit = uncoloured.size == 0 or uncoloured[i] == 0
            r, g, b = _stretched(red[i], low, factor), _stretched(green[i], low, factor), _stretched(blue[i], low, factor)
            if narrow.size > 0:
                narrow[k, 0] = np.uint8((r + 128.0) / 257.0) if lit else 0
                narrow[k, 1] = np.uint8((g + 128.0) / 257.0) if lit else 0
                narrow[k, 2] = np.uint8((b + 128.0) / 257.0) if lit else 0
            else:
                wide[k, 0], wide[k, 1], wide[k, 2] = (r, g, b) if lit else (np.uint16(0), np.uint16(0), np.uint16(0))
        if intensity.size > 0:
            measured = unmeasured.size == 0 or unmeasured[i] == 0
            levels[k] = _stretched(intensity[i], least, rise) if measured else 0
        k += 1
