"""Station photographs in the present view: resampled onto what the camera sees, blended with it, and compared by PSNR.

From the photograph's own place every pixel of it lands where it belongs, whatever the depth.  From elsewhere the depth of the
picture tells which place of the scan a pixel shows, and the photograph's colour of that place is taken, unless something nearer
hid that place from the photograph: a map of the nearest points around the photograph tells (a shadow map: Williams 1978).  With
the distance walked the photograph fades out.
"""

import numpy as np

from ...picture.camera import Camera
from ...readers.e57.e57_photographs import KINDS, StationPhoto

FADE = 2.0
"""Metres from its place over which a photograph fades out.  Measured on 59 views of five rendered rooms, with the photographs
of a station: up to 3 m from it they show 85 to 94 % of a view and agree with it within 21 to 26 dB PSNR (means of five ranges
of distance), from 3 to 4 m they show 70 % and 15 dB.  Twice the distance would show those; half would fade out what agrees as
well as nearer views."""
COLUMNS, ROWS = 512, 256
"""Directions around a photograph by which the nearest points are kept: 0.7 degrees, a few hundred thousand points fill them."""
BEHIND = 0.05
"""How much farther than the nearest point, as a share of its distance, a place counts as hidden from the photograph: more than
surfaces seen at a slant vary within a direction, less than furniture stands before a wall."""


def nearest_ranges(photo: StationPhoto, points: np.ndarray) -> np.ndarray:
    """(ROWS, COLUMNS) float32 distance of the nearest point around a photograph's place, by elevation and azimuth in the
    photograph's frame; +inf where there is none in a direction nor beside it.

    points: (n, 3) float64, file coordinates: a sample of the scan.  Each direction also takes the nearest of its neighbours, so
    that a surface of points has no gaps; so outlines grow by one direction, a third of a degree to one degree.
    """
    x, y, z = ((points - photo.position) @ photo.camera_to_world[:3, :3]).T
    flat = np.hypot(x, y)
    distance = np.hypot(flat, z)
    column = np.minimum(((np.arctan2(y, x) / (2 * np.pi) + 0.5) * COLUMNS).astype(int), COLUMNS - 1)
    row = np.minimum(((np.arctan2(z, flat) / np.pi + 0.5) * ROWS).astype(int), ROWS - 1)
    nearest = np.full(ROWS * COLUMNS, np.inf, np.float32)
    use = distance > 0
    np.minimum.at(nearest, (row * COLUMNS + column)[use], distance[use].astype(np.float32))
    nearest = nearest.reshape(ROWS, COLUMNS)
    across = np.minimum(nearest, np.minimum(np.roll(nearest, 1, 1), np.roll(nearest, -1, 1)))
    padded = np.pad(across, ((1, 1), (0, 0)), constant_values=np.inf)
    return np.minimum(across, np.minimum(padded[:-2], padded[2:]))


def resampled(photo: StationPhoto, camera: Camera, depth: np.ndarray, ranges: np.ndarray | None = None) -> np.ndarray:
    """The photograph as the camera sees it, (H, W, 4) uint8: alpha 255 where the photograph shows that pixel, else 0.

    depth: (H, W) float32 view-space z, file units, of the picture; +inf where nothing was measured: taken as far away.
    ranges: of :func:`nearest_ranges`; None: nothing hides anything, as at the photograph's own place.
    """
    from .photo_kernel import resample  # numba: only once a photograph is shown

    to_photo = photo.camera_to_world[:3, :3].T
    out = np.zeros((*depth.shape, 4), np.uint8)
    valid = np.ones((1, 1), bool) if photo.valid is None else photo.valid
    resample(np.ascontiguousarray(photo.picture), valid, photo.valid is not None, KINDS.index(photo.kind), photo.around,
             np.array([photo.fx, photo.fy, photo.cx, photo.cy]), to_photo @ camera.view_rotation.T,
             to_photo @ (camera.position - photo.position), np.array([camera.fx, camera.fy, camera.cx, camera.cy]),
             np.ascontiguousarray(depth, np.float32), np.zeros((1, 1), np.float32) if ranges is None else ranges,
             ranges is not None, 1.0 + BEHIND, out)  # fmt: skip
    return out


def strength(distance: float, metres_per_unit: float | None, blend: float) -> float:
    """How much of the photograph is seen, 0 to 1: ``blend`` at its own place, 0 from FADE metres on.  distance: file units."""
    return blend * max(0.0, 1.0 - distance * (metres_per_unit or 1.0) / FADE)


def blended(view: np.ndarray, photo: np.ndarray, share: float, split: int | None = None) -> np.ndarray:
    """A picture with a resampled photograph over it; (H, W, 4) uint8 each, premultiplied.

    share: of the photograph, 0 to 1.  split: the photograph is shown left of this column only; None: everywhere.
    """
    weight = np.where(photo[..., 3:] > 0, np.float32(share), np.float32(0))
    if split is not None:
        weight[:, split:] = 0
    mixed = view.astype(np.float32) * (1 - weight) + photo.astype(np.float32) * weight
    return np.rint(mixed).astype(np.uint8)


def agreement(view: np.ndarray, photo: np.ndarray) -> float | None:
    """PSNR in dB between a picture and a resampled photograph, at pixels that both show; None where there are none.

    (H, W, 4) uint8 each.  +inf where they are equal."""
    both = (view[..., 3] == 255) & (photo[..., 3] == 255)
    if not both.any():
        return None
    error = np.mean((view[both][:, :3].astype(np.float64) - photo[both][:, :3]) ** 2)
    return float("inf") if error == 0 else float(10 * np.log10(255.0**2 / error))
