"""Photographic textures painted onto a place by position in space, equally on its points and its true views.

The path-traced rooms have plain walls: a network trained on them alone takes all fine structure for noise.  A painting
multiplies colours, inside a few spheres of the place, by a texture projected along an oblique direction.  A point samples it at
its position over the beam's footprint; a pixel of a true view averages it over the pixel's footprint (mip maps, Williams 1983).
Texture too fine for both is therefore uniform in both, and aliasing occurs in points only.

World frame: the place's own, metres.  Textures are sRGB; they are averaged in linear light.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np
from PIL import Image

from ...common.errors import DataError
from ...common.jit import compiled
from ...common.linear_light import to_linear, to_srgb
from ..dataset import TruePicture

SIDE = 128
"""Texels along a side of a texture: the size of ambientCG's thumbnails."""
LEVELS = SIDE.bit_length() - 1
"""Mip levels: 128 down to 2 texels a side."""
SHEET_FIRST, SHEET_ACROSS, SHEET_DOWN, SHEET_COLUMNS, SHEET_TRIM = 16, 144, 176, 7, 3
"""Layout of ambientCG's thumbnail sheets, pixels (data/textures/README.md): first cell, cell width and height, columns, and
border to trim."""
MAX_WHITE = 0.5
"""Share of nearly white pixels above which a cell of a sheet is empty.  This and the values below are those of the
shipped weights' training (assets/weights/README.md)."""
REGIONS = (8, 20)
"""Number of painted spheres of a place: minimum, and exclusive maximum."""
RADIUS = (0.25, 1.0)
"""Radius of a sphere as a share of the place's extent (median distance of its points from their centre): chosen so that about
half of the place is painted."""
TILE = (0.15, 4.0)
"""Side of a texture, metres: from texels of about a millimetre, a typical point spacing, to features of a metre."""
CONTRAST = (0.12, 1.2)
"""Exponent of the texture's gain, from faint to full."""
BRIGHTEST = 1.8
"""Largest gain of a texel."""
SUBSAMPLES = 3
"""Samples along a side of a pixel of a true view."""
EDGE = 0.05
"""Relative change of inverse depth between neighbouring pixels beyond which they are different surfaces."""


@lru_cache(maxsize=1)
def load_textures(folder: Path) -> list[np.ndarray]:
    """The (128, 128, 3) uint8 textures of all thumbnail sheets (``*.webp``) in a folder.

    Raises DataError where the folder contains none.
    """
    found: list[np.ndarray] = []
    for path in sorted(Path(folder).glob("*.webp")):
        sheet = Image.open(path).convert("RGB")
        for top in range(SHEET_FIRST, sheet.height - SIDE // 2, SHEET_DOWN):
            for column in range(SHEET_COLUMNS):
                left = SHEET_FIRST + column * SHEET_ACROSS
                box = (left + SHEET_TRIM, top + SHEET_TRIM, left + SIDE - SHEET_TRIM, top + SIDE - SHEET_TRIM)
                if box[2] > sheet.width or box[3] > sheet.height:
                    continue
                cell = sheet.crop(box)
                if (np.asarray(cell).min(2) > 245).mean() < MAX_WHITE:
                    found.append(np.asarray(cell.resize((SIDE, SIDE), Image.Resampling.LANCZOS)))
    if not found:
        raise DataError("no thumbnail sheets (*.webp)", option="--textures", value=folder,
                        remedy="give ambientCG's, 128 pixels a texture")
    return found


def mip_levels(texture: np.ndarray) -> np.ndarray:
    """(LEVELS, 128, 128, 3) float32 linear gains of a (128, 128, 3) uint8 texture, mean 1 in each channel.

    Level k has (128 / 2^k) x (128 / 2^k) box-filtered texels in its first corner.
    """
    light = to_linear(texture / 255.0)
    light = light / np.maximum(light.mean((0, 1)), 1e-3)
    levels = np.ones((LEVELS, SIDE, SIDE, 3), np.float32)
    for level in range(LEVELS):
        side = SIDE >> level
        levels[level, :side, :side] = light
        light = light.reshape(side // 2, 2, side // 2, 2, 3).mean((1, 3))
    return levels


@dataclass(frozen=True)
class Painting:
    """Spheres of a place and their textures.

    centre (R, 3), radius (R,) metres.  across, along (R, 3): texture axes, in tiles per metre.  texel (R,): metres of a texel.
    mips (R, LEVELS, 128, 128, 3) float32 linear gains, with contrast applied.
    """

    centre: np.ndarray
    radius: np.ndarray
    across: np.ndarray
    along: np.ndarray
    texel: np.ndarray
    mips: np.ndarray

    def gain(self, xyz: np.ndarray, footprint: np.ndarray) -> np.ndarray:
        """(N, 3) float32 linear gains at ``xyz`` (N, 3), 1 outside all spheres.  footprint: (N,) metres to average over."""
        out = np.ones((len(xyz), 3), np.float32)
        _sample(np.ascontiguousarray(xyz, np.float64), np.ascontiguousarray(footprint, np.float64), self.centre,
                self.radius, self.across, self.along, self.texel, self.mips, out)
        return out


def make_painting(textures: Sequence[np.ndarray], xyz: np.ndarray, rng: np.random.Generator) -> Painting:
    """A painting of the place with the points ``xyz`` (N, 3), with random textures."""
    count = int(rng.integers(*REGIONS))
    centre = xyz[rng.integers(len(xyz), size=count)].astype(np.float64)
    middle = np.median(xyz[:: max(len(xyz) // 10_000, 1)], axis=0)
    extent = float(np.median(np.linalg.norm(xyz[:: max(len(xyz) // 10_000, 1)] - middle, axis=1)))
    tile = _log_uniform(rng, TILE, count)
    axes = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0]
    mips = np.stack([
        np.minimum(mip_levels(textures[int(rng.integers(len(textures)))]) ** contrast, BRIGHTEST)
        for contrast in _log_uniform(rng, CONTRAST, count)
    ])
    return Painting(centre, extent * _log_uniform(rng, RADIUS, count), axes[:, 0] / tile[:, None],
                    axes[:, 1] / tile[:, None], tile / SIDE, mips.astype(np.float32))


def _log_uniform(rng: np.random.Generator, limits: tuple[float, float], count: int) -> np.ndarray:
    return np.exp(rng.uniform(np.log(limits[0]), np.log(limits[1]), count))


def painted(rgb: np.ndarray, gain: np.ndarray) -> np.ndarray:
    """(N, 3) uint8 sRGB colours times linear gains (N, 3)."""
    return np.rint(255 * to_srgb(_linear()[rgb] * gain)).astype(np.uint8)


@lru_cache(maxsize=1)
def _linear() -> np.ndarray:
    return to_linear(np.arange(256) / 255).astype(np.float32)


def paint_picture(painting: Painting, picture: TruePicture) -> np.ndarray:
    """(H, W, 3) uint8: the painted picture, with gains averaged over each pixel; unchanged where its depth is unknown."""
    depth, rgb = picture.depth(), picture.rgb()
    if depth is None:
        return rgb
    with np.errstate(divide="ignore"):
        inverse = np.where(np.isfinite(depth), 1.0 / depth, 0.0)
    slopes = np.stack([_inverse_slope(inverse, axis) for axis in (1, 0)])
    gain = np.ones((*depth.shape, 3), np.float32)
    _paint_pixels(inverse, slopes, np.array((picture.fl, picture.cx, picture.cy)), np.asarray(picture.camera_to_world),
                  painting.centre, painting.radius, painting.across, painting.along, painting.texel, painting.mips, gain)
    return painted(rgb.reshape(-1, 3), gain.reshape(-1, 3)).reshape(rgb.shape)


def _inverse_slope(inverse: np.ndarray, axis: int) -> np.ndarray:
    """(H, W) difference of 1 / depth, in which a plane is linear, to the next pixel along an axis; 0 across edges."""
    before = np.diff(inverse, axis=axis, prepend=np.take(inverse, [0], axis))
    after = np.diff(inverse, axis=axis, append=np.take(inverse, [-1], axis))
    slope = np.where(np.abs(before) < np.abs(after), before, after)
    return np.where(np.abs(slope) < EDGE * inverse, slope, 0.0)


@compiled(nogil=True)
def _texel(mips, level, u, v, channel):
    """Bilinear sample of a level, mirrored beyond the texture, so that there is no seam.  u, v: tiles."""
    side = SIDE >> level
    x, y = u * side - 0.5, v * side - 0.5
    x0, y0 = int(np.floor(x)), int(np.floor(y))
    fx, fy = x - x0, y - y0
    period = 2 * side
    xa, xb, ya, yb = x0 % period, (x0 + 1) % period, y0 % period, (y0 + 1) % period
    xa, xb = min(xa, period - 1 - xa), min(xb, period - 1 - xb)
    ya, yb = min(ya, period - 1 - ya), min(yb, period - 1 - yb)
    top = mips[level, ya, xa, channel] * (1 - fx) + mips[level, ya, xb, channel] * fx
    bottom = mips[level, yb, xa, channel] * (1 - fx) + mips[level, yb, xb, channel] * fx
    return top * (1 - fy) + bottom * fy


@compiled(nogil=True)
def _gain_at(x, y, z, footprint, centre, radius, across, along, texel, mips, out):
    """Trilinear sample, into out (3,), of the first sphere that contains a position.  Returns whether one does."""
    for r in range(len(radius)):
        dx, dy, dz = x - centre[r, 0], y - centre[r, 1], z - centre[r, 2]
        if dx * dx + dy * dy + dz * dz > radius[r] * radius[r]:
            continue
        u = dx * across[r, 0] + dy * across[r, 1] + dz * across[r, 2]
        v = dx * along[r, 0] + dy * along[r, 1] + dz * along[r, 2]
        level = min(max(np.log2(max(footprint / texel[r], 1.0)), 0.0), LEVELS - 1.001)
        low = int(level)
        part = level - low
        for channel in range(3):
            fine = _texel(mips[r], low, u, v, channel)
            coarse = _texel(mips[r], low + 1, u, v, channel)
            out[channel] = fine * (1 - part) + coarse * part
        return True
    return False


@compiled(nogil=True)
def _sample(xyz, footprint, centre, radius, across, along, texel, mips, out):
    """Gains into out (N, 3), which is unchanged outside all spheres."""
    for i in range(len(xyz)):
        _gain_at(xyz[i, 0], xyz[i, 1], xyz[i, 2], footprint[i], centre, radius, across, along, texel, mips, out[i])


@compiled(nogil=True)
def _paint_pixels(inverse, slopes, lens, pose, centre, radius, across, along, texel, mips, out):
    """Gains of pixels into out (H, W, 3): means of SUBSAMPLES x SUBSAMPLES samples on each pixel's tangent plane."""
    sample = np.empty(3, np.float32)
    share = np.float32(1.0 / (SUBSAMPLES * SUBSAMPLES))
    for row in range(inverse.shape[0]):
        for column in range(inverse.shape[1]):
            if inverse[row, column] <= 0.0:
                continue
            total = np.zeros(3, np.float32)
            for k in range(SUBSAMPLES * SUBSAMPLES):
                right, down = (k % SUBSAMPLES + 0.5) / SUBSAMPLES - 0.5, (k // SUBSAMPLES + 0.5) / SUBSAMPLES - 0.5
                z = 1.0 / max(inverse[row, column] + right * slopes[0, row, column] + down * slopes[1, row, column], 1e-9)
                a = (column + 0.5 + right - lens[1]) / lens[0] * z
                b = -(row + 0.5 + down - lens[2]) / lens[0] * z
                x = pose[0, 0] * a + pose[0, 1] * b - pose[0, 2] * z + pose[0, 3]
                y = pose[1, 0] * a + pose[1, 1] * b - pose[1, 2] * z + pose[1, 3]
                w = pose[2, 0] * a + pose[2, 1] * b - pose[2, 2] * z + pose[2, 3]
                sample[:] = 1.0
                _gain_at(x, y, w, z / lens[0] / SUBSAMPLES, centre, radius, across, along, texel, mips, sample)
                total += sample
            out[row, column] = total * share
