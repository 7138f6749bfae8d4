"""Random clouds and cameras for the OpenGL tests, seeded."""

import numpy as np

from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.grid.scene import unpack
from pointglass.viewer.picture.camera import Camera, from_fov, look_at
from pointglass.viewer.preprocess.scan_description import ScanDescription, ScanSummary


def room(seed: int, points: int = 24_000, scale: float = 1.0, origin=(0.0, 0.0, 0.0), noise: bool = False):
    """A box seen from inside with a few boxes in it: surfaces, so that the filter has something to decide.  noise: whether its
    random colours count as noise, which is averaged in sparse places."""
    rng = np.random.default_rng(seed)
    parts = []
    for low, high in [((0, 0, 0), (6, 5, 3)), *(((x := rng.uniform(0, 5)), (y := rng.uniform(0, 4)), 0) and
                                              ((x, y, 0.0), (x + 0.7, y + 0.5, rng.uniform(0.4, 1.8))) for _ in range(5))]:
        low, high = np.array(low, float), np.array(high, float)
        p = rng.uniform(low, high, (points // 6, 3))
        axis = rng.integers(0, 3, len(p))
        side = rng.random(len(p)) < 0.5
        p[np.arange(len(p)), axis] = np.where(side, low[axis], high[axis])
        parts.append(p)
    xyz = np.concatenate(parts) * scale + np.asarray(origin)
    rgb = rng.integers(0, 256, (len(xyz), 3)).astype(np.uint8)
    return scene_from_arrays(xyz, rgb, noise=noise)


def scanned(seed: int, scale: float = 1.0, origin=(0.0, 0.0, 0.0), places: int = 3, unknown=(), points: int = 24_000,
            noise: bool = False):
    """The room, each point one station's, by chance; nobody knows where those of ``unknown`` stood."""
    rng = np.random.default_rng(seed)
    xyz, rgb, _, _ = unpack(room(seed, points, scale, origin))
    scan = rng.integers(0, places, len(xyz)).astype(np.uint8)
    low, high = xyz.min(0), xyz.max(0)
    scans = tuple(ScanSummary(f"station {s}", int((scan == s).sum()),
                              None if s in unknown else tuple(rng.uniform(low, high).tolist())) for s in range(places))
    return scene_from_arrays(xyz, rgb, scan=scan, meta=ScanDescription(scans=scans), noise=noise)


def slats(seed: int, scale: float = 1.0):
    """A dense wall behind thin dense bars, with single points floating between them: few points in front, and clumped.  The
    wall is at x 4, bars and points from x 3 to 3.8, within y and z of 2 from the x axis."""
    rng = np.random.default_rng(seed)
    wall = np.column_stack([np.full(60_000, 4.0), rng.uniform(-2, 2, (60_000, 2))])
    bars = np.column_stack([rng.uniform(3.2, 3.8, 12).repeat(4_000), rng.uniform(-1.5, 1.5, 12).repeat(4_000),
                            rng.uniform(-2, 2, 48_000)])  # fmt: skip
    bars[:, 1] += rng.uniform(0, 0.03, len(bars))
    floating = rng.uniform((3.0, -1.5, -1.5), (3.8, 1.5, 1.5), (150, 3))
    xyz = np.concatenate([wall, bars, floating]) * scale
    return scene_from_arrays(xyz, rng.integers(0, 256, (len(xyz), 3)).astype(np.uint8), noise=False)


def before_slats(seed: int, size=(320, 240), scale: float = 1.0) -> Camera:
    """A camera that looks at the wall of ``slats``."""
    eye = np.random.default_rng(seed).uniform((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)) * scale
    return from_fov(*size, 55.0, look_at(eye, np.array([4.0, 0.0, 0.0]) * scale), name=f"slats{seed}")


def camera_in(scene, seed: int, size=(256, 100), fov: float | None = None) -> Camera:
    """A camera at a random place inside the scene's bounds, looking anywhere.

    size: 256 pixels along a side, so that the hole test looks at two distances (model.reference.hole_constants.strides)."""
    rng = np.random.default_rng(seed)
    low, high = scene.bounds
    eye, target = rng.uniform(low, high, (2, 3))
    return from_fov(*size, fov or rng.uniform(30, 110), look_at(eye, target), name=f"camera{seed}")
