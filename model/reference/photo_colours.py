"""Pictures coloured from posed photographs: the reference implementation of ``viewer/render/photographs``, and its constants.

Projective texture mapping (Debevec et al. 1996) with the blending of unstructured lumigraphs (Buehler et al. 2001) onto the
depth of the filled picture.  A photograph colours a pixel where (a) the surface is certain: its inverse depth is affine around
the pixel, which it is not at depth edges and thin things; (b) the photograph's pixels on the surface are finer than the points;
(c) the photograph's shadow map (Williams 1978) says that it saw the surface.  Photographs are weighted by the angle between
both viewing rays, by footprint and by the distance from their border.  A colour that disagrees with the others, the points' own
among them, loses its weight.

View frame: x right, y down, z forward.  A photograph's frame is that of ``viewer/readers/e57/e57_photographs.py`` (ASTM E2807):
pinhole looks along -z with y up, spherical and cylindrical have z up.  Lengths are file units.
"""

from dataclasses import dataclass

import numpy as np

PINHOLE, SPHERICAL, CYLINDRICAL = range(3)
BEND_AT = 2
"""Pixels to either side between which inverse depth is compared with its middle."""
BEND = 0.018
"""Second difference of inverse depth over BEND_AT pixels, relative to it, up to which a surface is certain; from twice that on
it is not.  Chosen on rendered rooms at one point in ten, like the constants below: over 0.012 it adds 0.004 and 0.003 SSIM to
filled pictures of atrium and living-room-2 (0.003 and 0.001 to neural ones); 0.024 costs atrium distance in neural ones."""
HIDDEN = 0.03
"""How much farther than the shadow map, relative to it, a surface is certainly seen; from twice that on it is hidden."""
COARSE = (1.0, 2.0)
"""Footprint of the photograph in point spacings: up to the first it is used, from the second on it is not."""
SPARSE = (8.0, 12.0)
"""Pixels between measured pixels: up to the first a filled surface is certain, from the second on it is not: inside a large
hole nothing says where the surface is."""
GRAZING = (0.1, 0.3)
"""Cosine between the photograph's ray and the normal: from the second on it is used, up to the first it is not."""
NORMAL_AT = 3
"""Pixels to either side between which the normal is measured."""
LEAST_ANGLE = 0.02
"""1 - cosine of the angle between both rays below which nearer photographs are not better: 11 degrees."""
BORDER = 0.02
"""Share of a photograph's width over which its weight falls to AT_BORDER at its border."""
AT_BORDER = 0.5
"""Where two faces of a panorama meet, both still outweigh photographs from elsewhere: with 0 a line of other colours was
seen."""
MOST = 3
"""Photographs that are blended in a pixel: the fewest of which two can outvote one."""
POINTS_VOTE = 0.2
"""Weight of the points' colour, relative to the best photograph's, in the choice of the colour that the others must agree
with."""
AGREES = 25.0
"""Difference from that colour, sRGB levels, at which a photograph's weight is a quarter."""
OVER = (0.5, 0.9)
"""Share of the photographs over the network's picture: at DENSE[0], and from DENSE[1] on.  The network has not learned from
photographs, and the errors of both are independent in part.  Of 15 views of five rooms with all points, 0.65 instead of 0.5
leaves 4, 1 and 3 worse by PSNR, SSIM and distance than without photographs, 0.5 leaves 2, 0 and 1."""
DENSE = (1.0, 1.5)
"""Pixels between measured pixels: points are as dense as pixels at the first, sparse from the second on.  Up to 2.0,
living-room-2 at one point in ten has 0.09 dB less and distance .121 in place of .118."""
APART = (10.0, 30.0)
"""Largest difference of a channel, sRGB levels, from which on photographs are given up against the network among dense points,
their means over a few blocks made equal: a mirrored thing, or a surface that they hit a pixel beside.  They are gone at the
second.  Of 60 views of five rooms with all points, (40, 80) leaves 8, 3 and 8 worse than without photographs by PSNR, SSIM and
distance, (10, 30) 3, 1 and 6, for 0.01 dB and .0004 SSIM of the mean; without equal means (40, 80) leaves 12, 3 and 10: shine
on floors lies elsewhere in a photograph than in the view."""
CONTRADICTED = (20.0, 40.0)
"""The same of means over a few blocks, however dense the points are: of detail that the points miss the mean is right, of a
person whom only the photographs hold it is not.  Persons painted into the photographs, one point in ten: living-room-2 28.2 dB,
SSIM .918 with this, 23.2, .885 without, 27.7, .892 without photographs; bathroom 19.9, .802; 17.3, .720; 19.8, .755.  Without
persons, in five cases, up to 0.13 dB are lost, at highlights, and up to .001 of SSIM."""
BLOCK = 8
"""Pixels along a side of the blocks in which measured pixels are counted."""
MOST_LEVELS = 8
"""Mip levels of a photograph."""


@dataclass(frozen=True, eq=False)
class ReferencePhoto:
    """levels: mip levels, each (h, w, 4) uint8; alpha 0 where the photograph holds nothing.  kind: PINHOLE, SPHERICAL or
    CYLINDRICAL.  lens: fx, fy, cx, cy of level 0.  around: whether the columns close a circle.  turn: (3, 3) and shift: (3,),
    view frame -> photograph's frame.  nearest: (m, n) float32, the shadow map over the whole photograph: distance of the
    nearest surface. gains: (3,) factors that bring its colours to those of the points.  presence: 0..1, below 1 while it fades
    in."""

    levels: list[np.ndarray]
    kind: int
    lens: tuple[float, float, float, float]
    around: bool
    turn: np.ndarray
    shift: np.ndarray
    nearest: np.ndarray
    gains: np.ndarray
    presence: float = 1.0


def photographed(filled: np.ndarray, depth: np.ndarray, measured: np.ndarray, lens: tuple[float, float, float, float],
                 photographs: list[ReferencePhoto]) -> tuple[np.ndarray, np.ndarray]:
    """The colours of photographs, (H, W, 3) float64 of 0..255, 0 where there are none, and their share, (H, W) 0..1.

    filled: (H, W, 4) uint8, premultiplied.  depth: (H, W) float32, view-space z, 0 where the picture is not opaque.
    measured: (H, W) bool.  lens: fx, fy, cx, cy of the picture, pixels.
    """
    height, width = depth.shape
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    base, z = filled[..., :3].astype(np.float64), depth.astype(np.float64)
    place = _places(x, y, z, lens)
    spacing = spacing_in_pixels(measured)
    certain = certainty(z) * np.clip((SPARSE[1] - spacing) / (SPARSE[1] - SPARSE[0]), 0, 1)
    right, left = np.minimum(x + NORMAL_AT, width - 1), np.maximum(x - NORMAL_AT, 0)
    below, above = np.minimum(y + NORMAL_AT, height - 1), np.maximum(y - NORMAL_AT, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = np.cross(_places(right, y, z[y, right], lens) - _places(left, y, z[y, left], lens),
                          _places(x, below, z[below, x], lens) - _places(x, above, z[above, x], lens))
        normal = normal / np.maximum(np.linalg.norm(normal, axis=-1, keepdims=True), 1e-30)
        view = place / np.linalg.norm(place, axis=-1, keepdims=True)
        each = [_seen(photo, place, view, normal, certain, spacing, lens[0]) for photo in photographs]
    confidence, weight, colour = (np.stack([one[k] for one in each]) for k in range(3))
    best = np.argsort(-weight, axis=0, kind="stable")[:MOST]
    confidence, weight = np.take_along_axis(confidence, best, 0), np.take_along_axis(weight, best, 0)
    colour = np.take_along_axis(colour, best[..., None], 0)
    holds = colour[..., 3] > 254.5
    confidence, weight, colour = np.where(holds, confidence, 0.0), np.where(holds, weight, 0.0), colour[..., :3]
    weight = weight * _votes(colour, weight, base)
    total = weight.sum(0)
    share = np.where(total > 0, confidence.max(0), 0.0)
    mean = np.clip((weight[..., None] * colour).sum(0) / np.maximum(total, 1e-30)[..., None], 0, 255)
    return mean, share


def over_filled(filled: np.ndarray, photo: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The filled picture with the colours of photographs over it, (H, W, 3) float64 of 0..255, and how much of each pixel is
    from them, (H, W) 0..1.  filled: (H, W, 3) of 0..255.  photo, share: of :func:`photographed`."""
    counts = share * _uncontradicted(_mean_apart(filled, photo, share))
    return filled + (photo - filled) * counts[..., None], counts


def over_network(network: np.ndarray, photo: np.ndarray, share: np.ndarray, spacing: np.ndarray
                 ) -> tuple[np.ndarray, np.ndarray]:
    """The network's picture with the colours of photographs over it, (H, W, 3) float64 of 0..255, and how much of each pixel is
    from them, (H, W) 0..1.  Among dense points they give detail only: their mean over a few blocks is that of the network.

    network: (H, W, 3) of 0..255, made without photographs.  photo, share: their colours and share, of :func:`photographed`.
    spacing: of :func:`spacing_in_pixels`.
    """
    height, width = share.shape
    padded = np.pad(share, 1, mode="edge")  # the border of a share is softened: ragged ones are seen
    soft = np.mean([padded[j : j + height, i : i + width] for j in range(3) for i in range(3)], axis=0)
    sparse = np.clip((spacing - DENSE[0]) / (DENSE[1] - DENSE[0]), 0, 1)
    mean = _mean_apart(network, photo, share)
    seen = np.clip(photo - mean * (1 - sparse)[..., None], 0, 255)
    apart = np.abs(seen - network).max(-1)
    agree = np.clip((APART[1] - apart) / (APART[1] - APART[0]), 0, 1)
    counts = np.where(share > 0, soft, 0.0) * (OVER[0] + (OVER[1] - OVER[0]) * sparse) * (agree + (1 - agree) * sparse)
    counts = counts * _uncontradicted(mean)
    return network + (seen - network) * counts[..., None], counts


def _mean_apart(under: np.ndarray, photo: np.ndarray, share: np.ndarray) -> np.ndarray:
    """(H, W, 3) of 0..255: how far photographs differ, on average around, from what they come over."""
    sums = _blocks(np.concatenate([(photo - under) * share[..., None], share[..., None]], axis=-1))
    around = between_blocks(sums, share.shape)
    return around[..., :3] / np.maximum(around[..., 3:], 1e-6)


def _uncontradicted(mean: np.ndarray) -> np.ndarray:
    """(H, W) 0..1: 0 where photographs differ by CONTRADICTED, on average around, from what they come over."""
    return np.clip((CONTRADICTED[1] - np.abs(mean).max(-1)) / (CONTRADICTED[1] - CONTRADICTED[0]), 0, 1)


def _blocks(picture: np.ndarray) -> np.ndarray:
    """Sums over blocks of BLOCK x BLOCK pixels, (rows, columns, C), of a picture (H, W, C)."""
    height, width, channels = picture.shape
    rows, columns = -(-height // BLOCK), -(-width // BLOCK)
    padded = np.zeros((rows * BLOCK, columns * BLOCK, channels))
    padded[:height, :width] = picture
    return padded.reshape(rows, BLOCK, columns, BLOCK, channels).sum((1, 3))


def between_blocks(grid: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Values of blocks, (rows, columns, C), at the pixels of a picture, (height, width, C): bilinear between the middles."""
    (height, width), (rows, columns) = size, grid.shape[:2]
    at_y, at_x = ((np.arange(n) + 0.5) / BLOCK - 0.5 for n in (height, width))
    top, left = np.floor(at_y).astype(int), np.floor(at_x).astype(int)
    t, s = (at_y - top)[:, None, None], (at_x - left)[None, :, None]
    first, second = (np.clip(top + k, 0, rows - 1)[:, None] for k in (0, 1))
    one, two = (np.clip(left + k, 0, columns - 1)[None] for k in (0, 1))
    upper, lower = (grid[row, one] * (1 - s) + grid[row, two] * s for row in (first, second))
    return upper * (1 - t) + lower * t


def certainty(z: np.ndarray) -> np.ndarray:
    """(H, W) 0..1: whether the surface at a pixel is certain: the least of 3 x 3 pixels' affinity of inverse depth."""
    height, width = z.shape
    y, x = np.mgrid[:height, :width]
    inverse = np.divide(1.0, z, out=np.zeros_like(z), where=z > 0)
    bend = np.zeros_like(z)
    for across, down in ((1, 0), (0, 1), (1, 1), (1, -1)):
        one, other = (inverse[np.clip(y + s * down * BEND_AT, 0, height - 1), np.clip(x + s * across * BEND_AT, 0, width - 1)]
                      for s in (-1, 1))
        bend = np.maximum(bend, np.abs(one + other - 2 * inverse))
    with np.errstate(divide="ignore", invalid="ignore"):
        sure = np.where(z > 0, np.clip(2 - bend / (BEND * inverse), 0, 1), 0.0)
    padded = np.pad(sure, 1, mode="edge")
    return np.min([padded[j : j + height, i : i + width] for j in range(3) for i in range(3)], axis=0)


def spacing_in_pixels(measured: np.ndarray) -> np.ndarray:
    """(H, W) pixels between measured pixels around each pixel, >= 1: from their share of 3 x 3 blocks, between blocks
    bilinear."""
    height, width = measured.shape
    rows, columns = -(-height // BLOCK), -(-width // BLOCK)
    counts, pixels = np.moveaxis(np.pad(_blocks(np.stack([measured, np.ones_like(measured)], -1)), ((1, 1), (1, 1), (0, 0))),
                                 -1, 0)
    counts, pixels = (sum(a[j : j + rows, i : i + columns] for j in range(3) for i in range(3)) for a in (counts, pixels))
    return between_blocks(np.sqrt(pixels / np.maximum(counts, 1.0))[..., None], (height, width))[..., 0]


def _places(x, y, z, lens) -> np.ndarray:
    """(..., 3) view-space places of pixels' centres at depth z."""
    return np.stack([(x + 0.5 - lens[2]) / lens[0] * z, (y + 0.5 - lens[3]) / lens[1] * z, z], axis=-1)


def projected(photo: ReferencePhoto, place: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Column and row in a photograph, and whether it shows them, of places (..., 3) in its own frame."""
    x, y, z = np.moveaxis(place, -1, 0)
    fx, fy, cx, cy = photo.lens
    height, width = photo.levels[0].shape[:2]
    flat = np.hypot(x, y)
    if photo.kind == PINHOLE:
        column, row, seen = cx - x / z * fx, cy + y / z * fy, z < 0
    else:
        rise = np.arctan2(z, flat) if photo.kind == SPHERICAL else z / flat
        column, row, seen = cx - np.arctan2(y, x) * fx, cy - rise * fy, flat > 0
        column = np.mod(column, width) if photo.around else column
    return column, row, seen & (column >= 0) & (column < width) & (row >= 0) & (row < height)


def _seen(photo: ReferencePhoto, place, view, normal, certain, spacing, focal):
    """Confidence, weight and colour (H, W, 4) of one photograph at each pixel; alpha 255 where it holds anything."""
    there = place @ photo.turn.T + photo.shift
    column, row, seen = projected(photo, there)
    seen &= (certain > 0) & (place[..., 2] > 0)
    column, row = np.where(seen, column, 0.0), np.where(seen, row, 0.0)
    distance = np.linalg.norm(there, axis=-1)
    height, width = photo.levels[0].shape[:2]
    rows, columns = photo.nearest.shape
    nearest = photo.nearest[np.minimum((row * (rows / height)).astype(int), rows - 1),
                            np.minimum((column * (columns / width)).astype(int), columns - 1)]
    visible = np.clip(2 - (distance / nearest - 1) / HIDDEN, 0, 1)
    footprint = distance / photo.lens[0] * focal / place[..., 2]
    fine = np.clip((COARSE[1] - footprint / spacing) / (COARSE[1] - COARSE[0]), 0, 1)
    ray = there @ photo.turn / distance[..., None]
    facing = np.abs((ray * normal).sum(-1))
    steep = np.clip((facing - GRAZING[0]) / (GRAZING[1] - GRAZING[0]), 0, 1)
    confidence = certain * visible * fine * steep * photo.presence
    border = np.minimum(row, height - row) if photo.around else np.minimum(np.minimum(column, width - column),
                                                                           np.minimum(row, height - row))
    apart = 1 - np.clip((ray * view).sum(-1), -1, 1)
    inner = AT_BORDER + (1 - AT_BORDER) * np.clip(border / (BORDER * width), 0, 1)
    weight = confidence * facing / ((LEAST_ANGLE + apart) * footprint) * inner
    seen &= weight > 0
    level = np.where(seen, np.clip(np.floor(np.log2(1 / np.where(seen, footprint, 1.0)) + 0.5), 0, len(photo.levels) - 1), 0)
    colour = np.zeros((*certain.shape, 4))
    for number, picture in enumerate(photo.levels):
        here = level == number
        colour[here] = sampled(picture, column[here], row[here], photo)
    return np.where(seen, confidence, 0.0), np.where(seen, weight, 0.0), colour * [*photo.gains, 1.0]


def sampled(picture: np.ndarray, column: np.ndarray, row: np.ndarray, photo: ReferencePhoto) -> np.ndarray:
    """(n, 4) bilinear samples of a mip level at places of level 0."""
    height, width = picture.shape[:2]
    whole = photo.levels[0].shape
    a, b = column * (width / whole[1]) - 0.5, row * (height / whole[0]) - 0.5
    left, top = np.floor(a).astype(int), np.floor(b).astype(int)
    s, t = (a - left)[:, None], (b - top)[:, None]
    columns = [np.mod(left + k, width) if photo.around else np.clip(left + k, 0, width - 1) for k in (0, 1)]
    rows = [np.clip(top + k, 0, height - 1) for k in (0, 1)]
    upper, lower = (picture[r, columns[0]] * (1 - s) + picture[r, columns[1]] * s for r in rows)
    return upper * (1 - t) + lower * t


def _votes(colour: np.ndarray, weight: np.ndarray, base: np.ndarray) -> np.ndarray:
    """(K, H, W) 0..1: how far each photograph agrees with the candidate that the others are nearest to (a weighted medoid)."""
    candidates = np.concatenate([colour, base[None]])
    weights = np.concatenate([weight, POINTS_VOTE * weight.max(0)[None]])
    cost = np.stack([(weights * np.abs(candidates - one).sum(-1)).sum(0) for one in candidates])
    middle = np.argmin(np.where(weights > 0, cost, np.inf), axis=0)
    chosen = np.take_along_axis(candidates, middle[None, ..., None], 0)[0]
    apart = np.abs(colour - chosen).max(-1) / AGREES
    return 1 / np.square(1 + np.square(apart))
