"""The interface of every reader: facts about a scan file, and its points in chunks, as often as needed.

Coordinates are float64 in the file's own frame and units.  A reader never holds more than one chunk.  It leaves out points
that the file marks as invalid and counts them in the chunk; values that are not finite are passed on, and dropped by the grid.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..common.errors import InputError

CHUNK = 1 << 20
"""Points of the largest chunk: 24 MB of coordinates, as float64."""
LONGEST_HEADER_LINE = 8192
"""Bytes of a line of a header in text (PLY, PCD): the line FIELDS of a PCD file may name a thousand fields of seven letters."""


AS_STORED = (0.0, 65535.0)
"""The ends of intensities that are those of the file."""


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


@dataclass(frozen=True, eq=False)
class Records:
    """Whole records of points, as the file stores them; for export, and for what is shown of single points.

    xyz: (n, 3) float64, file coordinates, poses applied.  rgb: (n, 3) uint8 or uint16, of the file's own depth, or None.
    scan: index into the source's ``scans``, or (n,) of them.
    columns: name -> (n,) or (n, k) array in the file's own type and scale, NaN where a record has no value: "intensity",
        "classification", "gps_time", "return_number" and so on, named as laspy names them; other fields by their name in the
        file.
    native: the records as the format's own library holds them, for a writer of the same format; None where there is none.
    """

    xyz: np.ndarray
    rgb: np.ndarray | None = None
    scan: int | np.ndarray = 0
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    native: Any = None


@dataclass(eq=False)
class Source:
    """A readable scan.  Subclasses fill the facts on construction and implement ``chunks``.

    count: points in the file by its header, None where it does not state them.  precision: relative resolution of the stored
    coordinates (2**-24 for float32).  metres_per_unit: None where the file does not state it.
    """

    worth_keeping: ClassVar[bool] = True
    """Whether decoding the points takes longer than keeping them for a second walk."""

    path: Path
    format: str
    count: int | None = None
    units: str = "unknown"
    metres_per_unit: float | None = None
    crs: str | None = None
    precision: float = 2.0**-53
    scans: list[ScanInfo] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    crs_text: str | None = None
    """The definition of ``crs`` as the file has it, where it is a text."""
    record_losses: list[str] = field(default_factory=list)
    """Sentences about what of the file is not in its records; complete once ``record_chunks`` has been read to its end."""

    def chunks(self) -> Iterator[Chunk]:
        """Yields the points from the beginning.  Raises InputError where the file is damaged."""
        raise NotImplementedError

    def record_chunks(self) -> Iterator[Records]:
        """Yields the points that ``chunks`` yields, in the same order and pieces, with all that the file says of them."""
        for chunk in self.chunks():
            known = {"intensity": chunk.intensity, "classification": chunk.classification, "point_source_id": chunk.station}
            columns = {name: np.asarray(values) for name, values in known.items() if values is not None}
            yield Records(chunk.xyz, chunk.rgb, chunk.scan, columns)

    def column_chunks(self, name: str) -> Iterator[Records]:
        """Yields the points of ``record_chunks``, in pieces of any size, with ``xyz`` and the one column of this name ("xyz",
        "rgb" or another); others may be missing.  Formats in which fields can be left out override it."""
        if name == "xyz":
            return (Records(chunk.xyz, scan=chunk.scan) for chunk in self.chunks())
        return self.record_chunks()

    def records(self, numbers: np.ndarray) -> Records:
        """The records with these running numbers, (n,) int64 ascending, each once; number i is the i-th point of ``chunks``.

        Reads the file from its beginning; formats with random access override it.  Raises InputError where the file is
        damaged, or has fewer points than it had.
        """
        found, first = [], 0
        for records in self.record_chunks():
            low, high = np.searchsorted(numbers, (first, first + len(records.xyz)))
            if low < high:
                found.append(taken(records, numbers[low:high] - first))
            first += len(records.xyz)
            if high == len(numbers):
                break
        else:
            raise InputError(f"has {first:,} points, fewer than when its grid was built", file=self.path,
                             remedy="open it again")
        return joined(found)

    @property
    def intensity_ends(self) -> tuple[float, float]:
        """The file's intensities that 0 and 65535 in ``Chunk.intensity`` stand for; known once the points have been read.
        (0, 65535): they are the file's own.  (nan, nan): scans of the file differ."""
        return AS_STORED

    @property
    def has_quick_records(self) -> bool:
        """Whether ``records`` takes less than about 0.1 s for a few records: it does not read the file from its beginning."""
        return False

    def precision_within(self, bounds: np.ndarray) -> float:
        """``precision`` of coordinates within bounds (2, 3), relative to the largest of them."""
        return self.precision

    def sample(self, points: int, run: int) -> Iterator[Chunk] | None:
        """Yields runs of ``run`` points spread over the file, about ``points`` in all, without reading the rest.  Returns None
        where that is impossible.  Raises InputError where the file is damaged."""
        return None


def taken(records: Records, index: np.ndarray) -> Records:
    """Some of the records: those at ``index``, whole numbers or a mask."""
    return Records(
        records.xyz[index],
        None if records.rgb is None else records.rgb[index],
        records.scan[index] if isinstance(records.scan, np.ndarray) else records.scan,
        {name: values[index] for name, values in records.columns.items()},
        None if records.native is None else records.native[index],
    )


def joined(parts: Sequence[Records]) -> Records:
    """Records of one source behind each other, without their native form."""
    if len(parts) == 1:
        return parts[0]
    scans = [np.broadcast_to(np.asarray(part.scan), len(part.xyz)) for part in parts]
    names = dict.fromkeys(name for part in parts for name in part.columns)
    return Records(
        np.concatenate([part.xyz for part in parts]) if parts else np.empty((0, 3)),
        _joined_rgb(parts),
        np.concatenate(scans) if parts else 0,
        {name: _joined_column(parts, name) for name in names},
    )


def _joined_rgb(parts: Sequence[Records]) -> np.ndarray | None:
    """Colours of all parts, black where a part has none; None where no part has any."""
    if all(part.rgb is None for part in parts):
        return None
    return np.concatenate([np.zeros((len(part.xyz), 3), np.uint8) if part.rgb is None else part.rgb for part in parts])


def _joined_column(parts: Sequence[Records], name: str) -> np.ndarray:
    """A column of all parts, NaN where a part (a scan of an E57, say) does not have it."""
    shape = next(part.columns[name].shape[1:] for part in parts if name in part.columns)
    return np.concatenate([part.columns[name] if name in part.columns else np.full((len(part.xyz), *shape), np.nan)
                           for part in parts])


def surplus_warning(path: Path, count: int | None) -> str:
    """The warning about a file that holds more points than its header states."""
    return f"{path.name}: its header counts {count:,} points, but more follow; they are left out, it may be damaged"


def stretch(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Maps ``low..high`` linearly to 0..65535, uint16, and clips; NaN becomes 0."""
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = (np.asarray(values, np.float64) - low) * (65535.0 / (high - low) if high > low else 0.0)
        return np.clip(np.nan_to_num(scaled, nan=0.0) + 0.5, 0, 65535).astype(np.uint16)
