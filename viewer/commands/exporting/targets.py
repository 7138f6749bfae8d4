"""Which writer makes a file: a copy of whole records where source and target have one format, else columns."""

from collections.abc import Sequence
from pathlib import Path

from ...common.errors import InputError
from ...work.selection import Selection
from .columns import GridColumns, SourceColumns, survey
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
from .record_stream import SourceRecords, refuse_empty, why_gone
from .reproject import Reprojected
from .whole_file import can_copy as can_copy_file
from .whole_file import copy_file

ENDINGS = (".las", ".laz", ".ply", ".e57")
_BYTES = {".ply": 32, ".las": 30, ".laz": 6, ".e57": 20}
"""Of a point at least, to refuse a full disk before the work."""


def check_ending(path: Path) -> None:
    """Raises InputError unless the name's ending is known."""
    if path.suffix.lower() not in ENDINGS:
        raise InputError(f"--out {path}: expected a name ending in {', '.join(ENDINGS)}")


def bytes_needed(path: Path, selection: Selection) -> int:
    """A low estimate of a file's size; 0 where a selection decides it."""
    if selection.clips or selection.within or selection.hidden:
        return 0
    return selection.scene.count * _BYTES[path.suffix.lower()]


def write(
    path: Path, selection: Selection, losses: Losses, *, columns: str | None, matched: bool, all_columns: bool,
    reproject: str | None = None,
) -> int:  # fmt: skip
    """Writes the file; returns the number of points.  reproject: as from reproject.target_of.

    Raises InputError, also where the selection leaves no point."""
    scene, kind = selection.scene, path.suffix.lower()
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
    if reproject is None and can_copy_file(records, kind):
        return copy_file(path, records)
    reference = Reference() if reproject is not None else reference_of(scene.meta, records.sources, losses)
    if reproject is None and kind in (".las", ".laz") and can_copy_las(records.sources):
        count = copy_las(path, records, reference, losses)
    elif reproject is None and kind == ".e57" and can_copy_e57(records.sources) and to_metres(scene.meta, reference) is None:
        tell_unit(scene.meta, reference, losses)
        count = copy_e57(path, records, reference, losses)
    else:
        stream = moved = SourceColumns(records)
        precision = max(source.precision for source in records.sources)
        if reproject is not None:
            moved, precision = Reprojected(stream, scene, records.sources, reproject, losses), 2.0**-53
            reference = moved.reference
        name_left_behind(records.sources, kind, losses)
        kept = kept_records(records.sources, losses) if kind in (".las", ".laz") else ()
        count = _write_columns(path, moved, selection, reference, losses, precision, all_columns, kept)
        if stream.lost or stream.far:
            losses.add(f"{stream.lost + stream.far:,} records without a usable position are left out")
    for source in records.sources:
        for text in source.record_losses:
            losses.add(text)
    if count == 0:
        raise refuse_empty(scene)
    return count


def _write_columns(
    path: Path, stream, selection: Selection, reference, losses: Losses, precision: float, all_columns: bool,
    kept: Sequence[Record] = (),
) -> int:
    kind, meta = path.suffix.lower(), selection.scene.meta
    sources = [Path(name) for name in meta.get("sources") or []]
    found = survey(stream)
    if isinstance(stream, Reprojected):
        stream.check(found, kind)
        meta, reference = stream.meta, stream.reference
    if found.count == 0:
        raise refuse_empty(selection.scene)
    if kind == ".ply":
        write_ply(path, stream, found, reference, losses, crs=meta.get("crs"), units=meta.get("units"), all_columns=all_columns)
    elif kind == ".e57":
        tell_unit(meta, reference, losses)
        factor = to_metres(meta, reference)
        write_e57(path, stream if factor is None else Metres(stream, factor), found, reference, losses)
    else:
        degrees, standard = meta.get("units") == "degree", has_standard_time(sources)
        write_las(
            path, stream, found, reference, losses, precision=precision, degrees=degrees, standard_time=standard, records=kept
        )
    return found.count
