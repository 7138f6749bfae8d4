"""Which writer makes a file: a copy of whole records where source and target have one format, else columns."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ...common.errors import InputError
from ...preprocess.scan_description import ScanDescription
from ...work.selecting.empty_selection import empty_selection
from ...work.selection import Selection
from .columns import GridColumns, SourceColumns, Stream, Survey, survey
from .crs_records import Reference, reference_of, without_sources
from .formats.e57_copy import can_copy as can_copy_e57
from .formats.e57_copy import copy_e57
from .formats.e57_units import Metres, tell_unit, to_metres
from .formats.e57_writer import write_e57
from .formats.las_copy import can_copy as can_copy_las
from .formats.las_copy import copy_las
from .formats.las_layout import Record
from .formats.las_writer import has_standard_time, write_las
from .formats.ply_writer import write_ply
from .left_behind import kept_records, name_left_behind
from .losses import Losses
from .record_stream import SourceRecords, why_gone
from .reproject import Reprojected
from .target import Target
from .whole_file import can_copy as can_copy_file
from .whole_file import copy_file


def check_ending(path: Path, also: Sequence[str] = ()) -> None:
    """Raises InputError unless the name's ending is known.  also: further endings, for the message."""
    if path.suffix.lower() not in TARGETS:
        raise InputError(f"expected a name ending in {', '.join([*TARGETS, *also])}", option="--out", value=path)


def bytes_needed(path: Path, selection: Selection) -> int:
    """A low estimate of a file's size; 0 where a selection decides it."""
    if not selection.everything:
        return 0
    return selection.scene.count * TARGETS[path.suffix.lower()].least_bytes


def write(
    path: Path, selection: Selection, losses: Losses, *, columns: str | None, matched: bool, all_columns: bool,
    reproject: str | None = None,
) -> int:  # fmt: skip
    """Writes the file; returns the number of points.  reproject: as from reproject.target_of.

    Raises InputError, also where the selection leaves no point."""
    scene, target = selection.scene, TARGETS[path.suffix.lower()]
    if (reason := why_gone(scene)) is not None:
        losses.add(
            f"{reason}: points are written as the grid has them, {scene.step / 2:.2g} file units exact, without other columns"
            + (" and with matched exposures" if scene.matched else "")
        )
        grid = GridColumns(selection)
        if reproject is not None:
            grid = Reprojected(grid, scene, (), reproject, losses)
        return _write_columns(path, grid, selection, without_sources(scene.meta), losses, 2.0**-53, all_columns)
    records = SourceRecords(selection, columns, matched=matched)
    if reproject is None and can_copy_file(records, target):
        return copy_file(path, records)
    reference = Reference() if reproject is not None else reference_of(scene.meta, records.files, losses)
    count = None
    if reproject is None and target.copy is not None:
        count = target.copy(path, records, scene.meta, reference, losses)
    if count is None:
        stream = moved = SourceColumns(records)
        precision = max(source.precision_within(scene.bounds) for source in records.sources)
        if reproject is not None:
            moved, precision = Reprojected(stream, scene, records.files, reproject, losses), 2.0**-53
            reference = moved.reference
        name_left_behind(records.files, target, losses)
        kept = kept_records(records.files, losses) if target.las else ()
        count = _write_columns(path, moved, selection, reference, losses, precision, all_columns, kept)
        if stream.lost or stream.far:
            losses.add(f"{stream.lost + stream.far:,} records without a usable position are left out")
    for source in records.sources:
        for text in source.record_losses:
            losses.add(text)
    if count == 0:
        raise empty_selection(selection)
    return count


def _write_columns(
    path: Path, stream, selection: Selection, reference: Reference, losses: Losses, precision: float, all_columns: bool,
    kept: Sequence[Record] = (),
) -> int:
    target, meta = TARGETS[path.suffix.lower()], selection.scene.meta
    sources = [Path(name) for name in meta.sources]
    found = survey(stream)
    if isinstance(stream, Reprojected):
        stream.check(found, target)
        meta, reference = stream.meta, stream.reference
    if found.count == 0:
        raise empty_selection(selection)
    target.write(Columns(path, stream, found, reference, losses, meta, sources, precision, all_columns, kept))
    return found.count


@dataclass(frozen=True, eq=False)
class Columns:
    """What a file is written from.  found: of ``stream``.  meta: of the scene, or of reprojected points.  sources: its files.
    precision: of the sources' numbers.  all_columns: PLY only.  kept: further records, LAS only."""

    path: Path
    stream: Stream
    found: Survey
    reference: Reference
    losses: Losses
    meta: ScanDescription
    sources: list[Path]
    precision: float
    all_columns: bool
    kept: Sequence[Record]


def _write_las(given: Columns) -> None:
    degrees, standard = given.meta.in_degrees, has_standard_time(given.sources)
    write_las(given.path, given.stream, given.found, given.reference, given.losses, precision=given.precision, degrees=degrees,
              standard_time=standard, records=given.kept)


def _copy_las(path: Path, records: SourceRecords, _: dict, reference: Reference, losses: Losses) -> int | None:
    return copy_las(path, records, reference, losses) if can_copy_las(records) else None


def _write_ply(given: Columns) -> None:
    write_ply(given.path, given.stream, given.found, given.reference, given.losses, crs=given.meta.crs,
              units=given.meta.units, all_columns=given.all_columns)


def _write_e57(given: Columns) -> None:
    tell_unit(given.meta, given.reference, given.losses)
    factor = to_metres(given.meta, given.reference)
    stream = given.stream if factor is None else Metres(given.stream, factor)
    write_e57(given.path, stream, given.found, given.reference, given.losses)


def _copy_e57(path: Path, records: SourceRecords, meta: ScanDescription, reference: Reference, losses: Losses) -> int | None:
    if not can_copy_e57(records.files) or to_metres(meta, reference) is not None:
        return None
    tell_unit(meta, reference, losses)
    return copy_e57(path, records, reference, losses)


TARGETS: dict[str, Target] = {
    ".las": Target("LAS", 30, _write_las, ("LAS",), _copy_las, las=True),
    ".laz": Target("LAZ", 6, _write_las, ("LAZ", "COPC"), _copy_las, las=True),
    ".ply": Target("PLY", 32, _write_ply),
    ".e57": Target("E57", 20, _write_e57, ("E57",), _copy_e57, poses=True),
}
"""Ending of a file's name -> its format."""
