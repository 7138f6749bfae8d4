"""The ranges of an E57's colours and intensities: as the file states them, where its values agree."""

from collections.abc import Iterable

import numpy as np

from .e57_nodes import child, value_of

_OUTSIDE = 0.005  # share of intensities outside the stated limits from which on these are wrong; none is outside in pumpA.e57
_UNUSED = 256.0  # stated range, in ranges of the values, from which on it is wrong: 8 bits of grey would show one level


def range_of(blocks: Iterable[np.ndarray]) -> tuple[float, float]:
    """Lowest and highest finite value."""
    low, high = np.inf, -np.inf
    for values in blocks:
        finite = values[np.isfinite(values)]
        if len(finite):
            low, high = min(low, float(finite.min())), max(high, float(finite.max()))
    return low, high


def _declared(node) -> tuple[float, float]:
    """The scaled range that a prototype node declares."""
    if hasattr(node, "scaledMinimum"):
        return float(node.scaledMinimum()), float(node.scaledMaximum())
    return float(node.minimum()), float(node.maximum())


def _limits(scan, group: str, names: tuple[str, str]) -> tuple[float, float] | None:
    limits = child(scan, group, "Structure")
    if limits is None or not all(limits.isDefined(name) for name in names):
        return None
    low, high = (value_of(limits[name]) for name in names)
    return (low, high) if low is not None and high is not None and low < high < np.inf else None


def colour_range(scan, nodes) -> tuple[float, float, bool]:
    """(zero, full, narrow): the values of a black and of a full channel, and whether 8 bits hold the range.

    Writers store either the sensor's range or the range of the values as limits.  Integers are therefore taken to begin at 0
    and to end at the next 2**bits - 1.
    """
    low, high = _limits(scan, "colorLimits", ("colorRedMinimum", "colorRedMaximum")) or _declared(nodes["colorRed"])
    if hasattr(nodes["colorRed"], "precision") or hasattr(nodes["colorRed"], "scale"):
        sane = low < high and high - low < 1e9
        if not sane:
            return 0.0, 1.0, True
        return (0.0, high, high == 255) if high in (255, 65535) else (low, high, True)
    if not 0 < high <= 65535:
        return 0.0, 65535.0, False
    return 0.0, max(255.0, 2.0 ** np.ceil(np.log2(high + 1)) - 1), high <= 255


def intensity_range(scan, nodes) -> tuple[float, float] | None:
    limits = _limits(scan, "intensityLimits", ("intensityMinimum", "intensityMaximum"))
    low, high = limits or _declared(nodes["intensity"])
    return (low, high) if low < high and high - low < 1e9 else None


def trusted(limits: tuple[float, float] | None, values: np.ndarray) -> tuple[float, float] | None:
    """The stated limits of intensities, or None where there are none or values contradict them: many lie outside, or all in a
    small part of them.  Writers that normalise in their head state 0 to 1 beside whole numbers up to 2047."""
    values = values[np.isfinite(values)]
    if limits is None or not len(values):
        return limits
    low, high = limits
    outside = float(((values < low) | (values > high)).mean())
    used = float(values.max()) - float(values.min())  # of floats, which may be inf without a warning
    return None if outside > _OUTSIDE or 0 < used < (high - low) / _UNUSED else limits


def zeros(columns: list[np.ndarray]) -> np.ndarray:
    """(n,) bool: where all of the columns are exactly 0."""
    nothing = columns[0] == 0
    for values in columns[1:]:
        nothing &= values == 0
    return nothing
