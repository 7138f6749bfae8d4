"""Depth without holes, for photographs that are laid onto it."""

import numpy as np


def filled_depth(depth: np.ndarray) -> np.ndarray:
    """(H, W) float32 with every hole (+inf) filled from the measured depths around it: a pyramid of means, as a place for the
    colour of a photograph.  All +inf where nothing was measured."""
    known = np.isfinite(depth)
    if known.all() or not known.any():
        return depth
    height, width = depth.shape
    padded = np.pad(np.where(known, depth, 0.0), ((0, height % 2), (0, width % 2)))
    count = np.pad(known, ((0, height % 2), (0, width % 2))).astype(np.float32)
    total, count = (sum(a[y::2, x::2] for y in (0, 1) for x in (0, 1)) for a in (padded, count))
    with np.errstate(divide="ignore", invalid="ignore"):
        coarse = filled_depth(np.where(count > 0, total / count, np.inf).astype(np.float32))
    return np.where(known, depth, coarse.repeat(2, 0).repeat(2, 1)[:height, :width])
