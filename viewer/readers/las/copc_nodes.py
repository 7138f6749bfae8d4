"""The octree of a COPC file: which points of the LAZ file belong to which level.

After the COPC specification 1.0 (copc.io): the first variable-length record says where the hierarchy begins, whose entries give
level, place and number of points of each node.  Each node is a chunk of the LAZ file.
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_INFO_AT = 375  # bytes: the record follows the header of LAS 1.4
_INFO_HEADER = struct.Struct("<2x16sHH32x")  # user, record, length
_CUBE = struct.Struct("<5d")  # at the beginning of the record: centre, half the side, spacing of the root's points
_ROOT_AT = 40  # in the record: offset and size of the hierarchy's root page
_ENTRY = np.dtype([("level", "<i4"), ("cell", "<i4", 3), ("place", "<u8"), ("bytes", "<i4"), ("points", "<i4")])
_PAGE = -1  # in place of a number of points: the entry refers to another page


@dataclass(frozen=True, eq=False)
class CopcNodes:
    """The nodes that hold points.  level, points, place, bytes: (n,) int64; where in the file and how long their chunks are.
    cell: (n, 3) int64, the node's place among those of its level.  low: (3,) corner of the root's cube, side: its length,
    spacing: of its points; file coordinates, all as the file states them."""

    level: np.ndarray
    points: np.ndarray
    place: np.ndarray
    bytes: np.ndarray
    cell: np.ndarray
    low: np.ndarray
    side: float
    spacing: float


def read_nodes(path: Path, count: int) -> CopcNodes | None:
    """The nodes of a file of ``count`` points; None where its hierarchy does not describe these points."""
    size = path.stat().st_size
    with path.open("rb") as file:
        file.seek(_INFO_AT)
        head = file.read(_INFO_HEADER.size)
        if len(head) < _INFO_HEADER.size:
            return None
        user, record, _ = _INFO_HEADER.unpack(head)
        stated = file.read(_ROOT_AT + 16)
        root = stated[_ROOT_AT:]
        if user.rstrip(b"\0") != b"copc" or record != 1 or len(root) < 16:
            return None
        pages, seen, found = [struct.unpack("<QQ", root)], set(), []
        while pages:
            place, length = pages.pop()
            if length % _ENTRY.itemsize or length == 0 or place + length > size or place in seen:
                return None
            seen.add(place)
            file.seek(place)
            entries = np.frombuffer(file.read(length), _ENTRY)
            further = entries[entries["points"] == _PAGE]
            pages += zip(further["place"].tolist(), further["bytes"].tolist(), strict=True)
            found.append(entries[entries["points"] > 0])
    nodes = np.concatenate(found)
    *centre, half, spacing = _CUBE.unpack_from(stated)
    names = ("level", "points", "place", "bytes", "cell")
    level, points, first, held, cell = (nodes[name].astype(np.int64) for name in names)
    found_nodes = CopcNodes(level, points, first, held, cell, np.array(centre) - half, 2 * half, spacing)
    inside = (found_nodes.place >= 0) & (found_nodes.bytes > 0) & (found_nodes.place + found_nodes.bytes <= size)
    return found_nodes if inside.all() and found_nodes.points.sum() == count else None
