"""The last part of the compact network, on a CPU: blends, correction and packing in compiled loops over rows.

What :meth:`model.unet.CompactUNet._blend` says in a dozen torch calls, each of which reads and writes the whole picture, is
done here in five passes: each blur and all that needs it go together.  Rows are shared out to threads; no result depends on
how many.  Planes lie one after the other, so that the inner loops run along a row in vector instructions.
"""

import itertools
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from torch import Tensor

from model.compiled import compiled
from model.unet import BLENDS, CONTRAST_AT, DARK, FILLED_WEIGHT, LEAST_CONTRAST, LUMA, MEAN_BLOCK, SPARSE

CLOSED = 5  # channel of the packed input: 1 in a direction that the scan surrounds, where nothing can be void
_PLANES = 5  # sums of red, green, blue, weight, and squared light
_RED, _GREEN, _BLUE = LUMA
_F = np.float32


@compiled(nogil=True)
def _weigh(packed, sums, out, first, last):
    """Rows of the sums to be blurred, from packed (H, W, 8) float32; out (3, H, W) begins as the picture."""
    for y in range(first, last):
        for x in range(packed.shape[1]):
            red, green, blue = packed[y, x, 0], packed[y, x, 1], packed[y, x, 2]
            weight = packed[y, x, 3] * _F(1.0 - FILLED_WEIGHT) + _F(FILLED_WEIGHT)
            light = _F(_RED) * red + _F(_GREEN) * green + _F(_BLUE) * blue
            out[0, y, x], out[1, y, x], out[2, y, x] = red, green, blue
            sums[0, y, x], sums[1, y, x], sums[2, y, x] = red * weight, green * weight, blue * weight
            sums[3, y, x], sums[4, y, x] = weight, weight * light * light


@compiled(nogil=True)
def _guide_row(blocks, block, channel, y, row):
    """One row of a channel of the network's blocks (h, w, channels * block**2), as pixels; row: (w * block,)."""
    base, line = channel * block * block + (y % block) * block, blocks[y // block]
    for u in range(len(line)):
        for j in range(block):
            row[u * block + j] = line[u, base + j]


@compiled(nogil=True)
def _blur_row(source, y, reach, line, row):
    """The 3x3 binomial blur at a dilation of one row of a plane (H, W), edges repeated; line: scratch, (W + 2 reach,)."""
    height, width = source.shape
    above, here, below = source[max(y - reach, 0)], source[y], source[min(y + reach, height - 1)]
    middle, left, right = line[reach : reach + width], line[:width], line[2 * reach : 2 * reach + width]
    for x in range(width):
        middle[x] = _F(0.25) * (above[x] + below[x]) + _F(0.5) * here[x]
    line[:reach], line[reach + width : 2 * reach + width] = middle[0], middle[width - 1]
    for x in range(width):  # slices, not offsets: an index that might be negative would keep it from vector instructions
        row[x] = _F(0.25) * (left[x] + right[x]) + _F(0.5) * middle[x]


@compiled(nogil=True)
def _blend(sums, blurred, out, blocks, block, number, limit, density, first, last):
    """Blur ``number`` of the sums, and the picture blended towards it; at CONTRAST_AT also limit and density (H, W)."""
    planes = 5 if number <= CONTRAST_AT else 4
    width, reach = out.shape[2], 2**number
    line, share = np.empty(width + 2 * reach, np.float32), np.empty(blocks.shape[1] * block, np.float32)
    for y in range(first, last):
        for plane in range(planes):
            _blur_row(sums[plane], y, reach, line, blurred[plane, y])
        _guide_row(blocks, block, 1 + number, y, share)
        for x in range(width):
            share[x] = min(max(share[x], _F(0.0)), _F(1.0))
        weight, sharp = blurred[3, y], sums[3, y]
        for plane in range(3):
            smoother, sharper, made = blurred[plane, y], sums[plane, y], out[plane, y]
            for x in range(width):
                made[x] += share[x] * (smoother[x] / weight[x] - sharper[x] / sharp[x])
        if number == CONTRAST_AT:
            red, green, blue, square = blurred[0, y], blurred[1, y], blurred[2, y], blurred[4, y]
            for x in range(width):
                light = (_F(_RED) * red[x] + _F(_GREEN) * green[x] + _F(_BLUE) * blue[x]) / weight[x]
                variance = max(square[x] / weight[x] - light * light, _F(0.0))
                limit[y, x] = np.sqrt(variance + _F(LEAST_CONTRAST**2))
                density[y, x] = (weight[x] - _F(FILLED_WEIGHT)) / _F(1.0 - FILLED_WEIGHT)


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
def _finish(packed, out, blocks, block, means, limit, density, made, first, last):
    """The correction of the light, and the coverage: made (H, W, 4) float32, 0..1, never NaN."""
    width = out.shape[2]
    light, cover = np.empty(blocks.shape[1] * block, np.float32), np.empty(blocks.shape[1] * block, np.float32)
    around, column = np.empty(width, np.float32), np.zeros((block, means.shape[2] + 1), np.float32)
    left, share = np.empty(blocks.shape[1], np.int32), np.empty(blocks.shape[1], np.float32)
    _between(block, means.shape[2], left, share)
    for y in range(first, last):
        _guide_row(blocks, block, 0, y, light)
        _guide_row(blocks, block, 1 + BLENDS, y, cover)
        _mean_row(means, block, y, left, share, column, around)
        bound, dense = limit[y], density[y]
        red, green, blue = out[0, y], out[1, y], out[2, y]
        for x in range(width):
            change = bound[x] * _tanh((light[x] - around[x]) / bound[x]) * min(max(dense[x] / _F(SPARSE), _F(0.0)), _F(1.0))
            around[x] = _F(1.0) + change / max(_F(_RED) * red[x] + _F(_GREEN) * green[x] + _F(_BLUE) * blue[x], _F(DARK))
        for x in range(width):
            made[y, x, 0], made[y, x, 1] = _unit(red[x] * around[x]), _unit(green[x] * around[x])
            made[y, x, 2] = _unit(blue[x] * around[x])
            made[y, x, 3] = max(_unit(_F(1.0) + cover[x]), packed[y, x, CLOSED])


class Blender:
    """The passes on ``threads`` threads; its arrays are kept from picture to picture.  Safe to call from any thread."""

    def __init__(self, threads: int):
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads, "blend")
        self._lock = threading.Lock()
        self._room = np.empty(0, np.float32)
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
        planes = self._planes(2 * _PLANES + 3 + 2 + 4, height * width)
        sums, blurred = (planes[i : i + _PLANES].reshape(_PLANES, height, width) for i in (0, _PLANES))
        out, limit, density = (planes[i:j].reshape(-1, height, width) for i, j in ((10, 13), (13, 14), (14, 15)))
        made = planes[15:19].reshape(height, width, 4)
        means = np.empty((-(-height // MEAN_BLOCK), block * block, -(-width // MEAN_BLOCK)), np.float32)
        self._rows(height, _weigh, packed, sums, out)
        for number in range(BLENDS):
            self._rows(height, _blend, sums, blurred, out, blocks, block, number, limit[0], density[0])
            sums, blurred = blurred, sums
        self._rows(len(means), _means, blocks, block, height, width, means)
        self._rows(height, _finish, packed, out, blocks, block, means, limit[0], density[0], made)
        return made

    def _planes(self, count: int, pixels: int) -> np.ndarray:
        if len(self._room) < count * pixels:
            self._room = np.empty(count * pixels, np.float32)
        return self._room[: count * pixels].reshape(count, pixels)

    def _rows(self, height: int, work, *arguments) -> None:
        edges = [height * i // self._threads for i in range(self._threads + 1)]
        jobs = [self._pool.submit(work, *arguments, a, b) for a, b in itertools.pairwise(edges) if b > a]
        for job in jobs:
            job.result()
