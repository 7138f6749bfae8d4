"""LAS records as a chunk, in one compiled loop over their bytes.

Frame: file coordinates.  The reference implementation is ``_chunk`` in las_source.
"""

import numpy as np

from ....model.common.jit import compiled
from ..source import Chunk

_CLASS_BITS = 0x1F
"""Bits of a class in point formats 0 to 5; the other bits of its byte are flags."""


def chunk_of_records(records: np.ndarray, scales: np.ndarray, offsets: np.ndarray) -> tuple[Chunk, np.ndarray]:
    """The chunk of records (n,), a contiguous structured array of a point format's layout, and the bounds (2, 3) of its
    coordinates; values that are not numbers are left out of the bounds."""
    fields = records.dtype.fields or {}
    place = {name: offset for name, (_, offset, *_) in fields.items()}
    masked = "classification" not in place
    colour, count = {"red", "green", "blue"} <= place.keys(), len(records)
    at = np.array([place["X"], place["Y"], place["Z"], place["intensity"],
                   place["raw_classification" if masked else "classification"], place["point_source_id"],
                   *(place[name] if colour else -1 for name in ("red", "green", "blue"))], np.int64)  # fmt: skip
    xyz, rgb = np.empty((count, 3)), np.empty((count if colour else 0, 3), np.uint16)
    intensity, classes = np.empty(count, np.uint16), np.empty(count, np.uint8)
    station = np.empty(count if colour else 0, np.uint16)
    bounds = np.array([[np.inf] * 3, [-np.inf] * 3])
    data = records.view(np.uint8).reshape(count, records.dtype.itemsize)
    scales, offsets = np.asarray(scales, np.float64), np.asarray(offsets, np.float64)
    _convert(data, at, scales, offsets, _CLASS_BITS if masked else 0xFF, xyz, rgb, intensity, classes, station, bounds)
    return Chunk(xyz, rgb if colour else None, intensity, station=station if colour else None, classification=classes), bounds


@compiled(inline="always")
def _two(data, i, at):
    return np.uint16(np.uint32(data[i, at]) | np.uint32(data[i, at + 1]) << np.uint32(8))


@compiled(nogil=True)
def _convert(data, at, scales, offsets, mask, xyz, rgb, intensity, classes, station, bounds):
    """data: (n, bytes of a record) uint8.  at: (9,) byte of X, Y, Z, intensity, class, source, red, green and blue; the last
    three -1 without colour.  Fills the arrays, and ``bounds`` (2, 3)."""
    count, coloured = data.shape[0], at[6] >= 0
    for i in range(count):
        for axis in range(3):
            k = at[axis]
            raw = np.uint32(data[i, k]) | np.uint32(data[i, k + 1]) << np.uint32(8)
            raw |= np.uint32(data[i, k + 2]) << np.uint32(16) | np.uint32(data[i, k + 3]) << np.uint32(24)
            value = np.float64(np.int32(raw)) * scales[axis] + offsets[axis]
            xyz[i, axis] = value
            if value < bounds[0, axis]:
                bounds[0, axis] = value
            if value > bounds[1, axis]:
                bounds[1, axis] = value
        intensity[i] = _two(data, i, at[3])
        classes[i] = data[i, at[4]] & mask
        if coloured:
            station[i] = _two(data, i, at[5])
            for channel in range(3):
                rgb[i, channel] = _two(data, i, at[6 + channel])
