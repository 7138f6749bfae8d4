"""E57 through libe57: every scan of the file with its pose, read through buffers.

Units are metres by the standard; where ``coordinateMetadata`` is a reference system in another unit, that one, with a warning.
Coordinates are in the file's common frame: each scan's points are rotated and translated by its pose; the points of a scan
without a pose are taken to be in the common frame already.
"""

import logging
from collections.abc import Generator, Iterator, Sequence
from contextlib import ExitStack, closing, nullcontext
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from ...common.errors import InputError
from ...common.text import counted
from .. import crs
from ..column_source import RANGE_RUNS
from ..record_blocks import RecordBlocks
from ..sampling import interleaved
from ..source import AS_STORED, Chunk, Records, ScanInfo, Source
from .e57_blocks import e57_blocks
from .e57_columns import APART, BLOCK, Wanted, column_blocks, decoded_apart
from .e57_conversion import converted
from .e57_length import length_warning
from .e57_nodes import check_prototypes, child, is_number, library, open_e57, point_vectors, pose_of, text_of, xml_of
from .e57_packets import PacketReader, UnknownPacking
from .e57_ranges import colour_range, intensity_range, range_of, trusted, zeros
from .e57_records import RawField, columns_of, raw_records

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
_RGB = ("colorRed", "colorGreen", "colorBlue")
_NO_COLOUR, _NO_INTENSITY = "isColorInvalid", "isIntensityInvalid"  # 1 where a point has none
_log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class _Scan:
    """rotation: (3, 3), translation: (3,), scan to file.  zero, full: values of a black and of a full colour channel.
    narrow: colour is 8 bits wide.  intensity: range, or None where it must be measured."""

    count: int
    fields: frozenset[str]
    rotation: np.ndarray
    translation: np.ndarray
    zero: float = 0.0
    full: float = 255.0
    narrow: bool = True
    intensity: tuple[float, float] | None = None

    @property
    def coordinates(self) -> tuple[str, str, str]:
        return _CARTESIAN if set(_CARTESIAN) <= self.fields else _SPHERICAL

    @property
    def state(self) -> str:
        """The field that marks points without a return."""
        return "cartesianInvalidState" if self.coordinates is _CARTESIAN else "sphericalInvalidState"

    @property
    def wanted(self) -> list[str]:
        """The fields that are read."""
        colour = (*_RGB, _NO_COLOUR) if set(_RGB) <= self.fields else ()
        return [*self.coordinates, *(f for f in (self.state, "intensity", *colour, _NO_INTENSITY) if f in self.fields)]


class E57Source(Source):
    """One .e57 file.  Raises InputError where libe57 refuses it (checksum, length, XML) or it has no points."""

    def __init__(self, path: Path):
        super().__init__(path, "E57", units="metre", metres_per_unit=1.0)
        self.warnings += [text for text in [length_warning(path)] if text]
        self._scans: list[_Scan] = []
        self._blocks: RecordBlocks | bool | None = None  # False: only libe57 decodes its points
        self._indexing = Lock()
        with open_e57(self.path) as file:
            root = file.root()
            self._take_system(text_of(root, "coordinateMetadata"))  # with its unit
            data = child(root, "data3D", "Vector") or ()
            self._xml = xml_of(path)
            check_prototypes(path, self._xml)
            for i in range(len(data)):
                self._add(i, data[i])
        self.count = sum(scan.count for scan in self._scans)
        if not self.scans:
            raise InputError("holds no scans (an E57 without data3D entries)", file=path, remedy="export it with points")
        if self.count == 0:
            raise InputError(f"holds no points ({counted(len(self.scans), 'empty scan')})", file=path, remedy="export it again")
        self._ranges: dict[int, tuple[float, float]] = {}
        self._no_returns: dict[int, bool] = {}  # by scan without a state: whether points at the scanner are none

    def _take_system(self, text: str) -> None:
        self.crs, unit, metres = crs.from_text(text)
        if unit == "degree" or (metres is not None and abs(metres - 1) > 1e-7):
            self.units, self.metres_per_unit = unit, metres
            said = "coordinates are taken to be in it, although E57 counts in metres"
            self.warnings.append(f"{self.path.name}: coordinateMetadata is in {unit}: {said}")

    def _add(self, number: int, node) -> None:
        if not isinstance(node, library().StructureNode):
            raise InputError(f"damaged: data3D[{number}] is not a Structure", file=self.path, remedy="copy or export it again")
        name = text_of(node, "name") or f"scan {number + 1}"
        rotation, translation, position = np.eye(3), np.zeros(3), None
        if node.isDefined("pose"):
            placed = pose_of(node)
            if placed is None:
                self.warnings.append(f"{self.path.name}: pose of {name!r} is not usable, its points are not moved")
            else:
                rotation, translation = placed
                position = tuple(translation.tolist())
        self.scans.append(ScanInfo(name, position))
        points = child(node, "points", "CompressedVector")
        if points is None and node.isDefined("points"):
            what = f"data3D[{number}]/points is not a CompressedVector"
            raise InputError(f"damaged: {what}", file=self.path, remedy="copy or export it again")
        count = int(points.childCount()) if points is not None else 0
        if points is None or count == 0:
            self._scans.append(_Scan(0, frozenset(), rotation, translation))
            return
        prototype = library().StructureNode(points.prototype())
        fields = [prototype[i] for i in range(prototype.childCount())]
        nodes = {field.elementName(): field for field in fields if is_number(field)}
        if not (set(_CARTESIAN) <= set(nodes) or set(_SPHERICAL) <= set(nodes)):
            raise InputError(f"{name!r} has neither cartesian nor spherical coordinates", file=self.path,
                             remedy="export it again")
        colour = colour_range(node, nodes) if set(_RGB) <= set(nodes) else (0.0, 255.0, True)
        intensity = intensity_range(node, nodes) if "intensity" in nodes else None
        self._scans.append(_Scan(count, frozenset(nodes), rotation, translation, *colour, intensity))

    def chunks(self) -> Iterator[Chunk]:
        """Yields the valid points of scan after scan."""
        asked = [Wanted(number, scan.count, tuple(scan.wanted)) for number, scan in enumerate(self._scans) if scan.count]
        apart = (self.count or 0) >= APART
        # libe57 parses the description of all scans whenever it opens a file: once, and not where another process does
        with nullcontext() if apart else open_e57(self.path) as file:
            for wanted in asked:  # here: a file has one reader at a time
                if "intensity" in wanted.names and self._scans[wanted.number].intensity is None:
                    self._measure_intensity(wanted.number, file)
            blocks = decoded_apart(self.path, asked, BLOCK) if apart else self._decoded(asked, file)
            done = {wanted.number: 0 for wanted in asked}
            with closing(blocks):
                for number, columns in blocks:
                    done[number] += len(columns[self._scans[number].coordinates[0]])
                    yield self._chunk(number, self._scans[number], columns, self._intensity_of(number, columns))
        for wanted in asked:
            if done[wanted.number] < wanted.count:
                raise self._truncated(wanted.number, done[wanted.number])

    def _decoded(self, asked: list[Wanted], file: Any) -> Generator[tuple[int, dict[str, np.ndarray]], None, None]:
        """As e57_columns.decoded_apart, in this process."""
        for wanted in asked:
            for columns in self._columns(wanted.number, wanted.names, file, copied=False):
                yield wanted.number, columns

    def record_chunks(self) -> Iterator[Records]:
        """See Source.  columns: every field besides coordinates, colour and marks of missing values."""
        return self.column_chunks()

    def column_chunks(self, name: str | None = None) -> Iterator[Records]:
        with open_e57(self.path) as file:
            for number, scan in enumerate(self._scans):
                if not scan.count:
                    continue
                done = 0
                for n, fields, raw in raw_records(file, number, scan.count, name):
                    valid, chunk = self.placed(number, fields, raw)
                    raw = raw if valid is None else {name: values[valid] for name, values in raw.items()}
                    done += n
                    yield Records(chunk.xyz, chunk.rgb, number, columns_of(fields, raw))
                if done < scan.count:
                    raise self._truncated(number, done)

    def colour_range(self, number: int) -> tuple[float, float]:
        """Values of a black and of a full channel of a scan."""
        return self._scans[number].zero, self._scans[number].full

    def placed(self, number: int, fields: list[RawField], raw: dict[str, np.ndarray]) -> tuple[np.ndarray | None, Chunk]:
        """Which records of a block are points, (n,) bool or None for all, and these points.  raw: fields of scan ``number`` as
        stored."""
        scan = self._scans[number]
        with np.errstate(invalid="ignore"):  # a signalling NaN is a NaN like others
            columns = {field.name: np.asarray(field.scaled(raw[field.name]), np.float64) for field in fields
                       if field.name in scan.wanted}  # fmt: skip
        chunk = self._chunk(number, scan, columns, scan.intensity or (0.0, 1.0))
        return self.valid_records(number, columns), chunk

    def records(self, numbers: np.ndarray) -> Records:
        """See Source: by packets, where these can be decoded here.  Checksums of pages are not checked."""
        with self._indexing:
            if self._blocks is None:
                self._blocks = self._made_blocks() or False
        return self._blocks.take(numbers) if isinstance(self._blocks, RecordBlocks) else super().records(numbers)

    @property
    def has_quick_records(self) -> bool:
        return bool(self._blocks)

    def _made_blocks(self) -> RecordBlocks | None:
        vectors = point_vectors(self._xml, [scan.count for scan in self._scans])
        if vectors is None:
            return None
        deciding = [[scan.state] if scan.state in scan.fields else list(scan.coordinates) for scan in self._scans]
        return e57_blocks(self, vectors, deciding)

    def sample(self, points: int, run: int) -> Iterator[Chunk] | None:
        """See Source; None where the points are packed in a way that only libe57 decodes.  Checksums are not checked.  Where
        the file gives no range of intensities, that of the scan's first RANGE_RUNS runs stands for it."""
        vectors = point_vectors(self._xml, [scan.count for scan in self._scans])
        if vectors is None:
            return None
        with ExitStack() as opened:
            file = opened.enter_context(self.path.open("rb"))
            readers: list[PacketReader | None] = []
            try:
                readers += [None if vector is None else PacketReader(self.path, file, vector) for vector in vectors]
            except UnknownPacking as error:
                _log.info("%s: no sample of it: %s", self.path, error)
                return None
            return self._sampled(readers, points, run, opened.pop_all())

    def _sampled(self, readers: "list[PacketReader | None]", points: int, run: int, opened: ExitStack) -> Iterator[Chunk]:
        ranges: dict[int, tuple[float, float]] = {}
        counts = [reader.count if reader else 0 for reader in readers]
        with opened:
            runs = interleaved(counts, points, run)
            for number, start in runs:
                scan, reader = self._scans[number], readers[number]
                assert reader is not None
                columns = reader.read(start, run, scan.wanted)
                if "intensity" in columns and number not in ranges:
                    first = [place for of, place in runs if of == number][:RANGE_RUNS]
                    values = np.concatenate([reader.read(place, run, ["intensity"])["intensity"] for place in first])
                    ranges[number] = trusted(scan.intensity, values) or range_of([values])
                yield self._chunk(number, scan, columns, ranges.get(number, (0.0, 0.0)))

    def _chunk(self, number: int, scan: _Scan, columns: dict[str, np.ndarray], intensities: tuple[float, float]) -> Chunk:
        """columns: scaled, of ``scan.wanted``.  intensities: range that becomes the whole of uint16."""
        valid = self.valid_records(number, columns)
        if scan.coordinates is _CARTESIAN:
            local = tuple(columns[name] for name in _CARTESIAN)
        else:
            r, azimuth, elevation = (columns[name] for name in _SPHERICAL)
            with np.errstate(invalid="ignore", over="ignore"):  # the grid drops and counts values that are not finite
                flat = r * np.cos(elevation)
                local = flat * np.cos(azimuth), flat * np.sin(azimuth), r * np.sin(elevation)
        turned = not np.array_equal(scan.rotation, np.eye(3))
        xyz, rgb, intensity = converted(
            local, tuple(columns[name] for name in _RGB if name in columns), columns.get("intensity"),
            columns.get(_NO_COLOUR), columns.get(_NO_INTENSITY), valid, shift=np.zeros(3) if turned else scan.translation,
            colour_range=(scan.zero, scan.full), intensity_range=intensities, narrow=scan.narrow,
        )  # fmt: skip
        if turned:
            with np.errstate(invalid="ignore", over="ignore"):
                xyz = xyz @ scan.rotation.T + scan.translation
        return Chunk(xyz, rgb, intensity, number, len(local[0]) - len(xyz))

    def valid_records(self, number: int, columns: dict[str, np.ndarray]) -> np.ndarray | None:
        """(n,) bool: which records are points, not directions without a return; None: all."""
        scan = self._scans[number]
        if scan.state in columns:
            return columns[scan.state] == 0  # 1: only the direction is known, 2: nothing
        names = _CARTESIAN if scan.coordinates is _CARTESIAN else _SPHERICAL[:1]
        nothing = zeros([columns[name] for name in names])
        found = int(nothing.sum())
        if found == 1 and number not in self._no_returns:  # a point, unless there are more of them
            found = sum(int(zeros(list(block.values())).sum()) for block in self._columns(number, list(names)))
        if found:
            self._no_returns.setdefault(number, found > 1)
        if not self._no_returns.get(number, False):
            return None
        text = f"{self.path.name}: {self.scans[number].name!r} has points at the place of its scanner itself (0, 0, 0), as "
        text += "some writers store directions without a return; they are left out"
        if text not in self.warnings:
            self.warnings.append(text)
        return ~nothing

    @property
    def intensity_ends(self) -> tuple[float, float]:
        ends = set(self._ranges.values())
        if not ends:
            return AS_STORED
        return ends.pop() if len(ends) == 1 else (float("nan"), float("nan"))

    def _intensity_of(self, number: int, columns: dict[str, np.ndarray]) -> tuple[float, float]:
        """Range of a scan's intensities.  Where the file gives none, or one that its first block contradicts, that field is
        read once."""
        if "intensity" not in columns:
            return 0.0, 0.0
        if number not in self._ranges:
            stated = trusted(self._scans[number].intensity, columns["intensity"])
            if stated is None:
                self._measure_intensity(number)
            else:
                self._ranges[number] = stated
        return self._ranges[number]

    def _measure_intensity(self, number: int, file: Any = None) -> None:
        if number not in self._ranges:
            self._ranges[number] = range_of(found["intensity"] for found in self._columns(number, ["intensity"], file))

    def _columns(
        self, number: int, names: Sequence[str], file: Any = None, *, copied: bool = True
    ) -> Iterator[dict[str, np.ndarray]]:
        """Yields fields of one scan as scaled float64, BLOCK points at a time.  file: as opened; None: it is opened.
        copied: False: arrays are valid until the next are read."""
        wanted, done = Wanted(number, self._scans[number].count, tuple(names)), 0
        with open_e57(self.path) if file is None else nullcontext(file) as file:
            for columns in column_blocks(file, wanted, BLOCK):
                done += len(columns[names[0]])
                yield {name: values.copy() if copied else values for name, values in columns.items()}
        if done < wanted.count:
            raise self._truncated(number, done)

    def _truncated(self, number: int, done: int) -> InputError:
        return InputError(f"truncated: {done:,} of {self._scans[number].count:,} points of {self.scans[number].name!r} could "
                          "be read", file=self.path, remedy="copy or export it again")
