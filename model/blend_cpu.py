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

from model.blend_rows import (
    between,
    blend_row,
    blur_row,
    contrast_row,
    finish_row,
    guide_row,
    half_band_row,
    mean_row,
    square_means,
    square_row,
    weigh_row,
)
from model.common.jit import compiled
from model.unet import BLENDS, CONTRAST_AT, MEAN_BLOCK

_LEAST_ROWS = 32
"""Of a thread, since 15 above and below them are blurred too."""


@compiled(nogil=True)
def _make(packed, blocks, block, means, made, first, last):
    """Rows ``first`` to ``last`` of the picture, made (H, W, 4).

    Blur k looks 2**k rows up and down, so its row y is had 2**(k + 1) - 1 rows after row y of the picture; of the sums that
    it looks at 2 * 2**k + 1 rows are kept, of the picture being blended all that are on their way.
    """
    height, width = packed.shape[0], packed.shape[1]
    behind = 2**BLENDS - 1
    kept = np.empty((2 ** (BLENDS + 1) - 2 + BLENDS, 5, width), np.float32)  # of blur k from row 2**(k + 1) - 2 + k
    out, limit = np.empty((behind + 1, 3, width), np.float32), np.empty((behind + 1, width), np.float32)
    smoothest, line = np.empty((5, width), np.float32), np.empty(width + 2 ** (BLENDS + 1), np.float32)
    whole, row_of = np.empty(blocks.shape[1] * block, np.float32), np.empty(width, np.float32)
    said = np.empty((1 + BLENDS, 5, width), np.float32)  # the last rows of the network's channels, of each up to row had
    had = np.full(1 + BLENDS, max(first - 2, 0))
    around, column = np.empty(width, np.float32), np.zeros((block, means.shape[2] + 1), np.float32)
    left, part = np.empty(blocks.shape[1], np.int32), np.empty(blocks.shape[1], np.float32)
    between(block, means.shape[2], left, part)
    for row in range(max(first - behind, 0), last + behind):
        if row < height:
            weigh_row(packed[row], kept[row % 3], out[row % (behind + 1)])
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
                blur_row(above[plane], here[plane], below[plane], reach, line, smooth[plane])
            if number + 1 == CONTRAST_AT:
                square_row(smooth)
            if y < first or y >= last:
                continue
            place = y % (behind + 1)
            channel = 1 + number
            while had[channel] < min(y + 3, height):
                guide_row(blocks, block, channel, had[channel], whole)
                said[channel, had[channel] % 5] = whole[:width]
                had[channel] += 1
            half_band_row(said[channel], y, height, line, row_of)
            blend_row(here, smooth, row_of, out[place])
            if number == CONTRAST_AT:
                contrast_row(smooth, limit[place])
            if number + 1 == BLENDS:
                while had[0] < min(y + 3, height):
                    guide_row(blocks, block, 0, had[0], whole)
                    mean_row(means, block, had[0], left, part, column, around)
                    np.subtract(whole[:width], around, said[0, had[0] % 5])
                    had[0] += 1
                half_band_row(said[0], y, height, line, row_of)
                guide_row(blocks, block, 1 + BLENDS, y, whole)
                finish_row(packed[y], out[place], row_of, whole[:width], limit[place], made[y])


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
        self._rows(len(means), 1, square_means, blocks, block, height, width, means)
        self._rows(height, _LEAST_ROWS, _make, packed, blocks, block, means, made)
        return made

    def _rows(self, height: int, least: int, work, *arguments) -> None:
        """Shares rows out to the threads, at least ``least`` to one."""
        parts = max(1, min(self._threads, height // least))
        edges = [height * i // parts for i in range(parts + 1)]
        jobs = [self._pool.submit(work, *arguments, a, b) for a, b in itertools.pairwise(edges) if b > a]
        for job in jobs:
            job.result()
