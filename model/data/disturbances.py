"""What scans hold and smooth, path-traced rooms do not: texture, lettering, stations that disagree, points that stray.

Each is a gain for every pixel of a crop, *seen* by the points, and what is then *true*.  What both have in common is to be
kept; what the points alone have is to be taken away.  Real scans, 1280x960 (plant_room, studio): even patches of the filled
picture vary by 2 to 8 levels around a local mean, with a kurtosis of 6 to 40 where a normal distribution has 3, nearly alike
in all channels, and from pixel to pixel (neighbours correlate by 0.1 to 0.3) where points stray, more (0.6) where there is
texture.
"""

import numpy as np
import torch
import torch.nn.functional as F
from scipy.ndimage import gaussian_filter

from model.data.lettering import lettering
from model.pull_push import pull_push

GRAIN_SHARE = 0.15  # at a third of the crops the network drew texture where real scans hold noise
"""Share of the crops (of those without a neighbouring camera, here and below) whose surfaces get a fine texture."""
LETTERING_SHARE = 0.1
"""Share of the crops with lettering."""
SPECKLE_SHARE = 0.3
"""Share of the crops whose points come from two stations that do not agree in brightness."""
STRAY_SHARE = 0.5
"""Share of the crops whose points stray in brightness, each for itself; also of those with a texture or two stations."""
FINEST_GRAIN = 0.6
"""Standard deviation, pixels, of the finest texture: what is finer cannot be told from points that stray."""


Mixture = tuple[tuple[np.ndarray, np.ndarray], ...]
"""(gain, share) pairs whose shares add up to 1: a colour is the mean of itself under every gain, no part of it above white."""


def mixed(colour: np.ndarray, mixture: Mixture) -> np.ndarray:
    """(3, side, side) float32 of (3, side, side), each gain (1 or 3, side, side) or (3, 1, 1), each share (side, side)."""
    return sum((np.minimum(colour * gain, 1.0) * share for gain, share in mixture), np.zeros_like(colour)).astype(np.float32)


def _patches(rng: np.random.Generator, side: int, count: int) -> np.ndarray:
    """(side, side) that varies smoothly around 0, by about 1, over ``count`` patches a side."""
    coarse = torch.from_numpy(rng.normal(size=(1, 1, count, count)))
    return F.interpolate(coarse, (side, side), mode="bicubic")[0, 0].numpy()


def grain(rng: np.random.Generator, side: int) -> np.ndarray:
    """(1, side, side) float32 around 1: a texture hardly coarser than a pixel, as grain or as the hard edges of print.

    The true rooms are smooth and their scans a little noisy: alone they teach that whatever is fine is noise, and brick and
    print came out soft.  A texture seen by points and truth alike teaches that it may be real.
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
    """(3, side, side) float32 gains of the points, and the mixture of both stations that is true.

    Where stations of different exposure overlap and the file does not tell them apart, neighbouring points come from one or
    the other by chance, or by scan line.  Without such crops the network took it for a pattern and drew worms.
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


def stray(rng: np.random.Generator, side: int) -> np.ndarray:
    """(3, side, side) float32 gains around 1 of the points alone: each strays for itself, most a little and some by much.

    Photographs laid over a scan a little off, surfaces rougher than a pixel, sparkle and mixed returns give neighbouring
    points of an even wall colours of their own.  Students' t with 2.5 to 8 degrees of freedom has their heavy tails.
    """
    spread = np.exp(rng.uniform(np.log(0.008), np.log(0.07))) * np.clip(0.6 + _patches(rng, side, 6), 0, 2)
    each = rng.standard_t(rng.uniform(2.5, 8.0), size=(side, side))
    lines = gaussian_filter(rng.normal(size=(side, side)), (rng.uniform(2, 12), 0.3))
    each = each + max(0.0, rng.uniform(-1.5, 1.0)) * lines / max(float(lines.std()), 1e-6)  # of a scan, now and then
    colour = 0.15 * rng.standard_t(4.0, size=(3, side, side))
    return np.exp(np.clip(spread * (each + colour), -0.9, 0.7)).astype(np.float32)


def disturbed(x: np.ndarray, y: np.ndarray, rng: np.random.Generator, *, textures_only: bool = False) -> None:
    """Disturbs a crop in place: x (5, side, side) input, y (5, side, side) truth, both float32, colours 0..1.

    textures_only: neither stations nor points have colours that are not the truth's.
    """
    side, kind, strays = x.shape[-1], rng.random(), rng.random() < STRAY_SHARE
    seen: np.ndarray | None = None
    if kind < GRAIN_SHARE:
        seen = grain(rng, side)
        y[:3] = np.minimum(y[:3] * seen, 1.0)
    elif kind < GRAIN_SHARE + LETTERING_SHARE:
        seen, true = lettering(rng, side)
        y[:3] = np.minimum(y[:3] * true, 1.0)
    elif not textures_only and kind < GRAIN_SHARE + LETTERING_SHARE + SPECKLE_SHARE:
        seen, mixture = speckle(rng, side)
        y[:3] = mixed(y[:3], mixture)
    if not textures_only and strays:
        alone = stray(rng, side)
        seen = alone if seen is None else seen * alone
    if seen is not None and x[3].any():  # nothing is seen of a void
        x[:3] = np.minimum(x[:3] * pull_push(torch.from_numpy(seen), torch.from_numpy(x[3])).numpy(), 1.0)
