"""The colour in which a point is shown: decided over whole files in pass 1, applied to each chunk in pass 2.

Many files hold 8-bit colours in 16-bit fields: a file whose largest value is at most 255 is read as 8-bit.  A scan without
colour is shown by its intensity (grey, 1st to 99th percentile), or else by height; the colour's note says so.  Points without
RGB are often stored as black.  Where black is implausibly frequent it is treated as missing colour: such points occlude, and
their pixels are filled from neighbours.  The same holds for points at a photograph's black border
(viewer.preprocess.black_border).  Frame: height is the file's third axis.
"""

from dataclasses import dataclass, field

import numpy as np

from ..common.progress import progress
from ..picture.colour_modes import RAMPS
from ..readers.source import Chunk, Source
from .black_border import DARK
from .exposure_compensation import MOST_STATIONS, ExposureCompensation
from .scan_description import ColourSummary, ExposureSummary, RunSummary

_RAMP = np.array(RAMPS["viridis"], np.float64)
_EVERY = 16  # one of so many points is examined for black: 65,000 of a chunk tell a share of 1 % within 0.04 (standard error)
DARK_LEVEL = 4
"""8-bit levels 1 to 4 are compared with black.  With 2, black has 250 times the points of a level in the scan without colour in
its shadows, with 4 it has 370 times, with 8 600 times; in the others at most 0.07, 0.11 and 0.16 times."""
_LEAST_BLACK, BLACK_TO_DARK = 0.01, 8.0
"""Black is treated as missing colour in a file where it has at least this share of the points, and so many times the points of
each of the next levels.  Six scans: 14 % and 310 times in the one whose shadows have no colour, at most 0.08 % and 0.1 times in
the others."""


@dataclass
class _Scan:
    has_rgb: bool = False
    points: int = 0


@dataclass
class _File:
    """What pass 1 saw of one file."""

    name: str
    scans: dict[int, _Scan] = field(default_factory=dict)
    largest: int = 0
    wide: bool = False
    random: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    looked: int = 0
    black: int = 0
    dark: np.ndarray = field(default_factory=lambda: np.zeros(2, np.int64))
    """Points with no channel above DARK_LEVEL, read as 8 bits (0) or 16 bits (1), black ones not counted."""
    intensity: np.ndarray = field(default_factory=lambda: np.zeros(65536, np.int64))
    mode: str = "height"
    grey: np.ndarray | None = None
    ramp: tuple[float, float] = (0.0, 1.0)

    @property
    def shift(self) -> int:
        return 8 if self.wide and self.largest > 255 else 0

    @property
    def uncoloured(self) -> float:
        """Share of the points of this file that are black because their colour is missing."""
        dark = self.dark[1 if self.shift else 0] / DARK_LEVEL
        return self.black / self.looked if self.black > max(_LEAST_BLACK * self.looked, BLACK_TO_DARK * dark) else 0.0

    def look(self, rgb: np.ndarray) -> None:
        """Counts black and dark points of (n, 3) colours."""
        some = rgb[self.random.integers(len(rgb), size=-(-len(rgb) // _EVERY))]  # at random: scan lines repeat at a stride
        highest = some[:, 0] | some[:, 1] | some[:, 2]  # at least the highest channel, and less than twice it
        self.looked += len(some)
        self.black += int(np.count_nonzero(highest == 0))
        limits = (DARK_LEVEL, DARK_LEVEL << 8 | 0xFF)
        self.dark += [np.count_nonzero((highest > 0) & (highest <= limit)) for limit in limits]

    @property
    def colourless(self) -> list[int]:
        return [i for i, scan in self.scans.items() if not scan.has_rgb]


@dataclass(frozen=True)
class ColourDecision:
    """What pass 1 decided.  colour, exposures, passes: as in ScanDescription.  warnings: for a person."""

    colour: ColourSummary
    exposures: ExposureSummary | None
    passes: RunSummary | None
    warnings: list[str]


class Colours:
    """Observes the chunks of pass 1 (``add``), decides (``decide``), and gives each chunk of pass 2 its colours (``apply``)."""

    def __init__(self, sources: list[Source], *, match: bool = True):
        self._names = [source.path.name for source in sources]
        self._match = match
        self.reset()

    def reset(self) -> None:
        """Forgets all chunks: the pass begins again."""
        self._files = [_File(name) for name in self._names]
        self._compensation = ExposureCompensation()
        self._unlit: set[int] = set()
        self._prepared = False

    def add(self, source: int, first: int, chunk: Chunk) -> None:
        """Counts the colours of a chunk of source number ``source``.  first: running number of its first point."""
        if len(chunk.xyz) == 0:
            return
        file = self._files[source]
        scan = file.scans.setdefault(int(np.max(chunk.scan)), _Scan())
        scan.points += len(chunk.xyz)
        largest = int(chunk.rgb.max()) if chunk.rgb is not None else 0
        if chunk.rgb is not None and largest > 0:
            scan.has_rgb = True
            file.largest = max(file.largest, largest)
            file.wide |= chunk.rgb.dtype == np.uint16
            file.look(chunk.rgb)
            if self._match:
                self._compensation.add(source, first, chunk)
        elif chunk.intensity is not None:
            file.intensity += np.bincount(chunk.intensity, minlength=65536)

    def prepare(self) -> None:
        """Does what of ``decide`` needs no knowledge of inferred stations, so that these can be found at the same time."""
        self._prepared = True
        if self._match:
            with progress(0, "matching the brightness") as meter:  # up to half of the time that a small scan takes
                meter.update(0)
                self._compensation.prepare([file.shift for file in self._files])
                meter.update(0)

    def decide(self, heights: tuple[float, float], turns: dict[int, np.ndarray]) -> ColourDecision:
        """Ends pass 1, ``prepare`` included.  heights: range of the third axis that a height ramp spans.  turns: as in
        ScanTable."""
        if not self._prepared:
            self.prepare()
        warnings, kinds, bits = [], set(), 8
        exposures = passes = None
        lost = 0.0  # points without a colour, of those that were examined
        if self._match:
            with progress(0, "matching the brightness") as meter:
                meter.update(0)
                exposures, passes = self._compensation.solve(turns)
                meter.update(0)
            if self._compensation.stations > MOST_STATIONS:
                warnings.append(f"exposures of {self._compensation.stations:,} stations or flight lines are not compensated: "
                                f"at most {MOST_STATIONS} can be; open fewer files")  # fmt: skip
        for number, file in enumerate(self._files):
            if len(file.colourless) < len(file.scans):
                kinds.add("rgb")
            if file.wide and file.shift == 0:
                warnings.append(
                    f"{file.name}: 8-bit colour in 16-bit fields (largest value {file.largest}), read as 8-bit"
                )
            bits = max(bits, 16 if file.shift else 8)
            if self._match and (share := file.uncoloured or self._compensation.black_borders.get(number, 0.0)):
                self._unlit.add(number)
                lost += share * file.looked
                those = "are black" if file.uncoloured else "have the colour of a photograph's black border"
                what = f"{_percent(share)} of the points {those}, which is treated as missing colour and filled from neighbours"
                warnings.append(f"{file.name}: {what}")
            if not file.colourless:
                continue
            low, high = _percentiles(file.intensity)
            file.ramp = heights
            if high > low:
                file.mode = "intensity"
                file.grey = np.clip((np.arange(65536.0) - low) / (high - low) * 255 + 0.5, 0, 255).astype(np.uint8)
            kinds.add(file.mode)
            some = (
                ""
                if len(file.colourless) == len(file.scans)
                else f" in {len(file.colourless)} of {len(file.scans)} scans"
            )
            warnings.append(f"{file.name}: no colour{some}, shown by {file.mode}")
        source = next((kind for kind in ("rgb", "intensity", "height") if kind in kinds), "height")
        note = {
            "rgb": f"{bits}-bit colour from the file",
            "intensity": "no colour in the file: intensity as grey, 1st to 99th percentile",
            "height": "no colour in the file: coloured by height",
        }[source]
        if len(kinds) > 1:
            note += f"; parts without colour shown by {' and '.join(sorted(kinds - {'rgb'}))}"
        looked = sum(file.looked for file in self._files)
        return ColourDecision(ColourSummary(source, bits, note, lost / max(looked, 1)), exposures, passes, warnings)

    def apply(self, source: int, first: int, chunk: Chunk) -> np.ndarray:
        """(n, 3) uint8 colours of a chunk.  first: as in ``add``."""
        file = self._files[source]
        scan = file.scans.get(int(np.max(chunk.scan)), _Scan()) if len(chunk.xyz) else _Scan()
        if scan.has_rgb and chunk.rgb is not None:
            colours = self._compensation.apply(source, first, chunk, file.shift)
            if self._unlit:
                highest = colours[:, 0] | colours[:, 1] | colours[:, 2]
                if source in self._unlit:
                    colours[highest < DARK] = 0  # missing colour, and the border into which it is blended
                else:
                    colours[highest == 0] = 1  # black here is a colour
            return colours
        if file.grey is not None and chunk.intensity is not None:
            return np.repeat(file.grey[chunk.intensity][:, None], 3, axis=1)
        return height_colours(chunk.xyz[:, 2], *file.ramp)


def height_colours(z: np.ndarray, low: float, high: float) -> np.ndarray:
    """(n, 3) uint8: the ramp's colour for heights (n,) between ``low`` and ``high``; its end colours outside."""
    with np.errstate(invalid="ignore", over="ignore"):  # not finite: dropped later
        place = np.nan_to_num((z - low) / (high - low) if high > low else np.full(len(z), 0.5))
    place = np.clip(place, 0, 1) * (len(_RAMP) - 1)
    knots = np.arange(len(_RAMP))
    return np.stack([np.interp(place, knots, _RAMP[:, c]) + 0.5 for c in range(3)], axis=1).astype(np.uint8)


def _percent(share: float) -> str:
    """0.15 -> 15%, 0.0005 -> 0.05%."""
    return f"{share:.0%}" if share >= 0.01 else f"{100 * share:.1g}%"


def _percentiles(histogram: np.ndarray) -> tuple[int, int]:
    """1st and 99th percentile of a histogram; its ends where these agree."""
    total = histogram.cumsum()
    if total[-1] == 0:
        return 0, 0
    low, high = np.searchsorted(total, (0.01 * total[-1], 0.99 * total[-1]))
    if low == high:
        low, high = np.flatnonzero(histogram)[[0, -1]]
    return int(low), int(high)
