"""A neural picture moved to another camera: reference implementation of ``reproject.comp``, and its constants.

Reverse reprojection (Nehab et al. 2007, "Accelerating Real-Time Shading with Reverse Reprojection Caching"): each pixel of the
present picture looks up where the earlier camera saw its surface.  What it finds is used where the depths agree, and is bounded
by the colours of the present picture around the pixel, as temporal antialiasing does (Karis 2014, "High-Quality Temporal
Supersampling"): a colour that moved wrongly cannot leave them.  View frame: x right, y down, z forward, file units.
"""

import numpy as np

SAME_DEPTH = 0.05
"""Depths that differ by this share are of different surfaces; from half of it on the earlier colour counts less.  Measured
on studio, plant room and demo at 1280x720, the camera moved by 0.01 to 0.6 m: 0.02 is 0.0 to 0.3 dB worse, no limit -0.4 to
+0.3."""
SHARE = 0.6
"""Of the earlier colour in the mixture.  The filled picture's own error and that of moved colours are independent, so that half
of each is nearer to the network's picture than either: all of it is 0.2 to 2.0 dB worse than half (the same measurement), three
quarters -0.5 to +0.9 dB."""
MOST_NEARER, FADES_OVER = 2.5, 1.0
"""How many times as near as the earlier camera the present one may be: then a moved pixel covers as many; it counts less from
FADES_OVER before that on."""
COUNTED = 8
"""Of the rows and columns, one in so many is counted for the share of moved pixels."""


def reprojected(filled: np.ndarray, depth: np.ndarray, earlier: np.ndarray, earlier_depth: np.ndarray, turn: np.ndarray,
                shift: np.ndarray, lens: np.ndarray, earlier_lens: np.ndarray, size: tuple[int, int]
                ) -> tuple[np.ndarray, np.ndarray]:
    """The present picture with moved colours, (H, W, 4) float64 of 0..255, and which pixels have them, (H, W) bool.

    filled: (h, w, 4) uint8, premultiplied, of the present camera.  depth: (h, w) float32, view-space z, 0 where it is not
    opaque.  earlier, earlier_depth: the same of the earlier camera, neural.  turn: (3, 3) and shift: (3,), present view frame
    -> earlier view frame.  lens, earlier_lens: fx, fy, cx, cy, the former in pixels of the result.  size: (W, H) of the result.
    """
    width, height = size
    rows, columns = filled.shape[:2]
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    own_x, own_y = (x / width * columns).astype(int), (y / height * rows).astype(int)
    base = sampled(filled, x / width * columns, y / height * rows)
    z = depth[own_y, own_x].astype(np.float64)
    there = np.stack([(x - lens[2]) / lens[0] * z, (y - lens[3]) / lens[1] * z, z], axis=-1) @ turn.T + shift
    with np.errstate(divide="ignore", invalid="ignore"):
        u = earlier_lens[0] * there[..., 0] / there[..., 2] + earlier_lens[2]
        v = earlier_lens[1] * there[..., 1] / there[..., 2] + earlier_lens[3]
        inside = (z > 0) & (base[..., 3] > 254.5) & (there[..., 2] > 0)
        inside &= (u >= 0) & (v >= 0) & (u < earlier.shape[1]) & (v < earlier.shape[0])
        u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
        known = earlier_depth[v.astype(int), u.astype(int)].astype(np.float64)
        apart = np.abs(known - there[..., 2]) / np.minimum(known, there[..., 2])
        trust = np.clip(2 - 2 * apart / SAME_DEPTH, 0, 1) * np.clip((MOST_NEARER - there[..., 2] / z) / FADES_OVER, 0, 1)
    trust = np.where(inside, trust, 0.0)
    low, high = np.full((height, width, 3), 255.0), np.zeros((height, width, 3))
    by_four = [(np.floor(pixel / 2) * 2 + 0.5) for pixel in (x - 0.5, y - 0.5)]  # the first of each four pixels
    first_x, first_y = (by_four[0] / width * columns).astype(int), (by_four[1] / height * rows).astype(int)
    if (columns, rows) == size:
        first_x, first_y = own_x, own_y
    for down in (-1, 0, 1):
        for right in (-1, 0, 1):
            near = filled[np.clip(first_y + down, 0, rows - 1), np.clip(first_x + right, 0, columns - 1), :3].astype(np.float64)
            low, high = np.minimum(low, near), np.maximum(high, near)
    moved = np.clip(sampled(earlier, u, v)[..., :3], low, high)
    share = (SHARE * trust)[..., None]
    return np.concatenate([base[..., :3] * (1 - share) + moved * share, base[..., 3:]], axis=-1), trust > 0


def sampled(picture: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(..., C) float64: a picture (h, w, C) between its pixels' centres, bilinear, its border repeated."""
    height, width = picture.shape[:2]
    left, top = np.floor(x - 0.5), np.floor(y - 0.5)
    s, t = (x - 0.5 - left)[..., None], (y - 0.5 - top)[..., None]
    columns = [np.clip(left + step, 0, width - 1).astype(int) for step in (0, 1)]
    rows = [np.clip(top + step, 0, height - 1).astype(int) for step in (0, 1)]
    upper, lower = ((1 - s) * picture[row, columns[0]] + s * picture[row, columns[1]] for row in rows)
    return (1 - t) * upper + t * lower
