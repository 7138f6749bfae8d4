"""What is known about a scan besides its points: ``Scene.meta``, and the entry "meta" of a grid's meta.json.

Each entry is declared once, here: the name of a field is its key in the file, its type is what a file must hold there, and its
default is the value for grids of earlier versions, which lack the entry.  :func:`described_scan` reads and checks an entry
"meta" (a grid may come from a stranger: its checksum proves nothing about who wrote it), viewer.picture.json_values.to_json
writes it.

Frame: file coordinates.  Order of the fields: that of the file.
"""

from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, Self

from ..common.rigid_transform import Rows, check_rigid
from ..picture.json_values import NOT_STORED, UNLESS_DEFAULT, Count, Factor, OwnJson, from_json
from .point_attributes import NO_ATTRIBUTES, AttributeLayout

IN_MEMORY = "points in memory"
"""What is shown instead of the files of points that were not read from files."""
DEGREE = "degree"
"""``units`` of geographic coordinates."""


@dataclass(frozen=True)
class ScanSummary:
    """A scan of a file.  count: its points in the grid.  position: (x, y, z) of its scanner, file coordinates; None where it is
    not known.  inferred: the position is not stated by the file but inferred from the order of its points."""

    name: str
    count: Count
    position: tuple[float, float, float] | None = None
    inferred: bool = field(default=False, metadata=UNLESS_DEFAULT)


@dataclass(frozen=True)
class ColourSummary:
    """How points are coloured.  source: "rgb", "intensity" or "height".  bits: of a channel in the files.  note: for a person.
    uncoloured: share of the points, 0..1, that are black because their colour is missing; None where that was not examined."""

    source: str
    bits: Count
    note: str
    uncoloured: float | None = field(default=None, metadata=UNLESS_DEFAULT)

    @property
    def of_files(self) -> bool:
        """Whether points have the colours that the files state."""
        return self.source == "rgb"


@dataclass(frozen=True)
class ExposureSummary:
    """Exposure compensation between stations.  stations: how many there are.  matched: of these, whose gain could be found.
    applied: whether colours were changed.  smallest_gain, largest_gain: factors of colour values."""

    stations: Count
    matched: Count
    applied: bool
    smallest_gain: float
    largest_gain: float


@dataclass(frozen=True)
class RunSummary:
    """Exposure compensation between runs of points.  variance_left: of the variance of luma between neighbours, the share that
    remains, 0..1.  applied: whether colours were changed."""

    variance_left: float
    applied: bool


@dataclass(frozen=True)
class DroppedPoints:
    """Points of the files that are not in the grid.  nan: without coordinates.  invalid: marked so by the file.  stray: too far
    from all others."""

    nan: Count = 0
    invalid: Count = 0
    stray: Count = 0


@dataclass(frozen=True)
class RecordOrigin:
    """What leads from running numbers to the records and scans of the files.

    first, scan_first: as ``first`` and ``scans`` in viewer.grid.records.point_records; None where they are not stored.  scans:
    number of scans of each source.  turns: by source that was split into stations, the running numbers of the points with which
    its second and later stations begin.  files: (path, bytes, time of the last change in ns) of each source when it was read;
    None for points that were in memory.  columns: what the columns of text files are, None where they were recognised.
    moves: by source the rigid transformation from the file's frame to that of the scene, None where they are one; (): all are.
    """

    first: tuple[Count, ...] | None = None
    scan_first: tuple[Count, ...] | None = None
    scans: tuple[Count, ...] = ()
    turns: dict[int, tuple[Count, ...]] = field(default_factory=dict)
    files: tuple[tuple[str, Count, Count], ...] | None = None
    columns: str | None = None
    moves: tuple[Rows | None, ...] = field(default=(), metadata=UNLESS_DEFAULT)

    def __post_init__(self) -> None:
        for rows in self.moves:
            if rows is not None:
                check_rigid(rows, "moves")

    def move_of(self, source: int) -> Rows | None:
        """The transformation of the source of this number; None: its coordinates are those of its file."""
        return self.moves[source] if source < len(self.moves) else None


class WarningTopic(Enum):
    """What a warning is about, where code acts on it.

    The value is in its text: meta.json has warnings as texts, so these words are part of the format of a grid.
    """

    LEFT_OUT = "left out: "
    """A file of several could not be opened."""
    DIFFERENT = "the files differ in their "
    """Units or reference systems."""
    PARTLY_UNKNOWN = "not all of the files tell their "
    """The unit."""
    PLACES = "the files are of "
    """They lie far apart."""
    DEGREES = "lengths and shapes are wrong; reproject it to metres: "
    """Coordinates are geographic ones."""


OF_SEVERAL = (WarningTopic.DIFFERENT, WarningTopic.PARTLY_UNKNOWN, WarningTopic.PLACES)
"""Topics of warnings that say that the files do not belong together."""


@dataclass(frozen=True)
class ScanWarning(OwnJson):
    """A warning about a scan, one line.  detail: all of it, or what stands behind the words of its topic.  subject:
    what stands before them, of DEGREES alone."""

    detail: str
    topic: WarningTopic | None = None
    subject: str = ""

    def __str__(self) -> str:
        return f"{self.subject}{self.topic.value if self.topic else ''}{self.detail}"

    def to_json(self) -> str:
        """See OwnJson."""
        return str(self)

    @classmethod
    def from_json(cls, data: Any, where: str) -> Self:
        """See OwnJson."""
        text = from_json(str, data, where)
        for topic in WarningTopic:
            subject, words, detail = text.partition(topic.value)
            if words and (not subject or topic is WarningTopic.DEGREES):
                return cls(detail, topic, subject)
        return cls(text)


@dataclass(frozen=True)
class Assigned:
    """What a person has assigned to a scan.  crs: the coordinate reference system, with its unit.  unit: the unit of length."""

    crs: bool = False
    unit: bool = False

    def __bool__(self) -> bool:
        return self.crs or self.unit

    @property
    def names(self) -> list[str]:
        """As ``pointglass info --json`` has them."""
        return [name for name, given in (("crs", self.crs), ("unit", self.unit)) if given]


@dataclass(frozen=True)
class ScanDescription:
    """Facts about a scan.

    sources: absolute paths of the files.  format: of the files, several separated by commas; None where it is not known.
    units: name of the unit of length, "degree", "mixed" or "unknown".  metres_per_unit: None where it is not known.  crs: name
    of the coordinate reference system, "mixed" where files differ, None where none states it.  match: whether exposure
    compensation was asked for; None for points that were in memory.  records: None in a
    folder of an earlier version.  colour, exposures, passes: None where nothing was decided.  attributes: besides colour and
    station.  scans: in the order of their numbers.  assigned: of a project: ``units`` and
    ``metres_per_unit``, perhaps ``crs``, are then not those of the files.
    """

    sources: tuple[str, ...] = ()
    format: str | None = None
    units: str = "unknown"
    metres_per_unit: Factor | None = None
    crs: str | None = None
    match: bool | None = field(default=None, metadata=UNLESS_DEFAULT)
    warnings: tuple[ScanWarning, ...] = ()
    records: RecordOrigin | None = None
    colour: ColourSummary | None = None
    exposures: ExposureSummary | None = None
    passes: RunSummary | None = None
    attributes: AttributeLayout = NO_ATTRIBUTES
    dropped: DroppedPoints = DroppedPoints()
    scans: tuple[ScanSummary, ...] = ()
    assigned: Assigned = field(default=Assigned(), metadata=NOT_STORED)

    @property
    def warning_texts(self) -> list[str]:
        """The warnings, one line each."""
        return [str(warning) for warning in self.warnings]

    def warnings_about(self, *topics: WarningTopic) -> list[ScanWarning]:
        """The warnings that have one of these topics."""
        return [warning for warning in self.warnings if warning.topic in topics]

    @property
    def title(self) -> str:
        """The files in a few words."""
        names = [Path(source).name for source in self.sources] or [IN_MEMORY]
        return names[0] + (f" and {len(names) - 1} more" if len(names) > 1 else "")

    @property
    def in_degrees(self) -> bool:
        """Whether coordinates are geographic ones."""
        return self.units == DEGREE

    @property
    def treats_black_as_missing(self) -> bool:
        """Whether black is treated as missing colour (viewer.preprocess.point_colour)."""
        return self.colour is not None and bool(self.colour.uncoloured)

    @property
    def stations_matched(self) -> bool:
        """Whether exposure compensation between stations has changed colours."""
        return self.exposures is not None and self.exposures.applied

    @property
    def runs_matched(self) -> bool:
        """Whether exposure compensation between runs of points has changed colours."""
        return self.passes is not None and self.passes.applied


NO_DESCRIPTION = ScanDescription()
"""Of points of which nothing is known."""


def described_scan(data: Any) -> ScanDescription:
    """The description in the entry "meta" of a grid.  Entries that are unknown are ignored.

    Raises InputError naming the first entry that a description cannot have.
    """
    return from_json(ScanDescription, data, "meta", strict=False)
