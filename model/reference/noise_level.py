"""Noise of a picture's pixels from the noise of its scan: reference implementation of ``noise_level.comp``.

View frame: x right, y down, z forward, file units, relative to the camera.
"""

import numpy as np
import torch
from torch import Tensor

from ..appearance.noise import LUMA, NoiseModel
from .projection import Raster


def pixel_noise(noise: NoiseModel | None, raster: Raster, camera, view_to_world: np.ndarray, eye: np.ndarray) -> Tensor:
    """(H, W) standard deviation of a single point's colour at each pixel, full brightness = 1; 0 where a pixel is empty.

    noise: of the scan; None where it is unknown, which gives 0: too low a value costs noisy scans little, too high a value
    costs clean scans their texture.  camera: width, height, fx, fy, cx, cy.  view_to_world: (3, 3) rotation.  eye: (3,)
    position of the camera in the frame of ``noise``.
    """
    depth = raster.depth.double().numpy()
    sigma = np.zeros(depth.shape, np.float32)
    if noise is not None:
        rows, columns = np.nonzero(np.isfinite(depth))
        z = depth[rows, columns]
        by = getattr(camera, "orthographic", None) or z
        view = np.stack([(columns + 0.5 - camera.cx) / camera.fx * by, (rows + 0.5 - camera.cy) / camera.fy * by, z], 1)
        luma = raster.colour[:, rows, columns].double().numpy().T @ LUMA / 255.0
        sigma[rows, columns] = noise.at(view @ view_to_world.T + eye, luma)
    return torch.from_numpy(sigma).to(raster.depth.dtype)
