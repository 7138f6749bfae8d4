"""E57 to E57: every field of every record with its type and limits, every pose, photograph and further node of the file.

Without a selection the records that a file marks as invalid are copied too.  With one, a scan of which no record is left is
omitted, and so are the photographs that belong to it; bounds are written anew, and groups of records, which count records, are
omitted.  Scans of several files follow each other.
"""

from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from ...readers.e57 import E57Source
from ...readers.e57_nodes import library, open_e57, text_of
from ...readers.e57_records import BLOCK, RawField, arrays_for, buffers_of, fields_of, raw_blocks
from .crs_records import Reference
from .e57_file import NodeCopy, header, new_file, writer_of
from .losses import Losses
from .record_stream import SourceRecords

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
    written, running = 0, 0
    with ExitStack() as stack:
        image = stack.enter_context(new_file(path))
        files = [stack.enter_context(open_e57(source.path)) for source in stream.sources]
        copy, root = NodeCopy(image), image.root()
        _extensions(image, files, losses)
        first = files[0].root()
        own = text_of(first, "guid") if len(files) == 1 else ""
        header(image, {"coordinateMetadata": _metadata(files, reference)} | ({"guid": own} if own else {}))
        scans, images = libe57.VectorNode(image, True), libe57.VectorNode(image, True)
        root.set("data3D", scans)
        root.set("images2D", images)
        for index in range(first.childCount()):
            child = first[index]
            if child.elementName() not in _WRITTEN:
                root.set(child.elementName(), copy.copied(child, files[0]))
        copy.finish()
        with stream.meter("writing") as meter:
            for source, file, number in zip(stream.sources, files, range(len(files)), strict=True):
                assert isinstance(source, E57Source)
                task = _Scans(stream, source, file, number, copy, scans, meter)
                running, count = task.copy_all(running)
                written += count
                _copy_images(file, images, copy, task.left_out - task.kept)
        copy.finish()
    if copy.texts:
        losses.add(
            f"the text fields {', '.join(dict.fromkeys(copy.texts))} of records are left out, since libe57's binding does not "
            "read them"
        )
    return written


class _Scans:
    """The scans of one file.  kept, left_out: their guids."""

    def __init__(self, stream: SourceRecords, source: E57Source, file: Any, number: int, copy: NodeCopy, scans: Any, meter):
        self._stream, self._source, self._file, self._number = stream, source, file, number
        self._copy, self._scans, self._meter = copy, scans, meter
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
            made = self._add(node, points)
        if total == 0 or not fields:
            return running, 0
        arrays = arrays_for(fields, min(total, BLOCK))
        buffers = buffers_of(self._copy.image, fields, arrays, min(total, BLOCK))
        written, bounds = 0, _Bounds()
        with ExitStack() as stack:
            writer: Any = None if made is None else stack.enter_context(writer_of(made[1], buffers))
            for n in raw_blocks(self._file, points, fields, arrays):
                running, count = self._select(index, fields, arrays, n, running, bounds)
                if count and writer is None:
                    made = self._add(node, points)
                    writer = stack.enter_context(writer_of(made[1], buffers))
                if count:
                    writer.write(count)
                written += count
                self._meter.update(n)
        if made is not None and not everything and node.isDefined("cartesianBounds") and bounds.known:
            made[0].set("cartesianBounds", bounds.node(self._copy.image))
        guid = text_of(node, "guid")
        (self.left_out if made is None else self.kept).add(guid)
        return running, written

    def _add(self, node: Any, points: Any) -> tuple[Any, Any]:
        """The scan in the new file, and its points, empty yet."""
        everything = self._stream.everything
        scan = self._copy.copied(node, self._file, ("points", *(() if everything else _BY_RECORDS)))
        vector = None
        if points is not None:
            vector = self._copy.vector(points)
            scan.set("points", vector)
        self._scans.append(scan)
        self._copy.finish()
        return scan, vector

    def _select(
        self, index: int, fields, arrays: dict[str, np.ndarray], n: int, running: int, bounds: "_Bounds"
    ) -> tuple[int, int]:
        """Moves the selected records of a block to its beginning.  Returns the running number after it and their number."""
        raw = {name: values[:n] for name, values in arrays.items()}
        if self._stream.everything and self._stream.colours is None:
            return running, n
        valid, chunk = self._source.placed(index, fields, raw)
        if self._stream.colours is not None and chunk.rgb is not None:
            shown = self._stream.colours[running : running + len(chunk.xyz)]
            _recolour(fields, raw, slice(None) if valid is None else valid, shown, self._source.colour_range(index))
        if self._stream.everything:
            return running + len(chunk.xyz), n
        scans = self._stream.numbers.of(self._number, running, index, len(chunk.xyz))
        mask = self._stream.mask(running, chunk.xyz, scans)
        if valid is None:
            kept = np.ones(n, bool) if mask is None else mask
        else:
            kept = valid.copy()  # a direction without a return has no place that a selection could hold
            kept[valid] = True if mask is None else mask
        count = int(np.count_nonzero(kept))
        for name, values in raw.items():
            arrays[name][:count] = values[kept]
        bounds.add(fields, arrays, count)
        return running + len(chunk.xyz), count


def _recolour(fields: list[RawField], raw: dict[str, np.ndarray], valid, shown: np.ndarray, ends: tuple[float, float]) -> None:
    """Replaces the stored colours of valid records.  shown: (n, 3) uint8.  ends: stored values of black and full."""
    by_name = {field.name: field for field in fields}
    for axis, name in enumerate(("colorRed", "colorGreen", "colorBlue")):
        values = ends[0] + shown[:, axis] / 255.0 * (ends[1] - ends[0])
        field = by_name[name]
        if field.scale is not None:
            values = (values - field.offset) / field.scale
        raw[name][valid] = values if field.dtype.kind == "f" else np.rint(values).astype(field.dtype)


class _Bounds:
    """Lowest and highest Cartesian coordinates of written records, in the scan's own frame."""

    def __init__(self) -> None:
        self._low, self._high = np.full(3, np.inf), np.full(3, -np.inf)

    @property
    def known(self) -> bool:
        return bool(np.isfinite([self._low, self._high]).all())

    def add(self, fields, arrays: dict[str, np.ndarray], count: int) -> None:
        by_name = {field.name: field for field in fields}
        for axis, name in enumerate(("cartesianX", "cartesianY", "cartesianZ")):
            if name in by_name and count:
                values = by_name[name].scaled(arrays[name][:count])
                self._low[axis] = np.fmin(self._low[axis], np.nanmin(values))
                self._high[axis] = np.fmax(self._high[axis], np.nanmax(values))

    def node(self, image: Any) -> Any:
        libe57 = library()
        made = libe57.StructureNode(image)
        for axis, letter in enumerate("xyz"):
            made.set(f"{letter}Minimum", libe57.FloatNode(image, float(self._low[axis]), libe57.E57_DOUBLE))
            made.set(f"{letter}Maximum", libe57.FloatNode(image, float(self._high[axis]), libe57.E57_DOUBLE))
        return made


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


def _copy_images(file: Any, images: Any, copy: NodeCopy, left_out: set[str]) -> None:
    """Appends the photographs, except those of scans that are left out."""
    root = file.root()
    if not root.isDefined("images2D"):
        return
    source = root["images2D"]
    for index in range(source.childCount()):
        node = source[index]
        if text_of(node, "associatedData3DGuid") not in left_out - {""}:
            images.append(copy.copied(node, file))
            copy.finish()
