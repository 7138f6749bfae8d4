"""Scans of one place agree in brightness: their exposures are matched once, as the grid is built.

Pass 1 keeps a thinned sample of every station's points; :mod:`model.exposure` finds the gains; pass 2 applies them.  A
station is a scan of an E57, a point source of a LAS or LAZ file, or a file of several.  What was done is in
``meta["exposures"]`` and in ``pointglass info``; ``--exposures as-scanned`` leaves every colour as the file has it.
"""

import numpy as np

from viewer.cloud.source import Chunk

SAMPLE = 1_000_000
MOST_STATIONS = 256
LEAST_CHANGE = 0.004  # gains nearer to one are left at one: below a level of 255


class Stations:
    """Takes note of chunks (``add``), solves (``solve``), then gives each chunk's points their gains (``gains``)."""

    def __init__(self) -> None:
        self._number: dict[tuple[int, int, int], int] = {}
        self._parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self._held, self._share = 0, 1.0
        self._rng = np.random.default_rng(0)
        self._gains: np.ndarray | None = None

    def add(self, source: int, chunk: Chunk) -> None:
        """Keeps a share of the chunk's points.  Chunks without colour count for nothing."""
        if chunk.rgb is None or isinstance(chunk.scan, np.ndarray) or len(chunk.xyz) == 0:
            return
        number = self._numbers(source, chunk)
        pick = np.flatnonzero(self._rng.random(len(chunk.xyz)) < self._share)
        pick = pick[np.isfinite(chunk.xyz[pick]).all(axis=1)]
        self._parts.append((chunk.xyz[pick], chunk.rgb[pick], number[pick]))
        self._held += len(pick)
        while self._held > 2 * SAMPLE:
            self._share /= 2
            self._parts = [tuple(a[::2] for a in part) for part in map(self._shuffled, self._parts)]
            self._held = sum(len(part[0]) for part in self._parts)

    def _shuffled(self, part):
        order = self._rng.permutation(len(part[0]))
        return tuple(a[order] for a in part)

    def _numbers(self, source: int, chunk: Chunk) -> np.ndarray:
        """(n,) station number of each point, the same in both passes."""
        if chunk.station is None:
            key = (source, int(chunk.scan), 0)
            return np.full(len(chunk.xyz), self._number.setdefault(key, len(self._number)), np.int32)
        ids, index = np.unique(chunk.station, return_inverse=True)
        keys = [(source, int(chunk.scan), int(i)) for i in ids]
        return np.array([self._number.setdefault(key, len(self._number)) for key in keys], np.int32)[index]

    def solve(self, shifts: list[int]) -> dict | None:
        """Ends pass 1.  shifts: bits by which each source's colours are shifted right to 8 bits.

        Returns meta["exposures"]: stations, matched and the smallest and largest gain; None for a single station.
        """
        stations, parts = len(self._number), self._parts
        self._parts = []
        if not 2 <= stations <= MOST_STATIONS:
            return None
        from model.exposure import exposures_of

        source_of = {number: key[0] for key, number in self._number.items()}
        shift = np.array([shifts[source_of[number]] for number in range(stations)], np.uint8)
        xyz, rgb, number = (np.concatenate([part[k] for part in parts]) for k in range(3))
        found = exposures_of(xyz, (rgb >> shift[number][:, None]).astype(np.uint8), number, sample=SAMPLE)
        gains = np.ones((stations, 3))
        gains[: len(found.gains)] = found.gains
        if np.abs(gains - 1).max() >= LEAST_CHANGE:
            self._gains = gains.astype(np.float32)
        return {
            "stations": stations, "matched": int(found.matched.sum()), "applied": self._gains is not None,
            "smallest_gain": float(gains.min()), "largest_gain": float(gains.max()),
        }  # fmt: skip

    def apply(self, source: int, chunk: Chunk, shift: int) -> np.ndarray | None:
        """(n, 3) uint8 colours with the gains applied; None where there is nothing to apply."""
        if self._gains is None or chunk.rgb is None:
            return None
        gains = self._gains[self._numbers(source, chunk)]
        return np.clip(np.rint(chunk.rgb * gains * np.float32(1 / 257 if shift else 1)), 0, 255).astype(np.uint8)
