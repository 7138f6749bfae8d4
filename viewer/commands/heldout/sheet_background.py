"""Where a picture of the sheet shows the background, as the window does: in directions that the scan does not enclose and that
have no measured pixels around them (viewer.render.culling.enclosed_directions; model.reference.hole_test, the reference
implementation of the shaders).  The network may open an outline further; that is left out here."""

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from ....model.data.dataset import TruePicture
from ....model.evaluation.labelled import picture_bytes
from ....model.reference.hole_test import coverage
from ....model.reference.ray_march import march, rays_of, sparse_depth
from ...picture.background import composite
from ...picture.camera import Camera
from ...render.culling.enclosed_directions import OPEN, Enclosure, cell_of

if TYPE_CHECKING:
    from ...grid.scene import Scene


class SheetBackground:
    """Of one scene."""

    def __init__(self, scene: "Scene"):
        self._enclosure = Enclosure(scene)

    def opacity(self, picture: TruePicture, mask: Tensor) -> np.ndarray:
        """(H, W) float64 0..1: opacity of each pixel.  picture: its camera.  mask: (H, W) bool, the measured pixels."""
        camera = Camera(picture.width, picture.height, picture.fl, picture.fl, picture.cx, picture.cy, picture.camera_to_world)
        around, met = self._enclosure.around(camera.position), None
        if (occupancy := around.occupancy) is not None:
            rays, sizes = rays_of(camera, camera.view_rotation.T)
            sparse = sparse_depth(camera, occupancy.spacing) / occupancy.side
            eye = (camera.position - occupancy.origin) / occupancy.side
            met = torch.from_numpy(march(occupancy.codes, eye, rays, sizes, sparse))
        i, j = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
        view = np.stack([(i - camera.cx) / camera.fx, (j - camera.cy) / camera.fy, np.ones_like(i)], -1)
        states = around.closed.ravel()[cell_of((view @ camera.view_rotation).reshape(-1, 3))].reshape(i.shape)
        return np.where(states != OPEN, 1.0, coverage(mask, met).numpy()) * bool(mask.any())

    def behind(self, shown: Tensor, opacity: np.ndarray) -> np.ndarray:
        """(H, W, 3) uint8: a picture (3, H, W) in 0..1 over the window's plain background."""
        alpha = np.rint(opacity * 255.0)[..., None]
        colour = np.rint(picture_bytes(shown) * opacity[..., None])
        return composite(np.concatenate([colour, alpha], axis=2).astype(np.uint8), "plain")
