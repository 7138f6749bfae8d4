"""Random crops of training pairs: rotated, mirrored, recoloured, augmented and filled.

A batch depends only on (seed, step, process), so that a resumed training is identical to an uninterrupted one.
"""

import json
import signal
from concurrent.futures import Future, ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from ..common.errors import DataError
from ..reference.projection import MEASURED_CHANNELS, filled_input
from .augmentation import augmented

MARGIN = 32
"""Pixels around a crop that take part in filling, so that holes at its border are filled as in a full picture.  Chosen by
hand."""


@dataclass(frozen=True)
class Batch:
    """x (B, 6, c, c) input; colour (B, 3, c, c) truth; coverage, known (B, 1, c, c) 0..1.

    neighbour (N, 6, c, c): inputs from slightly moved cameras, of the first N crops.  flow (N, 2, c, c): optical flow to them,
    pixels, NaN where a pixel is not visible there.  N may be 0.
    """

    x: Tensor
    colour: Tensor
    coverage: Tensor
    known: Tensor
    neighbour: Tensor
    flow: Tensor

    def to(self, device: torch.device) -> "Batch":
        """The batch on a device, pictures channels last."""
        return Batch(*(
            t.to(device, non_blocking=True, memory_format=torch.channels_last) if t.ndim == 4 else t.to(device)
            for t in (self.x, self.colour, self.coverage, self.known, self.neighbour, self.flow)
        ))


class PairFolder:
    """Memory-mapped arrays of :mod:`model.data.pairs`.  Raises DataError naming the first file that is unreadable or
    unexpected."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.measured = self._array("measured", MEASURED_CHANNELS, np.float16)
        self.truth = self._array("truth", 5, np.uint8)
        has_neighbours = (folder / "neighbours.npy").is_file()
        self.neighbours = self._array("neighbours", MEASURED_CHANNELS, np.float16) if has_neighbours else None
        self.flow = self._array("flow", 2, np.float16) if self.neighbours is not None else None
        self.noise = self._array("noise", 1, np.float16) if (folder / "noise.npy").is_file() else None
        self.overall = 0.0 if self.noise is None else self._overall()
        for name in ("truth", "neighbours", "flow", "noise"):
            array = getattr(self, name)
            if array is not None and (len(array), *array.shape[2:]) != (len(self.measured), *self.measured.shape[2:]):
                raise DataError(f"{folder / f'{name}.npy'}: {array.shape} does not match measured.npy {self.measured.shape}",
                                remedy="make the pairs again")

    def _overall(self) -> float:
        """Noise of the scan as a whole, by which its sparse points are averaged (model/reference/pull_push.py); 0 where the
        pairs do not say."""
        path = self.folder / "pairs.json"
        try:
            return float(json.loads(path.read_text()).get("overall", 0.0)) if path.is_file() else 0.0
        except (OSError, ValueError, TypeError, AttributeError) as error:
            raise DataError(f"the scan's noise cannot be read ({error})", file=path, remedy="make the pairs again") from None

    def __reduce__(self):
        return PairFolder, (self.folder,)  # pickles the path, not the pixels

    def _array(self, name: str, channels: int, kind: type) -> np.ndarray:
        path = self.folder / f"{name}.npy"
        try:
            array = np.load(path, mmap_mode="r")
        except (OSError, ValueError) as error:
            raise DataError(f"training pairs cannot be read ({error})", file=path, remedy="make them again") from None
        if array.ndim != 4 or array.shape[1] != channels or array.dtype != kind:
            raise DataError(f"{array.shape} {array.dtype}, expected (pairs, {channels}, height, width) {np.dtype(kind)}",
                            file=path, remedy="make the pairs again")
        return array


class Crops:
    """Draws batches from folders of pairs.

    shares: relative frequency of each folder (default: equal).  recolour: augments crops with exposures, channel orders,
    disagreeing stations and noise (:mod:`model.data.augmentation`); otherwise with textures only.
    """

    def __init__(self, folders: list[Path], crop: int, seed: int, shares: tuple[float, ...] = (), *, recolour: bool = True):
        self.folders = [PairFolder(folder) for folder in folders]
        for folder in self.folders:
            if min(folder.measured.shape[2:]) < crop:
                size = f"{folder.measured.shape[3]}x{folder.measured.shape[2]}"
                raise DataError(f"pictures of {size} are smaller than crops of {crop}", file=folder.folder,
                                remedy="choose smaller crops")
        weights = np.asarray(shares if shares else [1.0] * len(folders), float)
        self.shares = weights / weights.sum()
        paired = np.array([folder.neighbours is not None for folder in self.folders]) * self.shares
        self.paired = paired / paired.sum() if paired.sum() else None
        self.crop, self.seed, self.recolour = crop, seed, recolour

    def batch(self, step: int, count: int, neighbours: int = 0, process: int = 0) -> Batch:
        """``count`` crops; the first ``neighbours`` come from folders that have neighbours, where there are any."""
        rng = np.random.default_rng([self.seed, step, process])
        beside = neighbours if self.paired is not None else 0
        crops = [self._crop(rng, number < beside) for number in range(count)]
        x, truth = (torch.from_numpy(np.stack([c[k] for c in crops])) for k in (0, 1))
        near = torch.from_numpy(np.stack([c[2] for c in crops])[:beside])
        flow = torch.from_numpy(np.stack([c[3] for c in crops])[:beside])
        return Batch(x, truth[:, :3], truth[:, 3:4], truth[:, 4:5], near, flow)

    def _crop(self, rng: np.random.Generator, beside: bool):
        folder = self.folders[int(rng.choice(len(self.folders), p=self.paired if beside else self.shares))]
        crop, (count, _, height, width) = self.crop, folder.measured.shape
        i = int(rng.integers(count))
        r, c = int(rng.integers(height - crop + 1)), int(rng.integers(width - crop + 1))
        side = min(crop + 2 * MARGIN, height, width)
        around = (side - crop) // 2
        top, left = min(max(r - around, 0), height - side), min(max(c - around, 0), width - side)
        window = np.s_[i, :, top : top + side, left : left + side]
        inner = np.s_[:, r - top : r - top + crop, c - left : c - left + crop]
        x, y = folder.measured[window].astype(np.float32), folder.truth[window].astype(np.float32) / 255
        near, flow = np.zeros_like(x), np.zeros_like(x[:2])
        if beside and folder.neighbours is not None and folder.flow is not None:
            near, flow = folder.neighbours[window].astype(np.float32), folder.flow[window].astype(np.float32)
        turns, mirror = int(rng.integers(4)), rng.random() < 0.5
        gain = np.exp(rng.normal(0, 0.15, (3, 1, 1)) * 0.4 + rng.normal(0, 0.15)).astype(np.float32)
        order = rng.permutation(3) if rng.random() < 0.5 else np.arange(3)
        if not self.recolour:
            gain, order = np.ones_like(gain), np.arange(3)

        for picture in (x, y, near):
            picture[:3] = np.minimum(picture[:3] * gain, 1.0)[order]
        sigma = np.zeros((side, side), np.float32)
        if not beside:
            sigma = augmented(x, y, rng, textures_only=not self.recolour)
        if folder.noise is not None:
            sigma = np.hypot(sigma, folder.noise[window][0].astype(np.float32))
        noise = torch.from_numpy(sigma)
        x = filled_input(torch.from_numpy(x), noise, folder.overall).numpy()[inner]
        near = filled_input(torch.from_numpy(near), noise).numpy()[inner] if beside else near[inner]
        y, flow = y[inner], flow[inner]

        def turned(a: np.ndarray) -> np.ndarray:
            a = np.rot90(a, turns, (1, 2))
            return np.ascontiguousarray(a[:, :, ::-1] if mirror else a)

        flow = turned(flow)
        for _ in range(turns):  # rot90 maps the direction (x, y) to (y, -x)
            flow = np.stack([flow[1], -flow[0]])
        if mirror:
            flow[0] = -flow[0]
        return turned(x), turned(y), turned(near), flow


class Prefetcher:
    """Batches of consecutive steps, prepared by ``workers`` processes, or on demand with 0 workers; the batches are the
    same."""

    def __init__(self, crops: Crops, count: int, neighbours: int, process: int, workers: int):
        self.crops, self.rest, self.workers = crops, (count, neighbours, process), workers
        self.pool: ProcessPoolExecutor | None = None
        self.coming: dict[int, Future[Batch]] = {}

    def __enter__(self) -> "Prefetcher":
        if self.workers > 0:
            self.pool = ProcessPoolExecutor(self.workers, get_context("spawn"), _start_worker, (self.crops,))
        return self

    def __exit__(self, *_) -> None:
        if self.pool is not None:
            self.pool.shutdown(wait=True, cancel_futures=True)

    def batch(self, step: int) -> Batch:
        """The batch of a step; starts the preparation of the following ones."""
        if self.pool is None:
            return self.crops.batch(step, *self.rest)
        for coming in range(step, step + 2 * self.workers):
            if coming not in self.coming:
                self.coming[coming] = self.pool.submit(_work, coming, *self.rest)
        return self.coming.pop(step).result()


_worker: list[Crops] = []


def _start_worker(crops: Crops) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends Ctrl-C to all processes; the main process ends the workers
    torch.set_num_threads(1)
    _worker.append(crops)


def _work(step: int, *rest: int) -> Batch:
    return _worker[0].batch(step, *rest)
