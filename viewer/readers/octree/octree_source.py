"""Shared by the readers of octrees of many files (Potree, EPT): a JSON file that describes the folder, and nodes of points.

Every point is in exactly one node of these octrees, so all nodes of all levels together are the scan.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ...common.errors import InputError
from .. import crs
from ..column_source import Columns, ColumnSource
from ..own_folder import MOST_UNPACKED
from ..sampling import sampled_nodes
from ..source import CHUNK, Chunk, Records, ScanInfo

PIECE = 64 << 20
"""Bytes of records that are read at once; a point may have thousands."""
MOST_ELEMENTS = 64
"""Elements of an attribute: sixteen times the four of RGBA, the most that the formats define."""
_BATCH = 1 << 18  # points of small nodes that are gathered to a chunk: 6 MB of coordinates
TYPES = {"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4", "int64": "i8",
         "uint64": "u8", "float": "f4", "float32": "f4", "double": "f8", "float64": "f8"}  # fmt: skip


class OctreeSource(ColumnSource):
    """A folder with an octree.  path: of the file that describes it.  Subclasses implement ``_nodes``, ``_levels`` and
    ``_node``.

    Errors and warnings name the folder, or the file in it that is damaged.
    """

    def __init__(self, path: Path, name: str):
        self.entry, folder = path, path.absolute().parent
        super().__init__(folder, name)
        self.scans = [ScanInfo(folder.name)]

    def _nodes(self) -> Iterator[tuple[int, Columns]]:
        """Yields (scan, all columns) of all points, in runs of any length up to CHUNK."""
        raise NotImplementedError

    def _levels(self) -> np.ndarray:
        """(n, 2) int64: level and points of each node, in the order of their numbers for ``_node``."""
        raise NotImplementedError

    def _node(self, number: int) -> Iterator[tuple[int, Columns]]:
        """Yields (scan, all columns) of the points of one node."""
        raise NotImplementedError

    def _sample_rows(self, wanted: str, points: int, run: int) -> Iterator[tuple[int, Columns]]:
        """The upper levels: each is itself a sample of the scan, spread evenly in space."""
        levels = self._levels()
        for number, step in sampled_nodes(levels[:, 0], levels[:, 1], points):
            for scan, columns in self._node(number):
                yield scan, {name: values[::step] for name, values in columns.items() if name in wanted}

    def _rows(self, wanted: str) -> Iterator[tuple[int, Columns]]:
        return self._gathered(set(wanted))

    def _record_rows(self) -> Iterator[tuple[int, Columns]]:
        return self._gathered(None)

    def _record_nodes(self) -> Iterator[tuple[int, Columns]]:
        """Yields what ``_nodes`` yields, with further columns that cost time."""
        return self._nodes()

    def _gathered(self, wanted: set[str] | None) -> Iterator[tuple[int, Columns]]:
        """Gathers small nodes to larger chunks, since every chunk has a fixed cost.  wanted: columns; None: all."""
        kept: list[Columns] = []
        for _, every in self._record_nodes() if wanted is None else self._nodes():
            columns = {name: values for name, values in every.items() if wanted is None or name in wanted}
            if kept and kept[0].keys() != columns.keys():
                yield 0, _joined(kept)
                kept = []
            kept.append(columns)
            if sum(len(part[next(iter(part))]) for part in kept if part) >= _BATCH:
                yield 0, _joined(kept)
                kept = []
        if kept and kept[0]:
            yield 0, _joined(kept)

    def _crs(self, text: object) -> None:
        """Sets units and name of the reference system from WKT, an EPSG code or a PROJ string."""
        if isinstance(text, str) and text.strip():
            self.crs, self.units, self.metres_per_unit = crs.from_text(text)
            self.warnings += crs.height_warning(self.path.name, self.units, self.metres_per_unit, crs.height_unit(text))
            self.crs_text = text

    def _damaged(self, what: str, file: Path | None = None) -> InputError:
        return damaged(what, file or self.entry)


def damaged(what: str, file: Path) -> InputError:
    """The error of a part of an octree that contradicts itself or another part."""
    return InputError(f"damaged: {what}", file=file, remedy="copy or convert the scan again")


_NAMES = {"gpstime": "gps_time", "returnnumber": "return_number", "numberofreturns": "number_of_returns",
          "userdata": "user_data", "scandirectionflag": "scan_direction_flag", "edgeofflightline": "edge_of_flight_line",
          "pointsourceid": "point_source_id", "sourceid": "point_source_id", "synthetic": "synthetic", "keypoint": "key_point",
          "withheld": "withheld", "overlap": "overlap", "scanchannel": "scanner_channel"}  # fmt: skip
"""Names of attributes, in lower case and without separators, that laspy spells in another way."""
_LETTERS = {"intensity": "i", "classification": "c", "point_source_id": "s"}


def named(name: str) -> str:
    """The name of a further attribute in ``Records``: as laspy names it, else as in the file; more than one letter."""
    plain = "".join(c for c in name.lower() if c.isalnum())
    known = _NAMES.get(plain, name)
    return known if len(known) > 1 else f"{known}_"


def _joined(parts: list[Columns]) -> Columns:
    return parts[0] if len(parts) == 1 else {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}


def read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file.  Raises InputError where the file does not hold one."""
    try:
        if path.stat().st_size > MOST_UNPACKED:
            what = f"{path.stat().st_size:,} bytes are too many for the description of a scan"
            raise InputError(f"damaged: {what}", file=path, remedy="copy or convert the scan again")
        return as_object(path, path.read_bytes())
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=path,
                         remedy="copy the whole folder again") from None


def as_object(path: Path, data: bytes) -> dict[str, Any]:
    """The object in JSON text read from a file.  Raises InputError where the text is not one."""
    try:
        found = json.loads(data)
    except (ValueError, RecursionError) as error:
        line = (str(error).splitlines() or ["nested too deep"])[0][:80]
        raise InputError(f"damaged: not readable as JSON ({line})", file=path,
                         remedy="copy or convert the scan again") from None
    if not isinstance(found, dict):
        raise InputError("damaged: holds no JSON object", file=path, remedy="copy or convert the scan again")
    return found


def whole(value: object, most: int = 2**62) -> int | None:
    """A JSON value as a whole number from 0 to ``most``, else None."""
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= most else None


def vector(value: object, length: int = 3) -> np.ndarray | None:
    """A JSON list of finite numbers as (length,) float64, else None."""
    if not isinstance(value, list) or len(value) != length:
        return None
    if not all(isinstance(part, (int, float)) and not isinstance(part, bool) for part in value):
        return None
    try:
        found = np.array(value, np.float64)
    except OverflowError:
        return None
    return found if np.isfinite(found).all() else None


def columns_of(chunk: Chunk | Records) -> Columns:
    """The columns of another reader's chunk."""
    columns = {axis: chunk.xyz[:, i] for i, axis in enumerate("xyz")}
    if chunk.rgb is not None:
        columns |= {channel: chunk.rgb[:, i] for i, channel in enumerate("rgb")}
    if isinstance(chunk, Records):
        return columns | {_LETTERS.get(name, name): values for name, values in chunk.columns.items()}
    known = (("i", chunk.intensity), ("c", chunk.classification), ("s", chunk.station))
    return columns | {column: values for column, values in known if values is not None}


def pieces(file: BinaryIO, dtype: np.dtype) -> Iterator[np.ndarray]:
    """The records of a file or stream in runs of up to CHUNK, and of up to PIECE bytes.  A torn last record is left out."""
    step, rest = max(1, min(CHUNK, PIECE // dtype.itemsize)) * dtype.itemsize, b""
    while data := file.read(step - len(rest)):
        rest += data
        whole_bytes = len(rest) // dtype.itemsize * dtype.itemsize
        if whole_bytes:
            yield np.frombuffer(rest[:whole_bytes], dtype)
            rest = rest[whole_bytes:]
