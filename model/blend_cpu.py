"""The last part of the compact network, on a CPU: blends, correction and packing in one compiled loop over rows.

What :meth:`model.unet.CompactUNet._blend` says in a dozen torch calls, each of which reads and writes the whole picture, is
done here row by row: each blur follows the one before it as far behind as it reaches, so that of every step only the few
rows that the next one looks at are kept, in the processor's cache.  Rows are shared out to threads; no result depends on how
many.  Planes lie one after the other, so that the inner loops run along a row in vector instructions.
"""

import itertools
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from torch import Tensor

from model.compiled import compiled
from model.unet import (
    BLENDS,
    CONTRAST_AT,
    DARK,
    FILLED_WEIGHT,
    HALF_BAND,
    LEAST_CONTRAST,
    LUMA,
    MEAN_BLOCK,
    NOISE,
    SPARSE,
)

CLOSED = 5  # channel of the packed input: 1 in a direction that the scan surrounds, where nothing can be void
_RED, _GREEN, _BLUE = LUMA
_OUTER, _BESIDE, _MIDDLE = HALF_BAND[:3]
_F = np.float32
_LEAST_ROWS = 32
"""Of a thread, since 15 above and below them are blurred too."""


@compiled(nogil=True)
def _weigh_row(packed, sums, out):
    """A row of the sums to be blurred (>= 4, W), from packed (W, 8) float32; out (3, W) begins as the picture."""
    for x in range(packed.shape[0]):
        red, green, blue = packed[x, 0], packed[x, 1], packed[x, 2]
        weight = packed[x, 3] * _F(1.0 - FILLED_WEIGHT) + _F(FILLED_WEIGHT)
        out[0, x], out[1, x], out[2, x] = red, green, blue
        sums[0, x], sums[1, x], sums[2, x], sums[3, x] = red * weight, green * weight, blue * weight, weight


@compiled(nogil=True)
def _guide_row(blocks, block, channel, y, row):
    """One row of a channel of the network's blocks (h, w, channels * block**2), as pixels; row: (w * block,)."""
    base, line = channel * block * block + (y % block) * block, blocks[y // block]
    for u in range(len(line)):
        for j in range(block):
            row[u * block + j] = line[u, base + j]


@compiled(nogil=True)
def _blur_row(above, here, below, reach, line, row):
    """The 3x3 binomial blur at a dilation of one row (W,) of a plane, edges repeated; line: scratch, (W + 2 reach,)."""
    width = len(here)
    middle, left, right = line[reach : reach + width], line[:width], line[2 * reach : 2 * reach + width]
    for x in range(width):
        middle[x] = _F(0.25) * (above[x] + below[x]) + _F(0.5) * here[x]
    line[:reach], line[reach + width : 2 * reach + width] = middle[0], middle[width - 1]
    for x in range(width):  # slices, not offsets: an index that might be negative would keep it from vector instructions
        row[x] = _F(0.25) * (left[x] + right[x]) + _F(0.5) * middle[x]


@compiled(nogil=True)
def _blend_row(sharp, smooth, share, out):
    """The picture out (3, W) blended, by share (W,), from one blur's sums (>= 4, W) towards the next one's."""
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
def _square_row(sums):
    """The fifth of the sums (5, W): the light's square, by the same weight as the others."""
    red, green, blue, weight, square = sums[0], sums[1], sums[2], sums[3], sums[4]
    for x in range(len(red)):
        light = _F(_RED) * red[x] + _F(_GREEN) * green[x] + _F(_BLUE) * blue[x]
        square[x] = light * light / weight[x]


@compiled(nogil=True)
def _contrast_row(sums, bounds):
    """How much the correction may change, and how much was measured: bounds (2, W), from sums (5, W)."""
    red, green, blue, weight, square = sums[0], sums[1], sums[2], sums[3], sums[4]
    limit, density = bounds[0], bounds[1]
    for x in range(len(red)):
        light = (_F(_RED) * red[x] + _F(_GREEN) * green[x] + _F(_BLUE) * blue[x]) / weight[x]
        variance = max(square[x] / weight[x] - light * light, _F(0.0))
        limit[x] = np.sqrt(variance) * variance / (variance + _F(NOISE**2)) + _F(LEAST_CONTRAST)
        density[x] = (weight[x] - _F(FILLED_WEIGHT)) / _F(1.0 - FILLED_WEIGHT)


@compiled(inline="always")
def _held(place, block, size):
    """Where a place beyond the picture's ``size`` is taken from: the last block, the same corner of it where there is one."""
    return min(min(place // block, (size - 1) // block) * block + place % block, size - 1)


@compiled(nogil=True)
def _means(blocks, block, height, width, means, first, last):
    """Means of the first channel over squares of MEAN_BLOCK pixels, for each corner of the blocks by itself, edges repeated.

    means: (rows, block**2, columns), rows ``first`` to ``last`` are made.
    """
    row = np.empty(blocks.shape[1] * block, np.float32)
    for v in range(first, last):
        means[v] = 0.0
        for y in range(v * MEAN_BLOCK, (v + 1) * MEAN_BLOCK):
            _guide_row(blocks, block, 0, _held(y, block, height), row)
            corner = (y % block) * block
            for x in range(means.shape[2] * MEAN_BLOCK):
                means[v, corner + x % block, x // MEAN_BLOCK] += row[x if x < width else _held(x, block, width)]
        for corner in range(block * block):
            for u in range(means.shape[2]):
                means[v, corner, u] *= _F(block * block / (MEAN_BLOCK * MEAN_BLOCK))


@compiled(nogil=True, inline="always")
def _tanh(x):
    """To 4e-7: Eigen's rational approximation, which loops of vector instructions can hold and a library's call cannot."""
    x = min(max(x, _F(-7.9)), _F(7.9))
    s = x * x
    above = _F(-2.76076847742355e-16) * s + _F(2.00018790482477e-13)
    above = (above * s + _F(-8.60467152213735e-11)) * s + _F(5.12229709037114e-08)
    above = ((above * s + _F(1.48572235717979e-05)) * s + _F(6.37261928875436e-04)) * s + _F(4.89352455891786e-03)
    below = (_F(1.19825839466702e-06) * s + _F(1.18534705686654e-04)) * s + _F(2.26843463243900e-03)
    return x * above / (below * s + _F(4.89352518554385e-03))


@compiled(nogil=True, inline="always")
def _unit(value):
    return min(max(value, _F(0.0)), _F(1.0)) if value == value else _F(0.0)  # NaN is not equal to itself


@compiled(nogil=True)
def _between(block, columns, left, share):
    """Between which squares each block of a row lies, left and the next, and how far on the way; left, share: (blocks,)."""
    for b in range(len(left)):
        place = max((b + 0.5) / (MEAN_BLOCK // block) - 0.5, 0.0)
        left[b] = int(place)
        share[b] = place - left[b] if left[b] + 1 < columns else 0.0


@compiled(nogil=True)
def _mean_row(means, block, y, left, share, column, row):
    """The means at one row of pixels, interpolated between the squares' middles.  left, share: from _between.  column: scratch,
    (block, columns + 1)."""
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
def _half_band_row(rows, y, height, line, row):
    """Row y of a channel without its mesh (model.unet.without_mesh), edges repeated.  rows: (5, W), row k of the channel in
    k % 5.  line: scratch, (W + 4,)."""
    width = len(row)
    a, b, c = rows[max(y - 2, 0) % 5], rows[max(y - 1, 0) % 5], rows[y % 5]
    d, e = rows[min(y + 1, height - 1) % 5], rows[min(y + 2, height - 1) % 5]
    middle = line[2 : 2 + width]
    for x in range(width):
        middle[x] = _F(_MIDDLE) * c[x] + _F(_BESIDE) * (b[x] + d[x]) + _F(_OUTER) * (a[x] + e[x])
    line[:2], line[2 + width : 4 + width] = middle[0], middle[width - 1]
    a, b, d, e = line[:width], line[1 : 1 + width], line[3 : 3 + width], line[4 : 4 + width]
    for x in range(width):
        row[x] = _F(_MIDDLE) * middle[x] + _F(_BESIDE) * (b[x] + d[x]) + _F(_OUTER) * (a[x] + e[x])


@compiled(nogil=True)
def _finish_row(packed, out, light, cover, bounds, made):
    """The correction of the light, and the coverage: made (W, 4) float32, 0..1, never NaN.

    light, cover: (W,) correction, which is overwritten, and coverage less 1.
    """
    bound, dense = bounds[0], bounds[1]
    red, green, blue = out[0], out[1], out[2]
    for x in range(len(light)):
        change = bound[x] * _tanh(light[x] / bound[x]) * min(max(dense[x] / _F(SPARSE), _F(0.0)), _F(1.0))
        light[x] = _F(1.0) + change / max(_F(_RED) * red[x] + _F(_GREEN) * green[x] + _F(_BLUE) * blue[x], _F(DARK))
    for x in range(len(light)):
        made[x, 0], made[x, 1] = _unit(red[x] * light[x]), _unit(green[x] * light[x])
        made[x, 2] = _unit(blue[x] * light[x])
        made[x, 3] = max(_unit(_F(1.0) + cover[x]), packed[x, CLOSED])


@compiled(nogil=True)
def _make(packed, blocks, block, means, made, first, last):
    """Rows ``first`` to ``last`` of the picture, made (H, W, 4).

    Blur k looks 2**k rows up and down, so its row y is had 2**(k + 1) - 1 rows after row y of the picture; of the sums that
    it looks at 2 * 2**k + 1 rows are kept, of the picture being blended all that are on their way.
    """
    height, width = packed.shape[0], packed.shape[1]
    behind = 2**BLENDS - 1
    kept = np.empty((2 ** (BLENDS + 1) - 2 + BLENDS, 5, width), np.float32)  # of blur k from row 2**(k + 1) - 2 + k
    out, bounds = np.empty((behind + 1, 3, width), np.float32), np.empty((behind + 1, 2, width), np.float32)
    smoothest, line = np.empty((5, width), np.float32), np.empty(width + 2 ** (BLENDS + 1), np.float32)
    whole, row_of = np.empty(blocks.shape[1] * block, np.float32), np.empty(width, np.float32)
    said = np.empty((1 + BLENDS, 5, width), np.float32)  # the last rows of the network's channels, of each up to row had
    had = np.full(1 + BLENDS, max(first - 2, 0))
    around, column = np.empty(width, np.float32), np.zeros((block, means.shape[2] + 1), np.float32)
    left, part = np.empty(blocks.shape[1], np.int32), np.empty(blocks.shape[1], np.float32)
    _between(block, means.shape[2], left, part)
    for row in range(max(first - behind, 0), last + behind):
        if row < height:
            _weigh_row(packed[row], kept[row % 3], out[row % (behind + 1)])
        for number in range(BLENDS):
            reach, late = 2**number, 2 ** (number + 1) - 1
            y = row - late
            if y < max(first - (behind - late), 0) or y >= min(last + behind - late, height):
                continue
            rows, begin = 2 * reach + 1, 2 * reach - 2 + number
            here = kept[begin + y % rows]
            above, below = kept[begin + max(y - reach, 0) % rows], kept[begin + min(y + reach, height - 1) % rows]
            smooth = smoothest
            if number + 1 < BLENDS:
                smooth = kept[begin + rows + y % (4 * reach + 1)]
            for plane in range(5 if number == CONTRAST_AT else 4):
                _blur_row(above[plane], here[plane], below[plane], reach, line, smooth[plane])
            if number + 1 == CONTRAST_AT:
                _square_row(smooth)
            if y < first or y >= last:
                continue
            place = y % (behind + 1)
            channel = 1 + number
            while had[channel] < min(y + 3, height):
                _guide_row(blocks, block, channel, had[channel], whole)
                said[channel, had[channel] % 5] = whole[:width]
                had[channel] += 1
            _half_band_row(said[channel], y, height, line, row_of)
            _blend_row(here, smooth, row_of, out[place])
            if number == CONTRAST_AT:
                _contrast_row(smooth, bounds[place])
            if number + 1 == BLENDS:
                while had[0] < min(y + 3, height):
                    _guide_row(blocks, block, 0, had[0], whole)
                    _mean_row(means, block, had[0], left, part, column, around)
                    np.subtract(whole[:width], around, said[0, had[0] % 5])
                    had[0] += 1
                _half_band_row(said[0], y, height, line, row_of)
                _guide_row(blocks, block, 1 + BLENDS, y, whole)
                _finish_row(packed[y], out[place], row_of, whole[:width], bounds[place], made[y])


class Blender:
    """The loop on ``threads`` threads; its arrays are kept from picture to picture.  Safe to call from any thread."""

    def __init__(self, threads: int):
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads, "blend")
        self._lock = threading.Lock()
        self._made = np.empty(0, np.float32)
        self._floats: dict[str, np.ndarray] = {}

    def __call__(self, packed: Tensor, blocks: Tensor, block: int) -> Tensor:
        """(H, W, 4) half, RGB and coverage 0..1.

        packed: (H, W, 8) as in model.reconstruct.  blocks: (h, w, (2 + BLENDS) * block**2), the network's head before its
        blocks become pixels, at least as large as the picture.  Both of any precision, on the CPU.
        """
        with self._lock:  # until the result is the caller's own: the next call overwrites what is here
            made = self.made(self._float32("packed", packed), self._float32("blocks", blocks), block)
            return torch.from_numpy(made).half()

    def _float32(self, name: str, given: Tensor) -> np.ndarray:
        """In float32, in an array kept under ``name``: memory that is new in every picture costs more than the conversion."""
        if given.dtype == torch.float32 and given.is_contiguous():
            return given.numpy()
        kept = self._floats.get(name)
        if kept is None or len(kept) < given.numel():
            kept = self._floats[name] = np.empty(given.numel(), np.float32)
        kept = kept[: given.numel()].reshape(given.shape)
        torch.from_numpy(kept).copy_(given)
        return kept

    def made(self, packed: np.ndarray, blocks: np.ndarray, block: int) -> np.ndarray:
        """The same from float32 in float32, overwritten by the next call, and for one thread at a time."""
        height, width = packed.shape[:2]
        if self._made.size < height * width * 4:
            self._made = np.empty(height * width * 4, np.float32)
        made = self._made[: height * width * 4].reshape(height, width, 4)
        means = np.empty((-(-height // MEAN_BLOCK), block * block, -(-width // MEAN_BLOCK)), np.float32)
        self._rows(len(means), 1, _means, blocks, block, height, width, means)
        self._rows(height, _LEAST_ROWS, _make, packed, blocks, block, means, made)
        return made

    def _rows(self, height: int, least: int, work, *arguments) -> None:
        """Shares rows out to the threads, at least ``least`` to one."""
        parts = max(1, min(self._threads, height // least))
        edges = [height * i // parts for i in range(parts + 1)]
        jobs = [self._pool.submit(work, *arguments, a, b) for a, b in itertools.pairwise(edges) if b > a]
        for job in jobs:
            job.result()
