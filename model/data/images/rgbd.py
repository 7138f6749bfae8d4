"""Folders of RGB-D frames with poses: most frames are merged into the scan, the others are true pictures.

Every k-th depth pixel of evenly chosen frames becomes a point, and one point is kept in each voxel.  The folder formats are
read by :mod:`model.data.images.rgbd_forms`.

World frame: the poses' own, metres.  Camera frames are OpenGL's.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...common.errors import DataError
from ..dataset import MergedScan
from .photo_place import PhotoPlace
from .photos import check_pictures
from .rgbd_forms import read_frames
from .rgbd_frame import FARTHEST, RgbdFrame

HELD_OUT = 8
"""One frame in this many is a true picture, as usual for new views (LLFF, mip-NeRF 360)."""
MAX_FRAMES = 200
"""Largest number of frames in the scan: each keeps 60,000 of MAX_POINTS."""
MAX_POINTS = 12_000_000
"""Largest number of points before one per voxel is kept: 324 MB of coordinates and colours."""


def load_rgbd(folder: Path, *, held_out: int = HELD_OUT, step: int | None = None, voxel: float | None = None,
              unit: float | None = None) -> PhotoPlace:
    """A place from a folder of RGB-D frames in any of the three formats.

    held_out: one frame in this many is a view and not part of the scan.  step: one depth pixel in this many, along each axis
    (default: such that the scan has at most MAX_POINTS).  voxel: metres (default: size of a depth pixel at the median depth).
    unit: metres of one step of the depth pictures, where the format does not say (default: 1 / 5000 for TUM, else 1 / 1000).
    Raises DataError, before any training, naming the first ten files that are missing, unreadable or of another size.
    """
    folder = Path(folder)
    if held_out < 2 or any(value is not None and not value > 0 for value in (step, voxel, unit)):
        raise DataError(f"held_out {held_out}, step {step}, voxel {voxel}, unit {unit}: expected held_out of 2 or more, the "
                        "others above 0", file=folder)
    frames = read_frames(folder, unit)
    if len(frames) < 2 * held_out:
        raise DataError(f"{len(frames)} frames with picture, depth and pose; at least {2 * held_out} are needed, because one "
                        f"in {held_out} is held out", file=folder)
    if len({(f.width, f.height) for f in frames}) != 1:
        raise DataError("its pictures have several sizes", file=folder, remedy="split it into folders of one size each")
    wanted: list[tuple[Path, tuple[int, int] | None]] = [(f.path, (f.width, f.height)) for f in frames]
    check_pictures(folder, [*wanted, *((f.depth_path, None) for f in frames),
                            *((f.mask, (f.width, f.height)) for f in frames if f.mask)], [f.depth_path for f in frames])
    views = frames[held_out // 2 :: held_out]
    others = [frame for index, frame in enumerate(frames) if index % held_out != held_out // 2]
    chosen = [others[k] for k in np.unique(np.linspace(0, len(others) - 1, min(len(others), MAX_FRAMES)).astype(int))]
    return PhotoPlace(folder.name, lambda: scan_frames(folder, chosen, step=step, voxel=voxel), views)


def scan_frames(folder: Path, frames: Sequence[RgbdFrame], *, step: int | None, voxel: float | None) -> MergedScan:
    """The frames' depth merged into one scan, one point per voxel.  folder: for the DataError of frames without depth."""
    sample = [frame.stored_depth() for frame in frames[:: max(1, len(frames) // 8)]]
    pixels = sample[0].size
    step = step or max(1, int(np.ceil(np.sqrt(pixels * len(frames) / MAX_POINTS))))
    finite = np.concatenate([depth[np.isfinite(depth)] for depth in sample])
    if not len(finite):
        raise DataError(f"its depth pictures have no depth below {FARTHEST} m; is their unit right?", file=folder)
    lens = frames[0].depth_lens or frames[0].lens
    edge = voxel or float(np.median(finite)) / (lens.fx * sample[0].shape[1] / lens.width)
    parts = [frame.points(step) for frame in frames]
    xyz, rgb = np.concatenate([p[0] for p in parts]), np.concatenate([p[1] for p in parts])
    order = np.random.default_rng(0).permutation(len(xyz))  # otherwise the first frames would be preferred in shared voxels
    keep = np.sort(order[_first_in_voxel(xyz[order], edge)])
    return MergedScan(xyz[keep], rgb[keep], np.zeros(len(keep), np.uint8))


def _first_in_voxel(xyz: np.ndarray, voxel: float) -> np.ndarray:
    """Indices of the first point in each voxel."""
    if not len(xyz):
        return np.zeros(0, np.int64)
    steps = np.floor((xyz - xyz.min(0)) / voxel).astype(np.int64)
    spans = steps.max(0) + 1
    return np.unique((steps[:, 0] * spans[1] + steps[:, 1]) * spans[2] + steps[:, 2], return_index=True)[1]
