"""Columns to E57: one scan for each scan of the scene, with its scanner's position as pose; coordinates in float64.

Columns for which E57 has no field are fields of an extension, ``pg:NAME``, so that none is lost.
"""

from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ....readers.e57.e57_nodes import library
from ....readers.e57.e57_records import RawField, buffers_of
from ....readers.source import ScanInfo
from ..columns import CUT_COLOURS, Column, Piece, Stream, Survey
from ..crs_records import Reference
from ..losses import Losses
from .e57_file import EXTENSION, header, new_file, new_guid, writer_of

_CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
_COLOURS = ("colorRed", "colorGreen", "colorBlue")
_BLOCK = 1 << 18
"""Records written at a time."""
_LARGEST = 2**63 - 1
"""Whole number: E57's are of 64 bits with a sign."""


def write_e57(path: Path, stream: Stream, found: Survey, reference: Reference, losses: Losses) -> None:
    """Writes the selected records.  Scans whose records do not follow each other take one pass each."""
    libe57 = library()
    with new_file(path) as image:
        image.extensionsAdd(*EXTENSION)
        header(image, {"coordinateMetadata": reference.wkt or ""})
        scans = libe57.VectorNode(image, True)
        image.root().set("data3D", scans)
        image.root().set("images2D", libe57.VectorNode(image, True))
        infos = stream.scan_info()
        plan = _Fields(found, losses)
        for only in [None] if found.runs else sorted(found.counts):
            _write_scans(image, scans, stream, plan, infos, only)


def _write_scans(image: Any, scans: Any, stream: Stream, plan: "_Fields", infos: list[ScanInfo], only: int | None) -> None:
    """Writes all scans, which follow each other in the stream, or the records of one scan."""
    current, arrays = -1, dict[str, np.ndarray]()
    writer: Any = None
    place = np.zeros(3)
    with ExitStack() as stack:
        for piece in stream.pieces("writing"):
            edges = [0, *(np.flatnonzero(np.diff(piece.scan)) + 1).tolist(), len(piece.scan)]
            spans = pairwise(edges) if only is None else [(0, len(piece.scan))]
            for start, stop in spans:
                rows = np.arange(start, stop) if only is None else np.flatnonzero(piece.scan == only)
                if len(rows) == 0:
                    continue
                number = int(piece.scan[rows[0]])
                if number != current:
                    stack.close()
                    info = infos[number] if number < len(infos) else ScanInfo(f"scan {number + 1}")
                    place = np.zeros(3) if info.position is None else np.array(info.position)
                    vector = plan.scan(image, scans, info)
                    arrays = {field.name: np.empty(_BLOCK, field.dtype) for field in plan.fields}
                    writer, current = (
                        stack.enter_context(writer_of(vector, buffers_of(image, plan.fields, arrays, _BLOCK))),
                        number,
                    )
                for at in range(0, len(rows), _BLOCK):
                    part = rows[at : at + _BLOCK]
                    plan.fill(arrays, piece, part, place)
                    writer.write(len(part))


class _Fields:
    """The fields of a record, the same in all scans."""

    def __init__(self, found: Survey, losses: Losses):
        self._found, self._losses = found, losses
        double = np.dtype(np.float64)
        self._nodes: dict[str, tuple] = dict.fromkeys(_CARTESIAN, ("float", double))
        self._columns: dict[str, tuple[str, int | None]] = {}
        if (intensity := found.columns.get("intensity")) is not None:
            self._add("intensity", "intensity", intensity, None)
        self.wide = 16 in found.depth.values() and not found.exact8
        if self.wide:
            losses.add("colours have 16 bits, which programs that expect 8, such as pye57, refuse")
        elif found.shifted:
            losses.add(CUT_COLOURS)
        if found.coloured:
            self._nodes |= dict.fromkeys(_COLOURS, ("integer", 0, 65535 if self.wide else 255))
        for name, column in found.columns.items():
            for element in range(column.width) if name != "intensity" else ():
                made = f"{EXTENSION[0]}:{_plain(name)}" + ("" if column.width == 1 else f"_{element}")
                while made in self._nodes:
                    made += "_"
                self._add(made, name, column, None if column.width == 1 else element)
        if any(name.startswith(f"{EXTENSION[0]}:") for name in self._nodes):
            losses.add(f"columns without a field in E57 are in an extension, {EXTENSION[0]}:NAME, which pye57 reads only with "
                       "ignore_unsupported_fields=True")
        self.fields = [RawField(name, kind[1] if kind[0] == "float" else np.dtype(np.longlong), double)
                       for name, kind in self._nodes.items()]  # fmt: skip

    def _add(self, made: str, name: str, column: Column, element: int | None) -> None:
        if column.dtype.kind == "f":
            dtype = np.dtype(np.float32 if column.dtype.itemsize <= 4 else np.float64)
            self._nodes[made] = ("float", dtype)
        else:
            low, high = (int(column.low), int(column.high)) if column.low <= column.high else (0, 0)
            if name == "intensity" and low >= 0 and high <= 65535:
                low, high = 0, 65535
            if high > _LARGEST:
                self._nodes[made] = ("float", np.dtype(np.float64))
                self._losses.add(f"{name} is rounded to doubles, as E57 holds no whole number above {_LARGEST:,}")
            else:
                self._nodes[made] = ("integer", min(low, 0), max(high, 0))
        self._columns[made] = (name, element)

    def scan(self, image: Any, scans: Any, info: ScanInfo) -> Any:
        """Adds an empty scan to the file; returns its points."""
        libe57 = library()

        def structure(**children) -> Any:
            made = libe57.StructureNode(image)
            for key, child in children.items():
                made.set(key, child)
            return made

        def number(value: float) -> Any:
            return libe57.FloatNode(image, float(value), libe57.E57_DOUBLE)

        def whole(value: int) -> Any:
            return libe57.IntegerNode(image, value)

        scan = structure(guid=libe57.StringNode(image, new_guid()), name=libe57.StringNode(image, info.name))
        if info.position is not None:
            rotation = structure(w=number(1), x=number(0), y=number(0), z=number(0))
            scan.set(
                "pose",
                structure(
                    rotation=rotation, translation=structure(**dict(zip("xyz", map(number, info.position), strict=True)))
                ),
            )
        if "intensity" in self._nodes:
            column, kind = self._found.columns["intensity"], self._nodes["intensity"]
            ends = (whole(kind[1]), whole(kind[2])) if kind[0] == "integer" else (number(column.low), number(column.high))
            scan.set("intensityLimits", structure(intensityMinimum=ends[0], intensityMaximum=ends[1]))
        if self._found.coloured:
            most = 65535 if self.wide else 255
            scan.set(
                "colorLimits",
                structure(
                    **{f"{name}{end}": whole(value) for name in _COLOURS for end, value in (("Minimum", 0), ("Maximum", most))}
                ),
            )
        prototype = structure(**{name: self._node(image, kind) for name, kind in self._nodes.items()})
        points = libe57.CompressedVectorNode(image, prototype, libe57.VectorNode(image, True))
        scan.set("points", points)
        scans.append(scan)
        return points

    def _node(self, image: Any, kind: tuple) -> Any:
        libe57 = library()
        if kind[0] == "integer":
            return libe57.IntegerNode(image, 0, kind[1], kind[2])
        return libe57.FloatNode(image, 0.0, libe57.E57_SINGLE if kind[1] == np.float32 else libe57.E57_DOUBLE)

    def fill(self, arrays: dict[str, np.ndarray], piece: Piece, rows: np.ndarray, place: np.ndarray) -> None:
        """place: (3,) of the scanner, from which coordinates are counted."""
        count = len(rows)
        for axis, name in enumerate(_CARTESIAN):
            arrays[name][:count] = piece.xyz[rows, axis] - place[axis]
        if self._found.coloured:
            part = Piece(piece.source, piece.xyz[rows], None if piece.rgb is None else piece.rgb[rows], piece.scan[rows], {})
            colours = self._found.colours16(part) if self.wide else self._found.colours8(part)
            for axis, name in enumerate(_COLOURS):
                arrays[name][:count] = colours[:, axis]
        for made, (name, element) in self._columns.items():
            values = piece.columns.get(name)
            if values is None:
                arrays[made][:count] = np.nan if arrays[made].dtype.kind == "f" else 0
            else:
                arrays[made][:count] = values[rows] if element is None else values[rows, element]


def _plain(name: str) -> str:
    """A name that XML allows."""
    plain = "".join(c if c.isascii() and (c.isalnum() or c in "_-.") else "_" for c in name) or "column"
    return plain if plain[0].isalpha() or plain[0] == "_" else f"_{plain}"
