"""A joined place kept in the cache: what would be read again from each of its grids, in one file.

Of a place of a thousand grids, ten thousand files are opened and as many parts described and joined, which takes most of the
time to open it.  What is kept is used only while the scans, and each file of each grid, have the name, length and time of the
last change that they had before the grids were read; otherwise the grids are read, and it is written again.  Packed points and
running numbers are read from the grids in any case, and checked by their checksums.
"""

import contextlib
import hashlib
import json
import math
import os
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np

from ....model.appearance.noise import NoiseModel
from ....model.common.files.atomic_write import write_atomic
from ...common.paths import cache_dir
from ...picture.json_values import from_json, to_json
from ...preprocess.point_attributes import AttributeLayout
from ...preprocess.scan_description import described_scan
from ...readers.grid_folder import META
from .. import cache as stored
from ..checksum import CheckedParts
from ..density_layers import PARTS
from ..records.point_records import PointRecords, identity_of
from ..scene import Scene, packed
from . import measured_place, station_colours
from .join_grids import point_changes, record_files
from .joined_exposures import applied_gains
from .joined_points import JoinedPoints, PieceTable
from .joined_records import JoinedRecords

if TYPE_CHECKING:
    from ...readers.moved_source import Moves

VERSION = 1
"""Of what is kept: raised with any change to it, or to how grids are joined (viewer.grid.place.join_grids)."""
States = list[tuple[str, int, int]]
"""Of files: the name or path, the length and the time of the last change in ns."""
_VERSIONS = [VERSION, measured_place.VERSION, station_colours.VERSION, stored.VERSION, stored.COLOURS, stored.ORDER,
             stored.NOISE, stored.ATTRIBUTES, stored.RECORDS]  # fmt: skip
LEAST_GRIDS = 32
"""Of fewer grids nothing is kept: they are opened in 30 ms."""
_START = struct.Struct("<II")
"""Checksum and length of the head, with which the file begins."""
MOST_KEPT = 8
"""Places that are kept, those written last: a place to which a file is added is another one, and each takes up to 0.3 % of the
size of its grids."""
_SAMPLED_OF_CELL = 4
"""First points that are kept with the place, of each of its cells: samples are taken of them (viewer.render.culling.
enclosed_directions), for which each grid would be read.  They are 0.2 % of a place of a billion points, 24 MB."""
_ALIGNED = 8
"""Bytes: the arrays behind the head begin at a multiple of them."""


@dataclass(frozen=True)
class Asked:
    """What a place is opened as.  files: its scans, none of them a folder.  match, columns: as for viewer.grid.open_scene."""

    files: tuple[Path, ...]
    match: bool
    columns: str | None

    def kept(self) -> Path:
        """The file in the cache."""
        key = json.dumps([self.match, self.columns, [str(file.absolute()) for file in self.files]])
        return cache_dir() / "places" / f"joined-{hashlib.sha256(key.encode()).hexdigest()[:32]}.bin"


def asked_of(paths: Sequence[Path], match: bool, columns: str | None, moves: "Moves | None") -> Asked | None:
    """What is asked for where it can be kept: many scans, which are not moved, and no folder of a grid."""
    if len(paths) < LEAST_GRIDS or moves or any(map(os.path.isdir, paths)):
        return None
    return Asked(tuple(paths), match, columns)


def state_of(folder: Path) -> States:
    """Name, length and time of the last change of each file of a grid; nothing where there is no such folder."""
    try:
        with os.scandir(folder) as entries:
            states = [(entry.name, entry.stat()) for entry in entries]
    except OSError:
        return []
    return sorted((name, found.st_size, found.st_mtime_ns) for name, found in states)


def _state(file: Path) -> tuple[str, int, int]:
    """Raises OSError."""
    found = os.stat(file)
    return file.name, found.st_size, found.st_mtime_ns


def state_of_scans(asked: Asked) -> States | None:
    """The same of each scan; None where one cannot be found."""
    try:
        return [identity_of(file) for file in asked.files]
    except OSError:
        return None


def is_current(asked: Asked) -> bool:
    """Whether the place is kept as its scans, and the headers of its grids, are now: the grids are in the cache."""
    with contextlib.suppress(OSError, ValueError), asked.kept().open("rb") as file:
        head, folders = _head(file)
        return head["headers"] == _digest(state_of_scans(asked), [[_state(folder / META)] for folder in folders])
    return False


def kept_scene(asked: Asked) -> Scene | None:
    """The scene of the place, as opening its grids gives it; None where it is not kept, or they have changed."""
    try:
        with asked.kept().open("rb") as file:
            head, folders = _head(file)
            if head["state"] != _digest(state_of_scans(asked), [state_of(folder) for folder in folders]):
                return None
            arrays = _arrays(head, bytearray(file.read()))
    except (OSError, ValueError):
        return None
    return _scene(head, folders, arrays)


def keep(asked: Asked, scene: Scene, scenes: Sequence[Scene], folders: Sequence[Path], scans: States,
         grids: list[States]) -> None:
    """Keeps the ``scene`` that was joined from ``scenes``, the grids in ``folders`` of the cache.  scans, grids: their states
    before they were read (state_of_scans, state_of of each)."""
    points: Any = scene.points
    records = [one.records for one in scenes if one.records is not None]
    noise, gains = scene.noise, measured_place.measured(scenes, folders, asked.match)
    head = {
        "versions": _VERSIONS, "state": _digest(scans, grids),
        "headers": _digest(scans, [[file for file in grid if file[0] == META] for grid in grids]),
        "folders": [folder.name for folder in folders],
        "cell_size": scene.cell_size, "layers": scene.layers, "count": scene.count, "spacing": scene.spacing,
        "meta": to_json(scene.meta), "layouts": [to_json(one.attributes) for one in scenes],
        "black": gains.missing_black, "matched": gains.matched, "scans": [len(one.meta.scans) for one in scenes],
        "known_scans": [one.scans is not None for one in records], "wide": [one.high is not None for one in records],
        "noise": None if noise is None else [noise.voxel, noise.overall, noise.neighbourhoods],
    }  # fmt: skip
    sizes = np.diff(scene.offsets)
    arrays: dict[str, np.ndarray] = {
        "origin": scene.origin, "bounds": scene.bounds, "cells": np.array(points.table.cells), "edges": points.table.edges,
        "cell_coords": scene.cell_coords, "sizes": sizes.astype(np.min_scalar_type(int(sizes.max(initial=0)))),
        "gains": gains.gains, "head": packed(scene, slice(0, scene.coarse_points(_SAMPLED_OF_CELL * len(scene.cell_coords)))),
        **_ragged("checked_edges", [one.edges for one in points.checked]),
        **_ragged("checked_sums", [one.sums for one in points.checked]),
        **_ragged("record_first", [one.first for one in records]),
        **_ragged("record_scans", [np.zeros(0, np.int64) if one.scans is None else one.scans for one in records]),
        **_ragged("record_sums", [np.zeros(0, np.uint32) if one.sums is None else one.sums for one in records]),
    }  # fmt: skip
    arrays |= {name: column for name in ("faces", "boxes") if (column := getattr(scene, name)) is not None}
    arrays |= {} if noise is None else {"noise_origin": noise.origin, "noise_sigma": noise.sigma, "noise_curve": noise.curve}

    kept, whole = asked.kept(), _packed(head, arrays)
    with contextlib.suppress(OSError):  # a cache that cannot be written costs time only
        kept.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_atomic(kept, lambda part: part.write_bytes(whole), sources=asked.files)
        others = [other for other in kept.parent.glob("joined-*.bin") if other != kept]
        others.sort(key=lambda other: other.stat().st_mtime_ns, reverse=True)
        for other in others[MOST_KEPT - 1 :]:
            other.unlink(missing_ok=True)


def _packed(head: dict[str, Any], arrays: dict[str, np.ndarray]) -> bytes:
    """The contents of the file: the start, the head as JSON, the arrays."""
    parts = []
    for array in arrays.values():
        raw = np.ascontiguousarray(array).tobytes()
        parts += [raw, bytes(-len(raw) % _ALIGNED)]
    body = b"".join(parts)
    described = {name: [array.dtype.str, list(array.shape)] for name, array in arrays.items()}
    text = json.dumps(head | {"arrays": described, "sum": zlib.crc32(body)}, allow_nan=False).encode()
    text += b" " * (-len(text) % _ALIGNED)
    return _START.pack(zlib.crc32(text), len(text)) + text + body


def _arrays(head: dict[str, Any], body: bytearray) -> dict[str, np.ndarray]:
    """Raises ValueError where they do not match their checksum."""
    if zlib.crc32(body) != head["sum"]:
        raise ValueError("damaged")
    found, at = {}, 0
    for name, (dtype, shape) in head["arrays"].items():
        count = math.prod(shape)
        found[name] = np.frombuffer(body, dtype, count, at).reshape(shape)
        at += found[name].nbytes + -found[name].nbytes % _ALIGNED
    return found


def _head(file: BinaryIO) -> tuple[dict[str, Any], list[Path]]:
    """The head of an open file, and the folders of the grids.  Raises ValueError where it is damaged, or of another
    version."""
    start = file.read(_START.size)
    checksum, length = _START.unpack(start) if len(start) == _START.size else (0, 0)
    text = file.read(min(length, os.fstat(file.fileno()).st_size))
    if zlib.crc32(text) != checksum or not text:
        raise ValueError("damaged")
    head = json.loads(text)
    if head.get("versions") != _VERSIONS:
        raise ValueError("of another version")
    cache = cache_dir()
    return head, [cache / name for name in head["folders"]]


def _digest(scans: States | None, grids: list[States]) -> str:
    return hashlib.sha256(repr((scans, grids)).encode()).hexdigest()


def _scene(head: dict[str, Any], folders: list[Path], arrays: dict[str, np.ndarray]) -> Scene:
    layouts = [from_json(AttributeLayout, one, "layouts") for one in head["layouts"]]
    first_stations = np.cumsum([0, *head["scans"]]).tolist()[:-1]
    by_grid, _ = applied_gains(arrays["gains"], head["matched"], [max(scans, 1) for scans in head["scans"]])
    table = PieceTable(arrays["edges"], arrays["cells"].tolist())
    checked = map(CheckedParts, _rows_of("checked_edges", arrays), _rows_of("checked_sums", arrays))
    points: Any = JoinedPoints(table, [folder / "points.npy" for folder in folders], list(checked),
                               point_changes(layouts, first_stations, by_grid, head["black"]), first_stations)
    points.begin_with(arrays["head"])
    low: Any = None  # read from the files of each grid
    records = [
        PointRecords(low, np.zeros(0, np.uint8) if wide else None, first, scans if known else None, sums, str(folder))
        for wide, first, known, scans, sums, folder in zip(
            head["wide"], _rows_of("record_first", arrays), head["known_scans"], _rows_of("record_scans", arrays),
            _rows_of("record_sums", arrays), folders, strict=True)
    ]  # fmt: skip
    noise = None
    if head["noise"] is not None:
        voxel, overall, neighbourhoods = head["noise"]
        noise = NoiseModel(arrays["noise_origin"], voxel, arrays["noise_sigma"], arrays["noise_curve"], overall, neighbourhoods)
    return Scene(
        points, arrays["cell_coords"], np.concatenate([[0], np.cumsum(arrays["sizes"], dtype=np.int64)]), arrays["origin"],
        head["cell_size"], head["layers"], head["count"], head["spacing"], arrays["bounds"], described_scan(head["meta"]), None,
        PARTS, arrays.get("faces"), arrays.get("boxes"), noise,
        JoinedRecords(table, records, [record_files(folder) for folder in folders]),
    )  # fmt: skip


def _ragged(name: str, rows: Sequence[np.ndarray]) -> dict[str, np.ndarray]:
    """Rows of different lengths as two arrays."""
    return {name: np.concatenate(rows), f"{name}_ends": np.cumsum([len(row) for row in rows])}


def _rows_of(name: str, arrays: dict[str, np.ndarray]) -> list[np.ndarray]:
    """The rows that :func:`_ragged` took apart."""
    return np.split(arrays[name], arrays[f"{name}_ends"][:-1])
