"""One RGB-D frame: a photograph with a depth picture, and its points.

Depth is z-depth, metres, +inf where unknown.  World frame: the pose's, metres; the camera frame is OpenGL's.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image
from scipy.ndimage import map_coordinates

from .lens import Lens
from .photos import Photograph

FARTHEST = 65.0
"""Largest valid depth, metres: several formats store 65535 mm for unknown depth."""
JUMP = 0.05
"""Relative difference in depth to a neighbour beyond which a depth pixel mixes two surfaces.  A surface reaches it where its
normal is 88 degrees off the ray, at a focal length of 525 pixels: tan / 525."""
MILLIMETRE = 1 / 1000
"""Metres of one step of depth in most formats."""


@dataclass(frozen=True, eq=False)
class RgbdFrame(Photograph):
    """A photograph with a depth picture.

    unit: metres of one step of depth.  depth_lens: pinhole of a separate depth camera at the same pose; None where the depth
    picture has the photograph's lens, at any resolution.
    """

    depth_path: Path = Path()
    unit: float = MILLIMETRE
    depth_lens: Lens | None = None

    def stored_depth(self) -> np.ndarray:
        """(h, w) float32 metres at the stored resolution, +inf where unknown."""
        raw = np.load(self.depth_path) if self.depth_path.suffix == ".npy" else np.asarray(Image.open(self.depth_path))
        metres = raw.astype(np.float32) * np.float32(self.unit)
        return np.where(np.isfinite(metres) & (metres > 0) & (metres < FARTHEST), metres, np.float32(np.inf))

    def _stored_at(self, stored: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Depth on rays (x, y, 1), OpenCV axes, interpolated in inverse depth, in which a plane is affine; +inf outside the
        depth picture and where a pixel of the interpolation is unknown."""
        h, w = stored.shape
        lens = self.depth_lens or self.lens
        u, v = lens.pixel(x, y)
        u, v = u * (w / lens.width), v * (h / lens.height)
        inside = (u >= 0) & (u < w) & (v >= 0) & (v < h)
        where = np.stack([np.where(inside, v, 0.5) - 0.5, np.where(inside, u, 0.5) - 0.5])
        inverse = map_coordinates(1.0 / stored, where, order=1, mode="nearest")
        share = map_coordinates(np.isfinite(stored).astype(np.float32), where, order=1, mode="nearest")
        good = inside & (share > 0.999)
        return np.where(good, share / np.where(good, inverse, 1.0), np.inf).astype(np.float32)

    def depth(self) -> np.ndarray:
        """(H, W) float32 z-depth, metres, +inf where unknown."""
        j, i = np.mgrid[0 : self.height, 0 : self.width] + 0.5
        return self._stored_at(_without_jumps(self.stored_depth()), (i - self.cx) / self.fl, (j - self.cy) / self.fl)

    def points(self, step: int) -> tuple[np.ndarray, np.ndarray]:
        """Points of every ``step``-th depth pixel along each axis: xyz (N, 3) float64 world, rgb (N, 3) uint8."""
        stored = self.stored_depth()
        h, w = stored.shape
        j, i = np.mgrid[step // 2 : h : step, step // 2 : w : step] + 0.5
        if self.depth_lens is not None:
            lens = self.depth_lens
            x, y = (i * lens.width / w - lens.cx) / lens.fx, (j * lens.height / h - lens.cy) / lens.fy
        else:
            x, y = (i * self.width / w - self.cx) / self.fl, (j * self.height / h - self.cy) / self.fl
        z = self._stored_at(_without_jumps(stored), x, y)
        u, v = x * self.fl + self.cx, y * self.fl + self.cy
        seen = np.isfinite(z) & (u >= 0) & (u < self.width) & (v >= 0) & (v < self.height)
        usable = self.known()
        if usable is not None:
            seen &= usable[np.clip(v, 0, self.height - 1).astype(int), np.clip(u, 0, self.width - 1).astype(int)]
        x, y, z, u, v = x[seen], y[seen], z[seen].astype(np.float64), u[seen].astype(int), v[seen].astype(int)
        local = np.stack([x * z, -y * z, -z], 1)
        return local @ self.camera_to_world[:3, :3].T + self.camera_to_world[:3, 3], self.rgb()[v, u]


def _without_jumps(depth: np.ndarray) -> np.ndarray:
    """Depth, +inf where a neighbouring pixel is much nearer or farther: such a pixel mixes two surfaces."""
    jump = np.zeros(depth.shape, bool)
    known = np.where(np.isfinite(depth), depth, np.nan)
    for axis in (0, 1):
        first = [slice(None)] * 2
        second = [slice(None)] * 2
        first[axis], second[axis] = slice(None, -1), slice(1, None)
        a, b = known[tuple(first)], known[tuple(second)]
        apart = np.abs(a - b) > JUMP * np.fmin(a, b)  # false beside unknown depth
        jump[tuple(first)] |= apart
        jump[tuple(second)] |= apart
    return np.where(jump, np.float32(np.inf), depth)
