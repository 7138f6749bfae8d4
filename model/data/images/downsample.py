"""Downsampling of true pictures by an integer factor, as a camera with larger pixels would see them.

A pixel averages linear light, not sRGB values (model/common/linear_light.py), over its covered share only: background has no
colour.
"""

import numpy as np

from ...common.linear_light import TO_LINEAR, TO_SRGB


def in_blocks(picture: np.ndarray, side: int) -> np.ndarray:
    """(H, W, ...) -> (H / side, side, W / side, side, ...); incomplete blocks at the right and bottom are cut off."""
    h, w = picture.shape[0] // side, picture.shape[1] // side
    return picture[: h * side, : w * side].reshape(h, side, w, side, *picture.shape[2:])


def reduced_colour(rgb: np.ndarray, coverage: np.ndarray | None, side: int) -> np.ndarray:
    """(H / side, W / side, 3) uint8 sRGB: the mean in linear light, weighted by coverage, unweighted where that is 0.

    rgb: (H, W, 3) uint8 sRGB.  coverage: (H, W) float covered share of each pixel; None: 1 everywhere.
    """
    light = in_blocks(TO_LINEAR[rgb], side)
    if coverage is None:
        return TO_SRGB[np.rint(light.mean((1, 3))).astype(np.int64)]
    weight = in_blocks(coverage.astype(np.float64), side)
    weight = np.where(weight.any((1, 3), keepdims=True), weight, 1.0)[..., None]
    return TO_SRGB[np.rint((light * weight).sum((1, 3)) / weight.sum((1, 3))).astype(np.int64)]


def reduced_share(share: np.ndarray, side: int) -> np.ndarray:
    """(H / side, W / side) uint8 means of shares (H, W), bool or 0..1; 255 stands for 1."""
    return np.rint(255 * in_blocks(share.astype(np.float32), side).mean((1, 3))).astype(np.uint8)
