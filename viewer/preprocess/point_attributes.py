"""Classification and intensity of points: collected in pass 1, packed beside the position in pass 2.

A packed point has 16 bits for both (viewer.grid.scene).  A scan without classification keeps its intensities as they are.
In a scan with classification the upper 8 bits hold the class and the lower 8 bits the intensity, quantised linearly between the
lowest and the highest value of the whole scan; up to 256 different consecutive values this is exact.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, Self

import numpy as np

from ..common.errors import InputError
from ..common.text import counted
from ..picture.json_values import Count, OwnJson, from_json
from ..readers.source import AS_STORED, Chunk

CODES = 256
"""Class codes: 8 bits, as in LAS 1.4."""
_QUANTISED_BITS, _EXACT_BITS = 8, 16
"""Bits of an intensity beside a class, and alone."""


@dataclass(frozen=True)
class AttributeLayout(OwnJson):
    """The layout of the 16 attribute bits of a packed point.

    classes: number of points by class code, in ascending order of the code, including points that the grid leaves out as
        invalid; empty where the scan has no classification.
    low, high: range of the stored intensities over the whole scan; None where the scan has none.
    ends: the file's values that stored intensities of 0 and 65535 stand for; None where files differ in them.
    """

    classes: dict[int, int]
    low: int | None = None
    high: int | None = None
    ends: tuple[float, float] | None = AS_STORED

    @property
    def has_classes(self) -> bool:
        """Whether class and intensity share the 16 bits."""
        return len(self.classes) > 0

    @property
    def step(self) -> float:
        """Difference in the file's intensity values between two neighbouring stored values; 1 where storage is exact."""
        if not self.has_classes or self.low is None or self.high is None:
            return 1.0
        return max((self.high - self.low) / (CODES - 1), 1.0)

    def pack(self, classification: np.ndarray | None, intensity: np.ndarray | None, count: int) -> np.ndarray:
        """(count,) uint16 attribute bits.  classification: (count,) uint8 or None, taken as class 0 ("never classified").
        intensity: (count,) uint16 or None, stored as the lowest value of the scan."""
        if not self.has_classes:
            return np.zeros(count, np.uint16) if intensity is None else intensity
        bits = np.zeros(count, np.uint16)
        if intensity is not None and self.low is not None:
            bits = np.rint((intensity.astype(np.float32) - self.low) * np.float32(1 / self.step))
            bits = np.clip(bits, 0, CODES - 1).astype(np.uint16)
        return bits if classification is None else bits | classification.astype(np.uint16) << 8

    def class_of(self, bits: np.ndarray) -> np.ndarray:
        """(n,) uint8 class codes of attribute bits (n,); 0 where the scan has no classification."""
        return (bits >> 8).astype(np.uint8) if self.has_classes else np.zeros(len(bits), np.uint8)

    def intensity_of(self, bits: np.ndarray) -> np.ndarray:
        """(n,) uint16 intensities in the file's values, at most half a ``step`` off; 0 where the scan has none."""
        if not self.has_classes:
            return bits.astype(np.uint16)
        return np.rint((bits & 0xFF) * self.step + (self.low or 0)).astype(np.uint16)

    def in_file(self, stored: float) -> float:
        """The file's value of a stored intensity, exact where the file has whole numbers of 16 bits; as stored where files
        differ in their scale."""
        if self.ends is None or self.ends == AS_STORED:
            return stored
        zero, full = self.ends
        return zero + (full - zero) * stored / AS_STORED[1]

    def as_stored(self, value: float) -> float:
        """The stored intensity of a file's value: the inverse of ``in_file``."""
        if self.ends is None or self.ends == AS_STORED or self.ends[0] == self.ends[1]:
            return value
        zero, full = self.ends
        return (value - zero) / (full - zero) * AS_STORED[1]

    def to_json(self) -> dict:
        """{"class": {code: points}, "intensity": {"low", "high", "bits"}}, each only where it exists; where ``ends`` are not
        AS_STORED, "zero" and "full" are added to the intensity, None where files differ in them."""
        found: dict = {}
        if self.has_classes:
            found["class"] = {str(code): count for code, count in self.classes.items()}
        if self.low is not None:
            bits = _QUANTISED_BITS if self.has_classes else _EXACT_BITS
            found["intensity"] = {"low": self.low, "high": self.high, "bits": bits}
            if self.ends != AS_STORED:
                zero, full = self.ends or (None, None)
                found["intensity"] |= {"zero": zero, "full": full}
        return found

    @classmethod
    def from_json(cls, data: Any, where: str) -> Self:
        """The layout that :meth:`to_json` describes.  Raises InputError naming ``where``."""
        stored = from_json(_StoredLayout, {key if key != "class" else "classes": item for key, item in data.items()}
                           if isinstance(data, dict) else data, where, strict=False)  # "class" cannot name a field
        if not all(code < CODES for code in stored.classes):
            raise InputError(f"{where}.class: expected codes from 0 to {CODES - 1}")
        range_of = stored.intensity
        if range_of is None:
            return cls(stored.classes)
        if not range_of.low <= range_of.high <= AS_STORED[1]:
            raise InputError(f"{where}.intensity: from {range_of.low} to {range_of.high}: expected a range within 0 to 65535")
        ends = AS_STORED
        if "zero" in data["intensity"]:
            ends = None if range_of.zero is None or range_of.full is None else (range_of.zero, range_of.full)
        return cls(stored.classes, range_of.low, range_of.high, ends)


NO_ATTRIBUTES = AttributeLayout({})
"""Of a scan without classification and intensity."""


@dataclass(frozen=True)
class _StoredIntensity:
    low: Count
    high: Count
    zero: float | None = None
    full: float | None = None


@dataclass(frozen=True)
class _StoredLayout:
    """``AttributeLayout`` as JSON has it."""

    classes: dict[int, Count] = field(default_factory=dict)
    intensity: _StoredIntensity | None = None


def common_ends(ends: Sequence[tuple[float, float]]) -> tuple[float, float] | None:
    """``AttributeLayout.ends`` of sources with these ``intensity_ends``."""
    known = set(ends)
    if not known - {AS_STORED}:
        return AS_STORED
    zero, full = known.pop() if len(known) == 1 else (np.nan, np.nan)
    return (zero, full) if np.isfinite((zero, full)).all() else None


class AttributeCounts:
    """Pass 1: counts classes and finds the range of intensity of every chunk (``add``); ``layout`` is the result."""

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forgets all chunks: the pass begins again."""
        self._classes, self._missing = np.zeros(CODES, np.int64), 0
        self._low, self._high = 65536, -1

    def add(self, source: int, first: int, chunk: Chunk) -> None:
        """Counts a chunk's points.  Points of chunks without classification count as class 0."""
        if len(chunk.xyz) == 0:
            return
        if chunk.classification is None:
            self._missing += len(chunk.xyz)
        else:
            self._classes += np.bincount(chunk.classification, minlength=CODES)
        if chunk.intensity is not None:
            self._low = min(self._low, int(chunk.intensity.min()))
            self._high = max(self._high, int(chunk.intensity.max()))

    def layout(self) -> AttributeLayout:
        """The layout for the scan.

        A scan whose classes are all 0 or all 1 (LAS: never classified, unclassified) has no classification.  A scan whose
        intensities are all 0 has no intensity.
        """
        counts = self._classes.copy()
        classified = counts[2:].any() or (counts[0] and counts[1])
        counts[0] += self._missing
        classes = {int(code): int(counts[code]) for code in np.flatnonzero(counts)} if classified else {}
        return AttributeLayout(classes, self._low, self._high) if self._high > 0 else AttributeLayout(classes)


def described(layout: AttributeLayout) -> list[tuple[str, str]]:
    """Rows (name, text) for ``pointglass info``: classes with their counts, range of intensity."""
    rows = []
    if layout.has_classes:
        rows.append(("class", ", ".join(f"{code}: {counted(count, 'point')}" for code, count in layout.classes.items())))
    if layout.low is not None:
        low, high = layout.in_file(layout.low), layout.in_file(layout.high or 0)
        step = abs(layout.in_file(layout.step) - layout.in_file(0.0))
        stored = "" if layout.step == 1 else f", drawn in steps of {step:.3g}"
        scale = " (each file by its own scale)" if layout.ends is None else ""
        rows.append(("intensity", f"{_number(low)} to {_number(high)}{scale}{stored}"))
    return rows


def _number(value: float) -> str:
    """A whole number with its thousands, else six digits."""
    return f"{value:,.0f}" if abs(value) < 1e15 and float(value).is_integer() else f"{value:.6g}"
