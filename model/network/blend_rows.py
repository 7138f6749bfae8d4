"""Compiled loops over one row of the compact network's last part, called by ``model/network/blend_cpu.py``.

Each function computes one row of one step of :meth:`model.network.unet.CompactUNet._blend`, its reference implementation.
Arrays are planar, so that the loops along a row are vectorised.
"""

import numpy as np

from ..common.jit import compiled
from .network_layout import CLOSED, NOISE_SCALE
from .unet import FILLED_WEIGHT, HALF_BAND, KEPT_DEVIATIONS, LEAST_CONTRAST, LEAST_LUMINANCE, LUMA, MEAN_BLOCK, NOISE

_RED, _GREEN, _BLUE = LUMA
_OUTER, _BESIDE, _MIDDLE = HALF_BAND[:3]
_F = np.float32


@compiled(nogil=True)
def unshuffled_rows(packed, block, made, first, last):
    """Writes rows ``first`` to ``last`` of made (h, w, channels * block**2): packed (channels or more, H, W) in blocks, channel
    by channel, edges repeated."""
    height, width, channels = packed.shape[1], packed.shape[2], made.shape[2] // (block * block)
    for v in range(first, last):
        whole = 0
        if block == 2 and channels == 6 and 2 * v + 1 < height:  # the shipped networks', with numbers that the compiler knows
            whole, out = width // 2, made[v]
            for c in range(6):
                upper, lower = packed[c, 2 * v], packed[c, 2 * v + 1]
                for u in range(whole):
                    out[u, 4 * c], out[u, 4 * c + 1] = upper[2 * u], upper[2 * u + 1]
                    out[u, 4 * c + 2], out[u, 4 * c + 3] = lower[2 * u], lower[2 * u + 1]
        for c in range(channels):
            for i in range(block):
                line = packed[c, min(v * block + i, height - 1)]
                for u in range(whole, made.shape[1]):
                    for j in range(block):
                        made[v, u, (c * block + i) * block + j] = line[min(u * block + j, width - 1)]


@compiled(nogil=True)
def start_row(packed, y, sums, out):
    """Initialises row y: sums (>= 4, W), weighted colours and weight, and out (3, W), the picture.  packed: (8, H, W)."""
    measured, weight = packed[3, y], sums[3]
    for x in range(len(weight)):
        weight[x] = measured[x] * _F(1.0 - FILLED_WEIGHT) + _F(FILLED_WEIGHT)
    for plane in range(3):
        value, total, first = packed[plane, y], sums[plane], out[plane]
        for x in range(len(weight)):
            first[x] = value[x]
            total[x] = value[x] * weight[x]


@compiled(nogil=True)
def unpacked_rows(blocks, block, shift, guide, first, last):
    """Unpacks rows ``first`` to ``last`` of the network's blocks (h, w, channels * block**2) to pixels: guide (channels,
    h * block, w * block), both the bits of numbers, uint32 or, with a shift of 16, uint16 of bfloat16."""
    channels, wide = guide.shape[0], blocks.shape[1]
    for v in range(first, last):
        line = blocks[v]
        for c in range(channels):
            for i in range(block):
                row, base = guide[c, v * block + i], (c * block + i) * block
                for j in range(block):
                    for u in range(wide):
                        row[u * block + j] = np.uint32(line[u, base + j]) << np.uint32(shift)


@compiled(nogil=True)
def blur_row(above, here, below, reach, line, row):
    """3x3 binomial blur of one row (W,) of a plane at dilation ``reach``, edges repeated.  line: scratch, (W + 2 reach,)."""
    width = len(here)
    middle, left, right = line[reach : reach + width], line[:width], line[2 * reach : 2 * reach + width]
    for x in range(width):
        middle[x] = _F(0.25) * (above[x] + below[x]) + _F(0.5) * here[x]
    line[:reach], line[reach + width : 2 * reach + width] = middle[0], middle[width - 1]
    for x in range(width):  # slices instead of offsets: an index that may be negative prevents vectorisation
        row[x] = _F(0.25) * (left[x] + right[x]) + _F(0.5) * middle[x]


@compiled(nogil=True)
def blend_row(sharp, smooth, share, out):
    """Blends the picture out (3, W) by share (W,) from one blur's sums ``sharp`` (>= 4, W) towards those of the next."""
    red, green, blue, weight = smooth[0], smooth[1], smooth[2], smooth[3]
    red_before, green_before, blue_before, weight_before = sharp[0], sharp[1], sharp[2], sharp[3]
    out_red, out_green, out_blue = out[0], out[1], out[2]
    for x in range(len(share)):
        part = min(max(share[x], _F(0.0)), _F(1.0))
        now, before = part / weight[x], part / weight_before[x]
        out_red[x] += now * red[x] - before * red_before[x]
        out_green[x] += now * green[x] - before * green_before[x]
        out_blue[x] += now * blue[x] - before * blue_before[x]


@compiled(nogil=True)
def allow_row(packed, y, smooth, allowed):
    """Sets by how much the final picture may differ from the filled one: allowed (3, W).

    packed: (8, H, W).  smooth: (>= 4, W), sums of the first blur.
    """
    weight, level, confidence = smooth[3], packed[5, y], packed[3, y]
    for plane in range(3):
        value, total, made = packed[plane, y], smooth[plane], allowed[plane]
        for x in range(len(weight)):
            noise, measured = _F(KEPT_DEVIATIONS / NOISE_SCALE) * level[x], confidence[x]
            part = _F(1.0) / measured if measured > _F(0.0) else _F(0.0)
            least = _F(0.0) if measured > _F(0.0) else _F(1.0)
            made[x] = (noise + abs(value[x] - total[x] / weight[x])) * part + least


@compiled(nogil=True)
def square_row(sums):
    """Sets the fifth row of sums (5, W): the weighted square of luminance."""
    red, green, blue, weight, square = sums[0], sums[1], sums[2], sums[3], sums[4]
    for x in range(len(red)):
        light = _F(_RED) * red[x] + _F(_GREEN) * green[x] + _F(_BLUE) * blue[x]
        square[x] = light * light / weight[x]


@compiled(nogil=True)
def contrast_row(sums, limit):
    """Bound of the correction of luminance, limit (W,), from sums (5, W)."""
    red, green, blue, weight, square = sums[0], sums[1], sums[2], sums[3], sums[4]
    for x in range(len(red)):
        light = (_F(_RED) * red[x] + _F(_GREEN) * green[x] + _F(_BLUE) * blue[x]) / weight[x]
        variance = max(square[x] / weight[x] - light * light, _F(0.0))
        limit[x] = np.sqrt(variance) * variance / (variance + _F(NOISE**2)) + _F(LEAST_CONTRAST)


@compiled(inline="always")
def _held(place, block, size):
    """Coordinate that replaces one beyond the picture: the same corner of the last block, or the last pixel."""
    return min(min(place // block, (size - 1) // block) * block + place % block, size - 1)


@compiled(nogil=True)
def square_means(guide, block, height, width, means, first, last):
    """Means of a channel (H, W) over squares of MEAN_BLOCK pixels, separately for each corner of a block, edges repeated.

    height, width: of the picture, which may be smaller.  means: (rows, block**2, columns), of which rows ``first`` to ``last``
    are written.
    """
    columns = means.shape[2]
    row = np.empty(columns * MEAN_BLOCK, np.float32)
    for v in range(first, last):
        means[v] = 0.0
        for y in range(v * MEAN_BLOCK, (v + 1) * MEAN_BLOCK):
            row[:width] = guide[_held(y, block, height), :width]
            for x in range(width, len(row)):
                row[x] = row[_held(x, block, width)]
            corner = (y % block) * block
            for x in range(MEAN_BLOCK):
                made = means[v, corner + x % block]
                for u in range(columns):  # of one pixel of each square, so that each mean is summed in the order of its pixels
                    made[u] += row[u * MEAN_BLOCK + x]
        for corner in range(block * block):
            for u in range(columns):
                means[v, corner, u] *= _F(block * block / (MEAN_BLOCK * MEAN_BLOCK))


@compiled(nogil=True, inline="always")
def tanh(x):
    """Hyperbolic tangent to 4e-7: Eigen's rational approximation, which is vectorised, unlike a call of the C library."""
    x = min(max(x, _F(-7.9)), _F(7.9))
    s = x * x
    above = _F(-2.76076847742355e-16) * s + _F(2.00018790482477e-13)
    above = (above * s + _F(-8.60467152213735e-11)) * s + _F(5.12229709037114e-08)
    above = ((above * s + _F(1.48572235717979e-05)) * s + _F(6.37261928875436e-04)) * s + _F(4.89352455891786e-03)
    below = (_F(1.19825839466702e-06) * s + _F(1.18534705686654e-04)) * s + _F(2.26843463243900e-03)
    return x * above / (below * s + _F(4.89352518554385e-03))


@compiled(nogil=True, inline="always")
def _unit(value):
    return min(max(value, _F(0.0)), _F(1.0)) if value == value else _F(0.0)  # NaN becomes 0


@compiled(nogil=True, inline="always")
def _kept(value, measured, allowed):
    return measured + min(max(value - measured, -allowed), allowed)


@compiled(nogil=True)
def between(block, columns, left, share):
    """Interpolation along a row: left (blocks,), square whose centre is left of each block; share (blocks,) of the next."""
    for b in range(len(left)):
        place = max((b + 0.5) / (MEAN_BLOCK // block) - 0.5, 0.0)
        left[b] = int(place)
        share[b] = place - left[b] if left[b] + 1 < columns else 0.0


@compiled(nogil=True)
def mean_row(means, block, y, left, share, column, row):
    """Means of one row of pixels, interpolated between the squares' centres.

    left, share: of :func:`between`.  column: scratch, (block, columns + 1).
    """
    across = MEAN_BLOCK // block  # blocks in a square
    place = max((y // block + 0.5) / across - 0.5, 0.0)
    v, first = int(place), (y % block) * block
    below = min(v + 1, means.shape[0] - 1)
    for corner in range(block):
        line = column[corner]
        for u in range(means.shape[2]):
            above = means[v, first + corner, u]
            line[u] = above + _F(place - v) * (means[below, first + corner, u] - above)
        for b in range((len(row) - corner + block - 1) // block):
            u = left[b]
            row[b * block + corner] = line[u] + share[b] * (line[u + 1] - line[u])


@compiled(nogil=True)
def half_band_row(channel, y, height, line, row):
    """Row y of a channel without its pixel-frequency pattern (model.network.unet.without_mesh), edges repeated.

    channel: (H, W or more).  line: scratch, (W + 4,).
    """
    width = len(row)
    a, b, c = channel[max(y - 2, 0)], channel[max(y - 1, 0)], channel[y]
    d, e = channel[min(y + 1, height - 1)], channel[min(y + 2, height - 1)]
    middle = line[2 : 2 + width]
    for x in range(width):
        middle[x] = _F(_MIDDLE) * c[x] + _F(_BESIDE) * (b[x] + d[x]) + _F(_OUTER) * (a[x] + e[x])
    line[:2], line[2 + width : 4 + width] = middle[0], middle[width - 1]
    a, b, d, e = line[:width], line[1 : 1 + width], line[3 : 3 + width], line[4 : 4 + width]
    for x in range(width):
        row[x] = _F(_MIDDLE) * middle[x] + _F(_BESIDE) * (b[x] + d[x]) + _F(_OUTER) * (a[x] + e[x])


@compiled(nogil=True)
def finish_row(packed, y, out, light, cover, limit, allowed, made):
    """Corrects luminance, keeps what was measured, and sets coverage of row y: made (W, 4) float32, 0..1, never NaN.

    packed: (8, H, W).
    light, cover, limit: (W,) correction, which is overwritten, coverage less 1, and bound of the correction.  allowed: (3, W),
    largest difference from the filled picture.
    """
    red, green, blue = out[0], out[1], out[2]
    of_red, of_green, of_blue = allowed[0], allowed[1], allowed[2]
    for x in range(len(light)):
        change = limit[x] * tanh(light[x] / limit[x])
        luma = _F(_RED) * red[x] + _F(_GREEN) * green[x] + _F(_BLUE) * blue[x]
        light[x] = _F(1.0) + change / max(luma, _F(LEAST_LUMINANCE))
    given_red, given_green, given_blue, closed = packed[0, y], packed[1, y], packed[2, y], packed[CLOSED, y]
    for x in range(len(light)):
        made[x, 0] = _unit(_kept(red[x] * light[x], given_red[x], of_red[x]))
        made[x, 1] = _unit(_kept(green[x] * light[x], given_green[x], of_green[x]))
        made[x, 2] = _unit(_kept(blue[x] * light[x], given_blue[x], of_blue[x]))
        made[x, 3] = max(_unit(_F(1.0) + cover[x]), closed[x])
