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
                shift: np.ndarray, lens: np.ndarray, earlier_lens: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The present picture with moved colours, (H, W, 4) float64 of 0..255, and which pixels have them, (H, W) bool.

    filled: (H, W, 4) uint8, premultiplied, of the present camera.  depth: (H, W) float32, view-space z, 0 where it is not
    opaque.  earlier, earlier_depth: the same of the earlier camera, neural, of any size.  turn: (3, 3) and shift: (3,), present
    view frame -> earlier view frame.  lens, earlier_lens: fx, fy, cx, cy in pixels.
    """
    height, width = filled.shape[:2]
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    base, z = filled.astype(np.float64), depth.astype(np.float64)
    there = np.stack([(x - lens[2]) / lens[0] * z, (y - lens[3]) / lens[1] * z, z], axis=-1) @ turn.T + shift
    with np.errstate(divide="ignore", invalid="ignore"):
        u = earlier_lens[0] * there[..., 0] / there[..., 2] + earlier_lens[2]
        v = earlier_lens[1] * there[..., 1] / there[..., 2] + earlier_lens[3]
        inside = (z > 0) & (there[..., 2] > 0)
        inside &= (u >= 0) & (v >= 0) & (u < earlier.shape[1]) & (v < earlier.shape[0])
        u, v = np.where(inside, u, 0.0), np.where(inside, v, 0.0)
        known = earlier_depth[v.astype(int), u.astype(int)].astype(np.float64)
        apart = np.abs(known - there[..., 2]) / np.minimum(known, there[..., 2])
        trust = np.clip(2 - 2 * apart / SAME_DEPTH, 0, 1) * np.clip((MOST_NEARER - there[..., 2] / z) / FADES_OVER, 0, 1)
    trust = np.where(inside, trust, 0.0)
    padded = np.pad(base[..., :3], ((1, 1), (1, 1), (0, 0)), mode="edge")
    around = np.stack([padded[down : down + height, right : right + width] for down in range(3) for right in range(3)])
    low, high = around.min(axis=0), around.max(axis=0)
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
