"""A neural picture moved to another camera: reference implementation of ``reproject.comp``, and its constants.

Reverse reprojection (Nehab et al. 2007, "Accelerating Real-Time Shading with Reverse Reprojection Caching"): each pixel of the
present picture looks up where the earlier camera saw its surface.  What it finds is used where the depths agree, and is bounded
by the colours of the present picture around the pixel, as temporal antialiasing does (Karis 2014, "High-Quality Temporal
Supersampling"): a colour that moved wrongly can hardly leave them.  View frame: x right, y down, z forward, file units.
"""

import numpy as np

SAME_DEPTH = 0.05
"""Depths that differ by this share are of different surfaces; from half of it on the earlier colour counts less.  Measured
on studio, plant room and demo at 1280x720, the camera moved by 0.01 to 0.6 m: 0.02 is 0.0 to 0.3 dB worse, no limit -0.4 to
+0.3."""
SHARE = 0.5
"""Of the earlier colour in the mixture.  The filled picture's own error and that of moved colours are independent, so that half
of each is nearer to the network's picture than either: all of it is 0.2 to 2.0 dB worse than half (the same measurement), three
quarters -0.5 to +0.9 dB."""
SMOOTHING = 0.8
"""Of the step towards the mean of 3 x 3 pixels that brings the earlier filled picture nearest to the network's: 0.51 to 0.70 in
studio and plant room.  Chosen on an arc in studio at 1280x720, the earlier picture 8 to 15 frames old; there and on three other
paths of studio, plant room and demo it is 0.1 dB worse to 0.6 dB better than the whole step.  Means within a surface only are
worse by 0.1 to 0.5 dB."""
WIDER = 0.3
"""Of the range of the filled picture's 3 x 3 pixels, by which a moved colour may leave it to either side.  Single frames of
five paths, the earlier picture 8 to 15 frames old: over no share, 0.07 dB (studio, the arc), 0.22 and -0.02 (two others), 0.01
(plant room) and 0.13 (demo) nearer to the network's picture; 0.6 gives half as much again, and loses 0.03 on the third."""
MOST_NEARER, FADES_OVER = 2.5, 1.0
"""How many times as near as the earlier camera the present one may be: then a moved pixel covers as many; it counts less from
FADES_OVER before that on."""
COUNTED = 8
"""Of the rows and columns, one in so many is counted for the share of moved pixels."""


def reprojected(filled: np.ndarray, depth: np.ndarray, earlier: np.ndarray, earlier_depth: np.ndarray, turn: np.ndarray,
                shift: np.ndarray, lens: np.ndarray, earlier_lens: np.ndarray, smoothing: float = 0.0
                ) -> tuple[np.ndarray, np.ndarray]:
    """The present picture with moved colours, (H, W, 4) float64 of 0..255, and which pixels have them, (H, W) bool.

    filled: (H, W, 4) uint8, premultiplied, of the present camera.  depth: (H, W) float32, view-space z, 0 where it is not
    opaque.  earlier, earlier_depth: the same of the earlier camera, neural, of any size.  turn: (3, 3) and shift: (3,), present
    view frame -> earlier view frame.  lens, earlier_lens: fx, fy, cx, cy in pixels.  smoothing: how far each pixel of the
    filled picture moves to the mean of its 3 x 3.
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
    around = _around(base)
    low, high = around[..., :3].min(axis=0), around[..., :3].max(axis=0)
    low, high = low - WIDER * (high - low), high + WIDER * (high - low)
    base[..., :3] += smoothing * (smoothed(base) - base[..., :3])
    moved = np.clip(sampled(earlier, u, v)[..., :3], low, high)
    share = (SHARE * trust)[..., None]
    return np.concatenate([base[..., :3] * (1 - share) + moved * share, base[..., 3:]], axis=-1), trust > 0


def _around(picture: np.ndarray) -> np.ndarray:
    """(9, H, W, C): the 3 x 3 pixels around each, the border repeated."""
    height, width = picture.shape[:2]
    padded = np.pad(picture, ((1, 1), (1, 1), (0, 0)), mode="edge")
    return np.stack([padded[down : down + height, right : right + width] for down in range(3) for right in range(3)])


def smoothed(picture: np.ndarray) -> np.ndarray:
    """(H, W, 3): the mean colour of the 3 x 3 pixels around each, of a premultiplied picture (H, W, 4), times its alpha."""
    total = _around(picture).sum(axis=0)
    share = picture[..., 3:] / np.maximum(total[..., 3:], 1e-9)
    return np.where(total[..., 3:] > 0, total[..., :3] * share, picture[..., :3])


def smoothing_of(filled: np.ndarray, neural: np.ndarray) -> float:
    """0..1: the step from the filled picture to the means of 3 x 3 that is nearest to what the network made of it, times
    SMOOTHING.  Both (..., H, W, 4) uint8: parts of the pictures."""
    step = np.zeros(2)
    for before, after in zip(filled.reshape(-1, *filled.shape[-3:]).astype(np.float64), neural.reshape(-1, *neural.shape[-3:])):
        towards = (smoothed(before) - before[..., :3])[1:-1, 1:-1]
        step += (towards * (after[..., :3] - before[..., :3])[1:-1, 1:-1]).sum(), (towards**2).sum()
    return SMOOTHING * float(np.clip(step[0] / max(step[1], 1e-9), 0, 1))


def sampled(picture: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(..., C) float64: a picture (h, w, C) between its pixels' centres, bilinear, its border repeated."""
    height, width = picture.shape[:2]
    left, top = np.floor(x - 0.5), np.floor(y - 0.5)
    s, t = (x - 0.5 - left)[..., None], (y - 0.5 - top)[..., None]
    columns = [np.clip(left + step, 0, width - 1).astype(int) for step in (0, 1)]
    rows = [np.clip(top + step, 0, height - 1).astype(int) for step in (0, 1)]
    upper, lower = ((1 - s) * picture[row, columns[0]] + s * picture[row, columns[1]] for row in rows)
    return (1 - t) * upper + t * lower
