"""Scale and offset in which the coordinates of several LAS files, or of moved ones, are whole numbers of 32 bits.

Files that stay keep each coordinate exactly; coordinates of moved files are rounded to the scale.  Frame: file coordinates, of
moved files those of the project.
"""

import struct
from collections.abc import Sequence

import numpy as np

from ....common.errors import InputError
from ....common.rigid_transform import Rows, moved_points
from .las_layout import LasLayout

_REACH = 2**31 - 8
_WHOLE = 1e-6
"""Largest distance from a whole number at which a ratio of scales or a step between offsets counts as one."""


def common_scale(layouts: Sequence[LasLayout], moves: Sequence[Rows | None]) -> tuple[np.ndarray, np.ndarray] | None:
    """(scales, offsets), (3,) each, in which the coordinates of all files are whole numbers of 32 bits; None where there are
    none.  moves: of each file, None where it stays.  The first file's offset is kept where the coordinates fit around it."""
    scales = np.min([lay.scales for lay in layouts], axis=0)
    if any(moves):
        scales = np.full(3, scales.min())  # a turn mixes the axes
    offsets = next((lay.offsets for lay, moved in zip(layouts, moves) if moved is None), layouts[0].offsets)
    if not (scales > 0).all():
        return None
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for lay, transform in zip(layouts, moves):
        ratio, step = lay.scales / scales, (lay.offsets - offsets) / scales
        whole = np.abs(ratio - np.rint(ratio)).max() <= _WHOLE and np.abs(step - np.rint(step)).max() <= 1e-3
        if transform is None and not (whole and np.abs(step).max() <= 2**40):
            return None
        bounds = np.array(struct.unpack_from("<6d", lay.header, 179)).reshape(3, 2)
        if transform is not None:
            bounds = _moved_box(bounds, transform)
        low, high = np.minimum(low, bounds[:, 1]), np.maximum(high, bounds[:, 0])
    if not (np.isfinite(low).all() and np.isfinite(high).all()):
        return None
    if max(np.abs(low - offsets).max(), np.abs(high - offsets).max()) / scales.min() > _REACH:
        offsets = offsets + np.rint(((low + high) / 2 - offsets) / scales) * scales
        if (np.maximum(high - offsets, offsets - low) / scales).max() > _REACH:
            return None
    return scales, offsets


def _moved_box(bounds: np.ndarray, transform: Rows) -> np.ndarray:
    """(3, 2) highest and lowest coordinates of the corners of a box, (3, 2) likewise, after a motion."""
    x, y, z = bounds
    corners = moved_points(transform, np.array([[a, b, c] for a in x for b in y for c in z]))
    return np.column_stack([corners.max(axis=0), corners.min(axis=0)])


def whole_coordinates(records: np.ndarray, layout: LasLayout, scales: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    """Coordinates as whole numbers of the common scale, exactly; ``records`` is changed and returned."""
    factors = np.rint(layout.scales / scales).astype(np.int64)
    steps = np.rint((layout.offsets - offsets) / scales).astype(np.int64)
    for axis, name in enumerate("XYZ"):
        _set(records, name, records[name].astype(np.int64) * factors[axis] + steps[axis], layout)
    return records


def rounded_coordinates(records: np.ndarray, xyz: np.ndarray, layout: LasLayout, scales: np.ndarray,
                        offsets: np.ndarray) -> np.ndarray:
    """The records at other places, (n, 3), rounded to the scale; ``records`` is changed and returned."""
    for axis, name in enumerate("XYZ"):
        _set(records, name, np.rint((xyz[:, axis] - offsets[axis]) / scales[axis]), layout)
    return records


def _set(records: np.ndarray, name: str, values: np.ndarray, layout: LasLayout) -> None:
    if len(values) and max(-float(values.min()), float(values.max())) > 2**31 - 1:
        raise InputError("has points outside the bounds in its header", file=layout.path, remedy="export it alone")
    records[name] = values
