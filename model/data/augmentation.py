"""Augmentation of training crops with properties of real scans that path-traced rooms lack.

Texture and lettering are added to points and truth alike: the network must keep them.  Disagreeing stations and noise of single
points are added to the points only: the network must remove them.  Its noise input is the standard deviation as the viewer's
estimate (:mod:`model.appearance.noise`) would give it: smoothed over space, wrong by a factor, sometimes too low, and somewhat
too high on texture.

Measured on real scans at 1280x960 (plant_room, studio): uniform patches of the filled picture vary by 2 to 8 levels around a
local mean, with a kurtosis of 6 to 40 (normal distribution: 3), nearly equally in all channels; neighbouring pixels correlate
by 0.1 to 0.3 where there is noise and by 0.6 where there is texture.
"""

import numpy as np
import torch
import torch.nn.functional as F
from scipy.ndimage import gaussian_filter

from ..network.unet import LUMA
from .surfaces.lettering import lettering

GRAIN_SHARE = 0.12
"""Share of the crops (here and below: of those without a neighbouring camera) with a fine texture.  All shares and ranges
below are those of the shipped weights' training (assets/weights/README.md)."""
LETTERING_SHARE = 0.2
"""Share of the crops with lettering."""
SPECKLE_SHARE = 0.2
"""Share of the crops whose points come from two stations of different brightness."""
SPECKLE_ESTIMATED_SHARE = 0.6
"""Share of those whose difference is part of the noise estimate, as in files without an order of points."""
CLEAN_SHARE = 0.4
"""Share of the crops without noise."""
SIGMA = (0.006, 0.09)
"""Range of the standard deviation of a single point's colour in the others, full brightness = 1, log-uniform."""
ESTIMATE_ERROR = 0.3
"""Standard deviation of the logarithm of estimated over true noise."""
UNDERESTIMATE_SHARE = 0.2
"""Share of the crops whose noise is underestimated on purpose: with little evidence, the viewer's estimate is low."""
ESTIMATE_FLOOR = 0.004
"""Largest standard deviation estimated where there is no noise, due to quantisation and edges."""
TEXTURE_AS_NOISE = 0.2
"""Largest share of the local contrast that the estimate takes for noise."""
FINEST_GRAIN = 0.6
"""Standard deviation, pixels, of the blur of the finest texture; a finer texture cannot be distinguished from noise."""


Mixture = tuple[tuple[np.ndarray, np.ndarray], ...]
"""(gain, share) pairs whose shares add up to 1: a colour becomes the mean of its products with the gains, each clipped at 1."""


def mixed(colour: np.ndarray, mixture: Mixture) -> np.ndarray:
    """(3, side, side) float32, a colour (3, side, side) under a mixture.  Gains: (1 or 3, side, side) or (3, 1, 1); shares:
    (side, side)."""
    return sum((np.minimum(colour * gain, 1.0) * share for gain, share in mixture), np.zeros_like(colour)).astype(np.float32)


def _patches(rng: np.random.Generator, side: int, count: int) -> np.ndarray:
    """(side, side) smooth random values around 0 with a standard deviation of about 1, over ``count`` patches a side."""
    coarse = torch.from_numpy(rng.normal(size=(1, 1, count, count)))
    return F.interpolate(coarse, (side, side), mode="bicubic")[0, 0].numpy()


def grain(rng: np.random.Generator, side: int) -> np.ndarray:
    """(1, side, side) float32 gains around 1: a texture little coarser than a pixel, soft as grain or hard-edged as print.

    The rendered rooms are smooth and their scans somewhat noisy.  Trained on them alone, the network took all fine structure
    for noise, and blurred brick and print.  A texture in both points and truth teaches that it may be real.
    """
    noise = rng.normal(size=(side, side)).astype(np.float32)
    fine, coarse = np.exp(rng.uniform(np.log(FINEST_GRAIN), np.log(2.0))), np.exp(rng.uniform(np.log(1.0), np.log(3.0)))
    noise = gaussian_filter(noise, fine) - gaussian_filter(noise, fine + coarse)
    noise /= max(float(noise.std()), 1e-6)
    if rng.random() < 0.4:
        noise = np.tanh(noise * rng.uniform(1.5, 6.0)) * (noise > rng.uniform(-1.0, 1.0))
    depth = rng.uniform(0.03, 0.25) * np.clip(2 * _patches(rng, side, 5), 0, 1)
    return np.clip(1 + depth * noise, 0.1, 1.6).astype(np.float32)[None]


def speckle(rng: np.random.Generator, side: int) -> tuple[np.ndarray, Mixture]:
    """(3, side, side) float32 gains of the points, and the true mixture of both stations.

    Where stations of different exposure overlap and the file does not name them, neighbouring points come from either at random
    or by scan line.  Without such crops the network took this for texture and drew worm-like patterns.
    """
    share = 1 / (1 + np.exp(-2 * _patches(rng, side, 4) - rng.normal(0, 1.5)))
    chance = rng.normal(size=(side, side))
    lines = gaussian_filter(rng.normal(size=(side, side)), (rng.uniform(4, 20), np.exp(rng.uniform(np.log(0.2), np.log(2.5)))))
    chance = chance / chance.std() + rng.uniform(0, 1.5) * lines / max(float(lines.std()), 1e-6)
    rank = np.empty(chance.size)
    rank[np.argsort(chance, axis=None)] = (np.arange(chance.size) + 0.5) / chance.size
    other = np.exp(rng.choice([-1, 1]) * rng.uniform(0.05, 0.45) + rng.normal(0, 0.03, (3, 1, 1)))
    gains = 1 + (other - 1) * (rank.reshape(side, side) < share)
    return gains.astype(np.float32), ((other, share), (np.ones_like(other), 1 - share))


def noise(rng: np.random.Generator, colour: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(3, side, side) float32 noise of single points, and (side, side) float32, its standard deviation with the estimate's
    errors.

    colour: (3, side, side) 0..1, to which the noise is added.  Misaligned photographs, rough surfaces, sparkle and mixed
    returns have heavy tails: Student's t with 2.5 to 8 degrees of freedom, nearly equal in all channels, sometimes correlated
    along a sweep, and dependent on position and brightness.
    """
    side = colour.shape[-1]
    light = np.tensordot(np.array(LUMA, np.float32), colour, 1)
    place = np.clip(1 + rng.uniform(0, 0.8) * _patches(rng, side, 6), 0.1, 3)
    bright = ((light + 0.1) / 0.6) ** rng.uniform(-0.4, 0.6)
    level = 0.0 if rng.random() < CLEAN_SHARE else np.exp(rng.uniform(*np.log(SIGMA)))
    each = rng.standard_t(rng.uniform(2.5, 8.0), size=(side, side))
    sweeps = gaussian_filter(rng.normal(size=(side, side)), (rng.uniform(2, 12), 0.3))
    each = each + max(0.0, rng.uniform(-1.5, 1.0)) * sweeps / max(float(sweeps.std()), 1e-6)
    chroma = rng.uniform(0.1, 0.4) * rng.standard_t(4.0, size=(3, side, side))
    sigma = level * place * bright
    added = np.clip(sigma * (each + chroma), -0.6, 0.6)

    known_place = _smoothed(place, side / 12) if rng.random() < 0.7 else float(place.mean())
    estimate = level * known_place * (bright if rng.random() < 0.8 else 1.0) * np.exp(rng.normal(0, ESTIMATE_ERROR))
    if rng.random() < UNDERESTIMATE_SHARE:
        estimate = estimate * rng.uniform(0, 0.7)
    texture = rng.uniform(0, TEXTURE_AS_NOISE) * _contrast(light, side) if rng.random() < 0.5 else 0.0
    estimate = np.sqrt(estimate**2 + texture**2 + rng.uniform(0, ESTIMATE_FLOOR) ** 2)
    return added.astype(np.float32), np.broadcast_to(estimate, light.shape).astype(np.float32)


def _contrast(light: np.ndarray, side: int) -> np.ndarray:
    """(side, side) local standard deviation of fine structure, within about an eighth of the side."""
    return np.sqrt(_smoothed(np.square(light - gaussian_filter(light, 1.5)), side / 8))


def _smoothed(plane: np.ndarray, sigma: float) -> np.ndarray:
    """(side, side) blurred with a large ``sigma``, pixels, approximately: at reduced resolution, which is faster."""
    step = max(int(sigma / 3), 1)
    small = F.avg_pool2d(torch.from_numpy(np.ascontiguousarray(plane, np.float32))[None, None], step, ceil_mode=True)[0, 0]
    blurred = torch.from_numpy(gaussian_filter(small.numpy(), sigma / step))
    return F.interpolate(blurred[None, None], plane.shape, mode="bilinear", align_corners=False)[0, 0].numpy()


def augmented(measured: np.ndarray, truth: np.ndarray, rng: np.random.Generator, *,
              textures_only: bool = False) -> np.ndarray:
    """Augments a crop in place and returns its noise estimate: (side, side) float32 standard deviation of a single point's
    colour.

    measured: (6, side, side) of :func:`model.reference.projection.measured_input`.  truth: (5, side, side).  Both float32,
    colours 0..1.  textures_only: adds neither noise nor disagreeing stations; the estimate is 0.
    """
    side, kind = measured.shape[-1], rng.random()
    disagreement: np.ndarray | float = 0.0
    seen: np.ndarray | None = None
    if kind < GRAIN_SHARE:
        seen = grain(rng, side)
        truth[:3] = np.minimum(truth[:3] * seen, 1.0)
    elif kind < GRAIN_SHARE + LETTERING_SHARE:
        seen, true = lettering(rng, side)
        truth[:3] = np.minimum(truth[:3] * true, 1.0)
    elif not textures_only and kind < GRAIN_SHARE + LETTERING_SHARE + SPECKLE_SHARE:
        seen, mixture = speckle(rng, side)
        if rng.random() < SPECKLE_ESTIMATED_SHARE:
            (gain, share), _ = mixture
            spread = np.sqrt(share * (1 - share)) * float(np.abs(gain - 1).mean())
            disagreement = _smoothed(spread * truth[:3].mean(0), side / 12) * np.exp(rng.normal(0, ESTIMATE_ERROR))
        truth[:3] = mixed(truth[:3], mixture)
    if seen is not None:
        measured[:3] = np.minimum(measured[:3] * seen, 1.0)
    if textures_only:
        return np.zeros((side, side), np.float32)
    added, estimate = noise(rng, measured[:3])
    kept = measured[3] > 0
    measured[:3] = np.where(kept, np.clip(measured[:3] + added * measured[5], 0.0, 1.0), 0.0)
    return np.sqrt(estimate**2 + np.square(disagreement)).astype(np.float32)
