"""The interface of every reader: facts about a scan file, and its points in chunks, as often as needed.

Coordinates are float64 in the file's own frame and units.  A reader never holds more than one chunk.  It leaves out points
that the file marks as invalid and counts them in the chunk; values that are not finite are passed on, and dropped by the grid.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

CHUNK = 1 << 20
"""Points of the largest chunk; chosen by hand: 24 MB of coordinates."""


@dataclass(frozen=True)
class ScanInfo:
    """One scanner station, or one file that does not state its stations.  position: (x, y, z) of the scanner, file coordinates.
    inferred: the position is not stated by the file but inferred from the order of its points."""

    name: str
    position: tuple[float, float, float] | None = None
    inferred: bool = False


@dataclass(frozen=True, eq=False)
class Chunk:
    """Up to CHUNK points of one scan.

    xyz: (n, 3) float64.  rgb: (n, 3) uint8, or uint16 where the file's fields are 16 bits wide, or None.
    intensity: (n,) uint16 or None.  scan: index into the source's ``scans``, or (n,) uint8, one for each point.
    invalid: points left out of this chunk because the file marks them as invalid.
    station: (n,) ids of the scanner positions or flight lines within the scan, where the file has them.
    classification: (n,) uint8 codes of the ASPRS LAS specification (2 ground, 6 building, ...) or the file's own; or None.
    """

    xyz: np.ndarray
    rgb: np.ndarray | None = None
    intensity: np.ndarray | None = None
    scan: int | np.ndarray = 0
    invalid: int = 0
    station: np.ndarray | None = None
    classification: np.ndarray | None = None


@dataclass(eq=False)
class Source:
    """A readable scan.  Subclasses fill the facts on construction and implement ``chunks``.

    count: points in the file by its header, None where it does not state them.  precision: relative resolution of the stored
    coordinates (2**-24 for float32).  metres_per_unit: None where the file does not state it.
    """

    path: Path
    format: str
    count: int | None = None
    units: str = "unknown"
    metres_per_unit: float | None = None
    crs: str | None = None
    precision: float = 2.0**-53
    scans: list[ScanInfo] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    def chunks(self) -> Iterator[Chunk]:
        """Yields the points from the beginning.  Raises InputError where the file is damaged."""
        raise NotImplementedError

    def sample(self, points: int, run: int) -> Iterator[Chunk] | None:
        """Yields runs of ``run`` points spread over the file, about ``points`` in all, without reading the rest.  Returns None
        where that is impossible.  Raises InputError where the file is damaged."""
        return None


def surplus_warning(path: Path, count: int | None) -> str:
    """The warning about a file that holds more points than its header states."""
    return f"{path.name}: its header counts {count:,} points, but more follow; they are left out, it may be damaged"


def stretch(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Maps ``low..high`` linearly to 0..65535, uint16, and clips; NaN becomes 0."""
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = (np.asarray(values, np.float64) - low) * (65535.0 / (high - low) if high > low else 0.0)
        return np.clip(np.nan_to_num(scaled, nan=0.0) + 0.5, 0, 65535).astype(np.uint16)
