"""The first and the last part of the compact network on a CPU: its input in blocks (space to depth), and blends, correction and
packing in one compiled loop over rows.

:meth:`model.network.unet.CompactUNet._blend`, the reference implementation, makes a dozen torch calls, each of which reads and
writes the full picture.  Here all steps advance together, row by row: each blur follows the previous one at the distance of its
reach, so that only the rows that the next step needs are stored, in the processor's cache.  Rows are distributed over threads;
the result does not depend on their number.  Arrays are planar, so that the inner loops along a row are vectorised.
"""

import itertools
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import torch
from torch import Tensor

from ..common.jit import compiled
from .blend_rows import (
    allow_row,
    between,
    blend_row,
    blur_row,
    contrast_row,
    finish_row,
    half_band_row,
    mean_row,
    square_means,
    square_row,
    start_row,
    unpacked_rows,
    unshuffled_rows,
)
from .unet import BLENDS, CONTRAST_AT, INPUT_CHANNELS, MEAN_BLOCK

_LEAST_ROWS = 32
"""Fewest rows of a thread: 2**BLENDS - 1 = 15 rows above and below them are blurred as well, less than as many again."""


@compiled(nogil=True)
def _subtract_means(channel, means, block, width, first, last):
    """Subtracts the interpolated ``means`` from rows ``first`` to ``last`` of a channel (H, W or more), in place."""
    wide = channel.shape[1] // block
    around, column = np.empty(width, np.float32), np.zeros((block, means.shape[2] + 1), np.float32)
    left, part = np.empty(wide, np.int32), np.empty(wide, np.float32)
    between(block, means.shape[2], left, part)
    for y in range(first, last):
        mean_row(means, block, y, left, part, column, around)
        row = channel[y]
        for x in range(width):
            row[x] -= around[x]


@compiled(nogil=True)
def _make(packed, channels, made, first, last):
    """Writes rows ``first`` to ``last`` of the picture to made (H, W, 4).  packed: (PACKED_IN, H, W).  channels:
    (2 + BLENDS, H, W) or larger, the first without its means.

    Blur k reads 2**k rows up and down, so its row y is computed 2**(k + 1) - 1 rows after row y of the picture.  Its input
    sums are stored in a ring of 2 * 2**k + 1 rows, the blended picture in a ring of all rows in progress.
    """
    height, width = packed.shape[1], packed.shape[2]
    behind = 2**BLENDS - 1
    kept = np.empty((2 ** (BLENDS + 1) - 2 + BLENDS, 5, width), np.float32)  # ring k begins at row 2**(k + 1) - 2 + k
    out, limit = np.empty((behind + 1, 3, width), np.float32), np.empty((behind + 1, width), np.float32)
    allowed = np.empty((behind + 1, 3, width), np.float32)
    smoothest, line = np.empty((5, width), np.float32), np.empty(width + 2 ** (BLENDS + 1), np.float32)
    row_of = np.empty(width, np.float32)
    for row in range(max(first - behind, 0), last + behind):
        if row < height:
            start_row(packed, row, kept[row % 3], out[row % (behind + 1)])
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
            half_band_row(channels[1 + number], y, height, line, row_of)
            if number == 0:
                allow_row(packed, y, smooth, allowed[place])
            blend_row(here, smooth, row_of, out[place])
            if number == CONTRAST_AT:
                contrast_row(smooth, limit[place])
            if number + 1 == BLENDS:
                half_band_row(channels[0], y, height, line, row_of)
                finish_row(packed, y, out[place], row_of, channels[1 + BLENDS, y, :width], limit[place], allowed[place],
                           made[y])  # fmt: skip


class Blender:
    """Runs the loop on ``threads`` threads.  Its arrays are reused from picture to picture.  Calls are safe from any thread."""

    def __init__(self, threads: int):
        self._threads = threads
        self._pool = ThreadPoolExecutor(threads, "blend")
        self._lock = threading.Lock()
        self._made, self._pixels = np.empty(0, np.float32), np.empty(0, np.float32)
        self._floats: dict[str, np.ndarray] = {}

    def __call__(self, packed: Tensor, blocks: Tensor, block: int) -> Tensor:
        """(H, W, 4) half, RGB and coverage 0..1.

        packed: (PACKED_IN, H, W), the channels of model/network/network_layout.py.  blocks: (h, w, (2 + BLENDS) * block**2),
        the output of the network's head before its blocks are unpacked to pixels, at least as large as the picture.  Both in
        any precision, on the CPU.
        """
        with self._lock:  # held until the result is copied: the next call overwrites the buffers
            bits = blocks if blocks.dtype == torch.bfloat16 else blocks.float()
            bits = bits.contiguous().view(torch.int16 if bits.dtype == torch.bfloat16 else torch.int32).numpy()
            made = self.made(self._float32("packed", packed), bits.view(f"u{bits.itemsize}"), block)
            return torch.from_numpy(made).half()

    def space_to_depth(self, packed: Tensor, block: int, multiple: int) -> Tensor:
        """(1, INPUT_CHANNELS * block**2, h, w) float32, channels last, in the order of torch's ``pixel_unshuffle``.

        packed: (PACKED_IN, H, W) contiguous float32, padded to sides that are multiples of ``multiple`` by repeating its edge.
        """
        height, width = (-(-side // multiple) * multiple // block for side in packed.shape[1:])
        made = np.empty((height, width, INPUT_CHANNELS * block * block), np.float32)
        self._rows(height, _LEAST_ROWS, unshuffled_rows, packed.numpy(), block, made)
        return torch.from_numpy(made)[None].permute(0, 3, 1, 2)

    def _float32(self, name: str, given: Tensor) -> np.ndarray:
        """``given`` in float32, in a buffer reused by ``name``: allocating it for each picture takes longer than converting."""
        if given.dtype == torch.float32 and given.is_contiguous():
            return given.numpy()
        kept = self._floats.get(name)
        if kept is None or len(kept) < given.numel():
            kept = self._floats[name] = np.empty(given.numel(), np.float32)
        kept = kept[: given.numel()].reshape(given.shape)
        torch.from_numpy(kept).copy_(given)
        return kept

    def made(self, packed: np.ndarray, blocks: np.ndarray, block: int) -> np.ndarray:
        """The same in float32; the result is overwritten by the next call.  For one thread at a time.

        blocks: the bits of float32 or bfloat16 numbers, uint32 or uint16.
        """
        height, width = packed.shape[1:]
        guide = self._guide(blocks, block)
        if self._made.size < height * width * 4:
            self._made = np.empty(height * width * 4, np.float32)
        made = self._made[: height * width * 4].reshape(height, width, 4)
        means = np.empty((-(-height // MEAN_BLOCK), block * block, -(-width // MEAN_BLOCK)), np.float32)
        self._rows(len(means), 1, square_means, guide[0], block, height, width, means)
        self._rows(height, _LEAST_ROWS, _subtract_means, guide[0], means, block, width)
        self._rows(height, _LEAST_ROWS, _make, packed, guide, made)
        return made

    def _guide(self, blocks: np.ndarray, block: int) -> np.ndarray:
        """(channels, h * block, w * block) float32: the network's output by pixels."""
        height, wide, channels = blocks.shape
        size = blocks.size
        if len(self._pixels) < size:
            self._pixels = np.empty(size, np.float32)
        guide = self._pixels[:size].reshape(channels // block**2, height * block, wide * block)
        self._rows(height, _LEAST_ROWS // block, unpacked_rows, blocks, block, 8 * (4 - blocks.itemsize), guide.view(np.uint32))
        return guide

    def _rows(self, height: int, least: int, work, *arguments) -> None:
        """Distributes rows over the threads, at least ``least`` rows each."""
        parts = max(1, min(self._threads, height // least))
        edges = [height * i // parts for i in range(parts + 1)]
        jobs = [self._pool.submit(work, *arguments, a, b) for a, b in itertools.pairwise(edges) if b > a]
        for job in jobs:
            job.result()
