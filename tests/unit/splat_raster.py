"""A plain rasteriser of Gaussian splats, to judge exports by: what the usual viewers draw (Kerbl et al. 2023, section 4 and 6).

Each Gaussian is projected by the Jacobian of the perspective at its centre, widened by LOW_PASS, and blended front to back by
the depth of the centres.  Frame: view frame, x right, y down, z forward.  Colours: sRGB 0..1, blended as they are, as viewers
do.
"""

import math

import numpy as np

from pointglass.model.common.jit import compiled

LOW_PASS = 0.3
"""Variance, pixels squared, that is added to every projected Gaussian (the published renderer's)."""
CUT = 3.0
"""Standard deviations beyond which a Gaussian is not drawn."""
NEAREST = 0.2
"""Depth below which a Gaussian is not drawn, units of the scene (the published renderer's)."""
_MOST_ALPHA = 0.99
_LEAST_ALPHA = 1 / 255
_SIDE = 1.3
"""Share of the half picture beyond its border at which the Jacobian is taken at most."""


def draw_splats(xyz: np.ndarray, rotation: np.ndarray, scale: np.ndarray, rgb: np.ndarray, opacity: np.ndarray, *,
                world_to_view: np.ndarray, fx: float, fy: float, cx: float, cy: float, size: tuple[int, int],
                low_pass: float = LOW_PASS) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Picture (H, W, 3) float32 on black, and coverage (H, W) float32, 0..1.

    xyz: (n, 3).  rotation: (n, 3, 3), columns are axes.  scale: (n, 3) standard deviations.  rgb: (n, 3).  opacity: (n,).
    world_to_view: (4, 4).  fx, fy, cx, cy: pixels.  size: width, height.
    """
    turn, shift = world_to_view[:3, :3], world_to_view[:3, 3]
    view = xyz @ turn.T + shift
    order = np.argsort(view[:, 2])
    order = order[view[order, 2] > NEAREST]
    stretched = np.einsum("ij,njk->nik", turn, rotation[order]) * scale[order][:, None, :]
    picture, clear = np.zeros((size[1], size[0], 3), np.float32), np.ones((size[1], size[0]), np.float32)
    blend(np.ascontiguousarray(view[order]), np.ascontiguousarray(stretched), np.ascontiguousarray(rgb[order], np.float32),
          np.ascontiguousarray(opacity[order], np.float32), fx, fy, cx, cy, low_pass, picture, clear)
    return picture, 1 - clear


@compiled(nogil=True)
def blend(view, stretched, rgb, opacity, fx, fy, cx, cy, low_pass, picture, clear):
    """Adds splats, nearest first, to a picture (H, W, 3) and its transmittance (H, W).

    view: (n, 3) centres.  stretched: (n, 3, 3), axes times standard deviations, as columns.
    """
    height, width = clear.shape
    for i in range(view.shape[0]):
        x, y, z = view[i, 0], view[i, 1], view[i, 2]
        u, v = fx * x / z + cx, fy * y / z + cy
        edge_x, edge_y = _SIDE * 0.5 * width / fx * z, _SIDE * 0.5 * height / fy * z
        tx, ty = min(max(x, -edge_x), edge_x), min(max(y, -edge_y), edge_y)
        xx = xy = yy = 0.0
        for k in range(3):
            a = fx / z * (stretched[i, 0, k] - tx / z * stretched[i, 2, k])
            b = fy / z * (stretched[i, 1, k] - ty / z * stretched[i, 2, k])
            xx, xy, yy = xx + a * a, xy + a * b, yy + b * b
        xx, yy = xx + low_pass, yy + low_pass
        det = xx * yy - xy * xy
        if det <= 0:
            continue
        reach_x, reach_y = CUT * math.sqrt(xx), CUT * math.sqrt(yy)
        for row in range(max(math.ceil(v - reach_y - 0.5), 0), min(math.floor(v + reach_y - 0.5) + 1, height)):
            dy = row + 0.5 - v
            for column in range(max(math.ceil(u - reach_x - 0.5), 0), min(math.floor(u + reach_x - 0.5) + 1, width)):
                left = clear[row, column]
                if left < 1e-4:
                    continue
                dx = column + 0.5 - u
                power = (yy * dx * dx - 2 * xy * dx * dy + xx * dy * dy) / det
                if power > CUT * CUT:
                    continue
                alpha = min(opacity[i] * math.exp(-0.5 * power), _MOST_ALPHA)
                if alpha < _LEAST_ALPHA:
                    continue
                for channel in range(3):
                    picture[row, column, channel] += left * alpha * rgb[i, channel]
                clear[row, column] = left * (1 - alpha)
