"""The compiled loop that shows a photograph in a camera's view; see viewer.work.pictures.photo_in_view."""

import numpy as np

from ....model.common.jit import compiled


@compiled(nogil=True)
def resample(picture, valid, masked, kind, around, lens, rotation, shift, camera, depth, ranges, hides, farthest, out):
    """rotation: (3, 3) view frame to photograph; shift: (3,) the camera's place in the photograph's frame.  ranges: nearest
    distances by elevation and azimuth, used if ``hides``: what is more than ``farthest`` times as far is not shown."""
    height, width = picture.shape[0], picture.shape[1]
    for j in range(depth.shape[0]):
        for i in range(depth.shape[1]):
            u, v = (i + 0.5 - camera[2]) / camera[0], (j + 0.5 - camera[3]) / camera[1]
            z = float(depth[j, i])
            x = rotation[0, 0] * u + rotation[0, 1] * v + rotation[0, 2]
            y = rotation[1, 0] * u + rotation[1, 1] * v + rotation[1, 2]
            w = rotation[2, 0] * u + rotation[2, 1] * v + rotation[2, 2]
            if z < np.inf:
                x, y, w = x * z + shift[0], y * z + shift[1], w * z + shift[2]
                if hides:
                    level = np.hypot(x, y)
                    across = min(int((np.arctan2(y, x) / (2 * np.pi) + 0.5) * ranges.shape[1]), ranges.shape[1] - 1)
                    up = min(int((np.arctan2(w, level) / np.pi + 0.5) * ranges.shape[0]), ranges.shape[0] - 1)
                    if np.hypot(level, w) > farthest * ranges[up, across]:
                        continue
            if kind == 0:
                if w >= 0:
                    continue
                column, row = lens[2] - x / w * lens[0], lens[3] + y / w * lens[1]
            else:
                flat = np.hypot(x, y)
                if flat == 0 and kind == 2:
                    continue
                rise = np.arctan2(w, flat) if kind == 1 else w / flat
                column, row = lens[2] - np.arctan2(y, x) * lens[0], lens[3] - rise * lens[1]
            if around:
                column %= width
            if not (0 <= column <= width and 0 <= row <= height):
                continue
            if masked and not valid[min(int(row), height - 1), min(int(column), width - 1)]:
                continue
            a, b = column - 0.5, row - 0.5
            left, top = int(np.floor(a)), int(np.floor(b))
            s, t = a - left, b - top
            right, below = left + 1, min(top + 1, height - 1)
            top = max(top, 0)
            if around:
                left, right = left % width, right % width
            else:
                left, right = max(left, 0), min(right, width - 1)
            for c in range(3):
                value = (picture[top, left, c] * (1 - s) + picture[top, right, c] * s) * (1 - t)
                value += (picture[below, left, c] * (1 - s) + picture[below, right, c] * s) * t
                out[j, i, c] = np.uint8(value + 0.5)
            out[j, i, 3] = 255
