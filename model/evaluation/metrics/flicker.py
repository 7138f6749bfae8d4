"""Flicker: difference of successive pictures along a slow camera path, at pixels that show the same surface.

Frame t + 1 is warped to frame t by the true depth of t and both poses.  The remaining difference, divided by that of the true
pictures (moving highlights, noise of the path tracer, resampling), is the flicker.  As blurred pictures flicker less, the
gradient energy relative to the truth is reported too.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from ...data.dataset import TruePicture
from .image_metrics import gradient_energy, mean_of

ROUNDING = 1e-6
"""Pixels beyond the outermost pixel centres that still count as inside: with 1e-9 to 1e-3 the same pixels of a frame of
living-room-2 count where it is compared with itself."""
AGREE = 0.01
"""Largest relative difference of depth at which both frames show the same surface.  On the path of living-room-2, 98.4 % of the
pixels are valid and the true pictures change by 2.58 levels; with half 98.1 % and 2.56, with twice 98.8 % and 2.60."""
TRUTH = "truth"
"""Method name of the true pictures."""


@dataclass(frozen=True)
class Reprojection:
    """Positions of the pixels of one frame in the next.

    grid: (H, W, 2) for ``grid_sample``.  valid: (H, W) bool, whether the next frame shows the same surface.
    """

    grid: Tensor
    valid: Tensor

    def warp(self, after: Tensor) -> Tensor:
        """(C, H, W) the next frame ``after`` (C, H', W') warped to this frame, bilinear; meaningful at ``valid`` pixels
        only."""
        return F.grid_sample(after[None].to(self.grid), self.grid[None], align_corners=False, padding_mode="border")[0]

    def change(self, before: Tensor, after: Tensor) -> float:
        """Mean |before - warp(after)| over valid pixels and channels; NaN without valid pixels."""
        return mean_of((before - self.warp(after))[:, self.valid].abs())


def reprojection(before: TruePicture, after: TruePicture) -> Reprojection:
    """Reprojection between two frames with true depth.

    A pixel is valid if its depth agrees within AGREE with the next frame's, interpolated in 1 / z, in which planes are affine.
    Raises ValueError if a frame has no depth.
    """
    depth, depth_after = before.depth(), after.depth()
    if depth is None or depth_after is None:
        raise ValueError("flicker needs frames with true depth")
    z = depth.astype(np.float64)
    j, i = np.mgrid[0 : before.height, 0 : before.width] + 0.5
    pose, pose_after = before.camera_to_world, after.camera_to_world
    with np.errstate(invalid="ignore", divide="ignore"):
        local = np.stack([(i - before.cx) / before.fl * z, -(j - before.cy) / before.fl * z, -z], -1)
        world = local @ pose[:3, :3].T + pose[:3, 3]
        there = (world - pose_after[:3, 3]) @ (pose_after[:3, :3] * (1.0, -1.0, -1.0))
        u = after.fl * there[..., 0] / there[..., 2] + after.cx
        v = after.fl * there[..., 1] / there[..., 2] + after.cy
    good = np.isfinite(z) & (there[..., 2] > 0)
    edge = 0.5 - ROUNDING
    good &= (u >= edge) & (v >= edge) & (u <= after.width - edge) & (v <= after.height - edge)
    grid = np.stack([2 * u / after.width - 1, 2 * v / after.height - 1], -1)
    result = Reprojection(torch.from_numpy(np.where(good[..., None], grid, 0.0)).float(), torch.from_numpy(good))
    inverse = torch.from_numpy(np.where(np.isfinite(depth_after), 1.0 / depth_after, 0.0)).float()
    expected = torch.from_numpy(np.where(good, there[..., 2], 1.0)).float()
    agrees = (result.warp(inverse[None])[0] * expected - 1.0).abs() <= AGREE
    return Reprojection(result.grid, result.valid & agrees)


def middle_stretch(frames: list, count: int | None) -> list:
    """``count`` consecutive frames from the middle of ``frames``; None: all."""
    count = len(frames) if count is None else min(count, len(frames))
    first = (len(frames) - count) // 2
    return frames[first : first + count]


Key = tuple[str, float]
"""Method, density."""


def measure_flicker(
    frames: Iterable[TruePicture], draw: Callable[[TruePicture], dict[Key, Tensor]],
    on_frame: Callable[[], object] = lambda: None,
) -> list[dict]:
    """Flicker of each method and density along successive frames.

    draw: returns the pictures (3, H, W) of a frame, with the same keys for all frames.  Returns rows: method, density, change
    (mean absolute, 0..1), flicker (change relative to the truth's), gradient (energy relative to the truth's), valid (share of
    the pixels that are compared).
    """
    changes: dict[Key, list[float]] = {}
    energies: dict[Key, list[float]] = {}
    shares: list[float] = []
    before: tuple[TruePicture, dict[Key, Tensor]] | None = None
    for frame in frames:
        pictures = {(TRUTH, 1.0): torch.from_numpy(frame.rgb().copy()).permute(2, 0, 1) / 255, **draw(frame)}
        for key, picture in pictures.items():
            energies.setdefault(key, []).append(gradient_energy(picture))
        if before is not None:
            back = reprojection(before[0], frame)
            shares.append(float(back.valid.double().mean()))
            for key, picture in pictures.items():
                changes.setdefault(key, []).append(back.change(before[1][key], picture))
        before = frame, pictures
        on_frame()
    own_change, own_energy = (float(np.nanmean(values.pop((TRUTH, 1.0)))) for values in (changes, energies))
    return [
        {
            "method": method, "density": density, "change": float(np.nanmean(values)),
            "flicker": float(np.nanmean(values)) / own_change if own_change > 0 else float("nan"),
            "gradient": float(np.mean(energies[method, density])) / own_energy if own_energy > 0 else float("nan"),
            "valid": float(np.mean(shares)),
        }
        for (method, density), values in changes.items()
    ]
