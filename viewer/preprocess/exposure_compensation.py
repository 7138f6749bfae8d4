"""Exposure compensation: gives scans of one place the same brightness, once, while the grid is built.

Pass 1 keeps a thinned sample of the points. :mod:`model.appearance.exposure` finds a gain for every station, and
:mod:`model.appearance.scan_runs` one for every run of points where runs still differ; pass 2 applies them. A station is a scan
of an E57, a point source of a LAS or LAZ file, or one of several files. The gains are described in ``Scene.meta``
(exposures, passes) and by ``pointglass info``; ``--exposures as-scanned`` leaves all colours as the file has them.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np

from ...model.appearance.exposure import exposures_of
from ...model.appearance.scan_runs import RunGains, solve_run_gains
from ..readers.source import Chunk
from .black_border import DARK, black_border_share, brightest
from .scan_description import ExposureSummary, RunSummary
from .valid_positions import is_position

SAMPLE = 1_000_000
"""Points kept, up to twice as many: 80 MB."""
MOST_STATIONS = 256
"""Stations whose gains are solved for at most; chosen by hand."""
LEAST_CHANGE = 0.004
"""Gains that differ from one by less are not applied: about one level of 255."""
_ALL = slice(None)


class ExposureCompensation:
    """Observes the chunks of pass 1 (``add``), finds the gains (``solve``), and multiplies colours by them (``apply``)."""

    def __init__(self) -> None:
        self.stations = 0
        """Stations, scans and flight lines that were told apart, after ``solve``."""
        self._number: dict[tuple[int, int, int], int] = {}
        self._parts: list[tuple[np.ndarray, ...]] = []
        self._held, self._share = 0, 1.0
        self._rng = np.random.default_rng(0)
        self._gains: np.ndarray | None = None
        self._passes: RunGains | None = None
        self._turns: dict[int, np.ndarray] = {}
        self._sample: tuple[np.ndarray, ...] | None = None
        self._alone: tuple[RunGains, dict[int, float]] | None = None
        self.black_borders: dict[int, float] = {}
        """After ``solve``, by source: the share of its points at a photograph's black border (preprocess.black_border)."""

    def add(self, source: int, first: int, chunk: Chunk) -> None:
        """Keeps a share of the chunk's points, unless it has no colour.  first: running number of its first point."""
        if chunk.rgb is None or isinstance(chunk.scan, np.ndarray) or len(chunk.xyz) == 0:
            return
        pick = self._drawn(len(chunk.xyz))
        xyz, rgb = _taken(chunk.xyz, pick), _taken(chunk.rgb, pick)
        if not (usable := is_position(xyz)).all():
            pick, xyz, rgb = np.arange(len(chunk.xyz))[pick][usable], xyz[usable], rgb[usable]
        number = self._numbers(source, first, chunk, pick)
        at = np.arange(first, first + len(chunk.xyz)) if isinstance(pick, slice) else first + pick
        self._parts.append((xyz, rgb, number, at))
        self._held += len(xyz)
        while self._held > 2 * SAMPLE:
            self._share /= 2
            self._parts = [self._halved(part) for part in self._parts]
            self._held = sum(len(part[0]) for part in self._parts)

    def _drawn(self, count: int) -> np.ndarray | slice:
        """Which of ``count`` points are kept: those whose random number from 0 to 1 is below the share, a power of two."""
        bits = self._rng.bit_generator
        if self._share == 1.0:
            bits.advance(count)  # type: ignore[attr-defined]  # as if numbers were drawn, so that the next are the same
            return _ALL
        return np.flatnonzero(bits.random_raw(count) < np.uint64(2.0**64 * self._share))

    def _halved(self, part: tuple[np.ndarray, ...]) -> tuple[np.ndarray, ...]:
        chosen = self._rng.permutation(len(part[0]))[::2]
        return tuple(a.take(chosen, axis=0) for a in part)

    def _numbers(self, source: int, first: int, chunk: Chunk, pick: np.ndarray | slice = _ALL) -> np.ndarray:
        """(n,) station number of each point, or of those at ``pick``; in pass 2 those of inferred stations where the source was
        split."""
        if source in self._turns:
            return self._turned(source, first + np.arange(len(chunk.xyz))[pick])
        if chunk.station is None:
            key = (source, int(chunk.scan), 0)
            count = len(chunk.xyz) if isinstance(pick, slice) else len(pick)
            return np.full(count, self._number.setdefault(key, len(self._number)), np.int32)
        ids, index = _distinct(chunk.station, pick)
        keys = [(source, int(chunk.scan), int(i)) for i in ids]
        return np.array([self._number.setdefault(key, len(self._number)) for key in keys], np.int32)[index]

    def _turned(self, source: int, at: np.ndarray) -> np.ndarray:
        """(n,) station numbers of a split source's points with the running numbers ``at``."""
        turns = self._turns[source]
        keys = [(source, 0, -station) for station in range(len(turns) + 1)]
        numbers = np.array([self._number.setdefault(key, len(self._number)) for key in keys], np.int32)
        return numbers[np.searchsorted(turns, at, side="right")]

    def prepare(self, shifts: list[int]) -> None:
        """Does what of ``solve`` needs no turns, and finds the runs of a single station, which most often has none.  shifts: by
        which bits each source's colours are shifted right to 8 bits."""
        parts, self._parts = self._parts, []
        if not parts:
            return
        xyz, rgb, number, at = (np.concatenate([part[k] for part in parts]) for k in range(4))
        del parts
        shift = np.array([shifts[key[0]] for key in self._number], np.uint8)  # in the order of the stations' numbers
        rgb = (rgb >> (shift[number][:, None] if np.ptp(shift) else shift[0])).astype(np.uint8)
        self._sample = xyz, rgb, number, at
        if len(self._number) == 1:
            self._alone = self._runs(xyz, rgb, number, at)

    def solve(self, turns: dict[int, np.ndarray]) -> tuple[ExposureSummary | None, RunSummary | None]:
        """Ends pass 1, after ``prepare``.  turns: as in ScanTable.

        Returns what was found about stations, None for a single one, and about runs of points, None without colours.
        """
        sample, self._sample = self._sample, None
        if sample is None:
            return None, None
        xyz, rgb, number, at = sample
        for file, where in turns.items():
            if [key[0] for key in self._number].count(file) == 1:  # else the file itself distinguishes stations
                mine = number == next(n for key, n in self._number.items() if key[0] == file)
                self._turns[file] = where
                number[mine] = self._turned(file, at[mine])
        self.stations = len(self._number)
        exposures = self._solve_stations(xyz, rgb, number) if 2 <= self.stations <= MOST_STATIONS else None
        if self._gains is not None:
            rgb = _multiplied(rgb, self._gains[number])
        alone = self._alone if self._gains is None else None  # the same colours
        passes, self.black_borders = alone or self._runs(xyz, rgb, number, at)
        self._alone = None
        self._passes = passes if passes.worthwhile else None
        return exposures, RunSummary(passes.remaining, passes.worthwhile)

    def _runs(self, xyz: np.ndarray, rgb: np.ndarray, number: np.ndarray, at: np.ndarray) -> tuple[RunGains, dict[int, float]]:
        """The gains of runs, and ``black_borders``, of a sample whose stations have one brightness."""
        source = np.array([key[0] for key in self._number])  # in the order of the stations' numbers
        with ThreadPoolExecutor(1, "borders") as pool:
            borders = {int(file): pool.submit(_border_share, xyz, rgb, None if len(source) == 1 else source[number] == file)
                       for file in np.unique(source)}  # fmt: skip
            lit = np.flatnonzero(brightest(rgb) >= DARK)  # darker points: missing colour, black borders, noise
            passes = solve_run_gains(xyz.take(lit, axis=0), rgb.take(lit, axis=0), at[lit])
            return passes, {file: share.result() for file, share in borders.items()}

    def _solve_stations(self, xyz: np.ndarray, rgb: np.ndarray, number: np.ndarray) -> ExposureSummary:
        found = exposures_of(xyz, rgb, number, sample=SAMPLE)
        gains = np.ones((len(self._number), 3))
        gains[: len(found.gains)] = found.gains
        if np.abs(gains - 1).max() >= LEAST_CHANGE:
            self._gains = gains.astype(np.float32)
        return ExposureSummary(
            stations=len(self._number), matched=int(found.matched.sum()), applied=self._gains is not None,
            smallest_gain=float(gains.min()), largest_gain=float(gains.max()),
        )  # fmt: skip

    def apply(self, source: int, first: int, chunk: Chunk, shift: int) -> np.ndarray:
        """(n, 3) uint8 colours of a chunk, multiplied by the gains."""
        assert chunk.rgb is not None
        rgb = (chunk.rgb >> shift).astype(np.uint8)
        if self._gains is not None:
            rgb = _multiplied(chunk.rgb, self._gains[self._numbers(source, first, chunk)] * np.float32(1 / 257 if shift else 1))
        return rgb if self._passes is None else self._passes.apply(rgb, first)


def _border_share(xyz: np.ndarray, rgb: np.ndarray, mine: np.ndarray | None) -> float:
    """``black_border_share`` of the points at ``mine``; None: of all."""
    return black_border_share(xyz, rgb) if mine is None else black_border_share(xyz[mine], rgb[mine])


def _distinct(ids: np.ndarray, pick: np.ndarray | slice) -> tuple[np.ndarray, np.ndarray]:
    """The different ids (n,), ascending, and the number among them of each id at ``pick``: np.unique, which sorts, without
    sorting where ids have at most 16 bits."""
    if ids.dtype.kind != "u" or ids.dtype.itemsize > 2:
        different, index = np.unique(ids, return_inverse=True)
        return different, index[pick]
    different = np.flatnonzero(np.bincount(ids, minlength=1))
    place = np.zeros(int(different[-1]) + 1, np.int64)
    place[different] = np.arange(len(different))
    return different, place[ids[pick]]


def _taken(values: np.ndarray, pick: np.ndarray | slice) -> np.ndarray:
    """A copy of the rows at ``pick``; three times as fast as values[pick]."""
    return values[pick].copy() if isinstance(pick, slice) else values.take(pick, axis=0)


def _multiplied(rgb: np.ndarray, gains: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(rgb * gains), 0, 255).astype(np.uint8)
