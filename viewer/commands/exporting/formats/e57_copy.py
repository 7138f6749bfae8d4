"""E57 to E57: every field of every record with its type and limits, every pose, photograph and further node of the file.

Without a selection the records that a file marks as invalid are copied too.  With one, a scan of which no record is left is
omitted, and so are the photographs that belong to it; bounds are written anew; groups of records, which count records, are
omitted.  ``losses`` names what is omitted.  Scans of several files follow each other.
"""

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ....common.rigid_transform import Rows, moved_points
from ....common.text import counted
from ....readers.e57.e57_nodes import child, library, open_e57, text_of
from ....readers.e57.e57_records import BLOCK, RawField, arrays_for, buffers_of, fields_of, raw_blocks
from ....readers.e57.e57_source import E57Source
from ..crs_records import Reference
from ..left_behind import name_texts, omitted
from ..losses import Losses
from ..record_stream import SourceRecords
from .e57_bounds import RecordBounds
from .e57_file import COLOURS, NodeCopy, as_stored, header, new_file, writer_of
from .e57_poses import moved_pose_node

_WRITTEN = (
    "data3D",
    "images2D",
    "formatName",
    "versionMajor",
    "versionMinor",
    "e57LibraryVersion",
    "coordinateMetadata",
    "guid",
)
_BY_RECORDS = ("cartesianBounds", "sphericalBounds", "pointGroupingSchemes")
"""Children of a scan that are not true of a part of its records."""


def can_copy(sources: list) -> bool:
    """Whether all sources are E57 files."""
    return all(isinstance(source, E57Source) for source in sources)


def copy_e57(path: Path, stream: SourceRecords, reference: Reference, losses: Losses) -> int:
    """Writes the selected records; returns how many."""
    libe57 = library()
    written, running, gone = 0, 0, _Omitted()
    with ExitStack() as stack:
        image = stack.enter_context(new_file(path))
        files = [stack.enter_context(open_e57(source.path)) for source in stream.files]
        copy, root = NodeCopy(image), image.root()
        _extensions(image, files, losses)
        first = files[0].root()
        own = text_of(first, "guid") if len(files) == 1 else ""
        header(image, {"coordinateMetadata": _metadata(files, reference)} | ({"guid": own} if own else {}))
        scans, images = libe57.VectorNode(image, True), libe57.VectorNode(image, True)
        root.set("data3D", scans)
        root.set("images2D", images)
        for index in range(first.childCount()):
            node = first[index]
            if node.elementName() not in _WRITTEN:
                root.set(node.elementName(), copy.copied(node, files[0]))
        copy.finish()
        with stream.meter("writing") as meter:
            for source, file, number in zip(stream.files, files, range(len(files)), strict=True):
                assert isinstance(source, E57Source)
                task = _Scans(stream, source, file, number, copy, scans, meter, gone)
                running, count = task.copy_all(running)
                written += count
                gone.photographs += _copy_images(file, images, copy, task.left_out - task.kept, stream.moves[number])
        copy.finish()
    name_texts(copy.texts, losses)
    if stream.selection.marks is not None and stream.selection.marks.reclassifies:
        losses.add("points keep the classes of their file, since a copy of E57 records has no other fields; LAS, LAZ and PLY "
                   "have the classes given here")
    gone.tell(losses)
    return written


@dataclass
class _Omitted:
    """What is left out besides the records that a selection excludes.  invalid: records that the file marks as invalid.
    poses: moved scans that had none."""

    scans: int = 0
    photographs: int = 0
    groups: int = 0
    invalid: int = 0
    poses: int = 0

    def tell(self, losses: Losses) -> None:
        if self.scans:
            losses.add(omitted(self.scans, "scan", " without a selected record"))
        if self.photographs:
            losses.add(omitted(self.photographs, "photograph", " of scans without a selected record"))
        if self.groups:
            losses.add("the groups of records (pointGroupingSchemes) are left out, since they count all records")
        if self.poses:
            losses.add(f"{counted(self.poses, 'scan')} without a scanner position got a pose, which says where it was moved "
                       "to, not where its scanner stood")
        if self.invalid:
            losses.add(omitted(self.invalid, "record", " marked as invalid"))


class _Scans:
    """The scans of one file.  kept, left_out: their guids."""

    def __init__(self, stream: SourceRecords, source: E57Source, file: Any, number: int, copy: NodeCopy, scans: Any, meter,
                 gone: _Omitted):  # fmt: skip
        self._stream, self._source, self._file, self._number = stream, source, file, number
        self._copy, self._scans, self._meter = copy, scans, meter
        self._gone = gone
        self.kept, self.left_out = set[str](), set[str]()

    def copy_all(self, running: int) -> tuple[int, int]:
        """running: number of the first point.  Returns that after the last one, and how many records were written."""
        data, written = self._file.root()["data3D"], 0
        for index in range(data.childCount()):
            node = data[index]
            running, count = self._copy_scan(node, index, running)
            written += count
        return running, written

    def _copy_scan(self, node: Any, index: int, running: int) -> tuple[int, int]:
        libe57 = library()
        everything = self._stream.everything
        points = node["points"] if node.isDefined("points") else None
        fields, _ = fields_of(libe57.StructureNode(points.prototype())) if points is not None else ([], [])
        total = int(points.childCount()) if points is not None else 0
        made = None
        if everything:
            made = self._add(node, points, index)
        if total == 0 or not fields:
            return running, 0
        arrays = arrays_for(fields, min(total, BLOCK))
        buffers = buffers_of(self._copy.image, fields, arrays, min(total, BLOCK))
        written, bounds = 0, RecordBounds()
        with ExitStack() as stack:
            writer: Any = None if made is None else stack.enter_context(writer_of(made[1], buffers))
            for n in raw_blocks(self._file, points, fields, arrays):
                running, count = self._select(index, fields, arrays, n, running, bounds)
                if count and writer is None:
                    made = self._add(node, points, index)
                    writer = stack.enter_context(writer_of(made[1], buffers))
                if count:
                    writer.write(count)
                written += count
                self._meter.update(n)
        if made is not None and not everything:
            bounds.write(node, made[0], self._copy, self._file)
            self._gone.groups += node.isDefined("pointGroupingSchemes")
        self._gone.scans += made is None
        guid = text_of(node, "guid")
        (self.left_out if made is None else self.kept).add(guid)
        return running, written

    def _add(self, node: Any, points: Any, index: int) -> tuple[Any, Any]:
        """The scan in the new file, and its points, empty yet."""
        libe57, everything = library(), self._stream.everything
        ends = None  # matched colours may exceed the range of the file's values, which some writers state
        if points is not None and self._stream.colours is not None:
            coloured = libe57.StructureNode(points.prototype()).isDefined("colorRed")
            ends = self._source.colour_range(index) if coloured else None
        limits = "colorLimits" if ends is not None and child(node, "colorLimits", "Structure") is not None else ""
        transform = self._stream.moves[self._number]
        pose = "" if transform is None else "pose"
        scan = self._copy.copied(node, self._file, ("points", limits, pose, *(() if everything else _BY_RECORDS)))
        if transform is not None:
            scan.set("pose", moved_pose_node(self._copy.image, node, transform))
            self._gone.poses += not node.isDefined("pose")
        if limits and ends is not None:
            scan.set(limits, self._copy.limits(node[limits], self._file, ends))
        vector = None
        if points is not None:
            vector = self._copy.vector(points, ends)
            scan.set("points", vector)
        self._scans.append(scan)
        self._copy.finish()
        return scan, vector

    def _select(
        self, index: int, fields, arrays: dict[str, np.ndarray], n: int, running: int, bounds: "RecordBounds"
    ) -> tuple[int, int]:
        """Moves the selected records of a block to its beginning.  Returns the running number after it and their number."""
        raw = {name: values[:n] for name, values in arrays.items()}
        if self._stream.everything and self._stream.colours is None:
            return running, n
        valid, chunk = self._source.placed(index, fields, raw)
        if self._stream.colours is not None and chunk.rgb is not None:
            shown = self._stream.colours[running : running + len(chunk.xyz)]
            rows = slice(None) if valid is None else valid
            _recolour(fields, raw, rows, shown, self._source.colour_range(index))
        if self._stream.everything:
            return running + len(chunk.xyz), n
        scans = self._stream.numbers.of(self._number, running, index, len(chunk.xyz))
        transform = self._stream.moves[self._number]
        mask = self._stream.mask(running, chunk.xyz if transform is None else moved_points(transform, chunk.xyz), scans,
                                 chunk.classification)
        if valid is None:
            kept = np.ones(n, bool) if mask is None else mask
        else:
            kept = valid.copy()  # a direction without a return has no place that a selection could hold
            kept[valid] = True if mask is None else mask
            self._gone.invalid += int(np.count_nonzero(~valid))
        count = int(np.count_nonzero(kept))
        for name, values in raw.items():
            arrays[name][:count] = values[kept]
        bounds.add(fields, arrays, count)
        return running + len(chunk.xyz), count


def _recolour(fields: list[RawField], raw: dict[str, np.ndarray], valid, shown: np.ndarray, ends: tuple[float, float]) -> None:
    """Replaces the stored colours of valid records.  shown: (n, 3) uint8.  ends: stored values of black and full."""
    by_name = {field.name: field for field in fields}
    for axis, name in enumerate(COLOURS):
        field = by_name[name]
        low, high = as_stored(ends, field.scale, field.offset)
        values = low + shown[:, axis] / 255.0 * (high - low)
        raw[name][valid] = values if field.dtype.kind == "f" else np.rint(values).astype(field.dtype)


def _metadata(files: list, reference: Reference) -> str:
    """coordinateMetadata: as in the only file, else that of the reference."""
    own = text_of(files[0].root(), "coordinateMetadata")
    return own if len(files) == 1 and not (reference.wkt and reference.wkt != own.strip("\0 \n\r\t")) else reference.wkt or ""


def _extensions(image: Any, files: list, losses: Losses) -> None:
    known: dict[str, str] = {"": library().E57_V1_0_URI}
    for file in files:
        for index in range(file.extensionsCount()):
            prefix, uri = file.extensionsPrefix(index), file.extensionsUri(index)
            if prefix not in known:
                image.extensionsAdd(prefix, uri)
                known[prefix] = uri
            elif known[prefix] != uri and prefix:
                losses.add(f"the extension {prefix} is {known[prefix]} in one file and {uri} in another; the first is stated")


def _copy_images(file: Any, images: Any, copy: NodeCopy, left_out: set[str], transform: Rows | None) -> int:
    """Appends the photographs, except those of scans that are left out; returns how many these are.  transform: of the file."""
    root = file.root()
    if not root.isDefined("images2D"):
        return 0
    source, count = root["images2D"], 0
    for index in range(source.childCount()):
        node = source[index]
        if text_of(node, "associatedData3DGuid") not in left_out - {""}:
            turned = transform is not None and node.isDefined("pose")
            made = copy.copied(node, file, ("pose",) if turned else ())
            if turned and transform is not None:
                made.set("pose", moved_pose_node(copy.image, node, transform))
            images.append(made)
            copy.finish()
        else:
            count += 1
    return count
