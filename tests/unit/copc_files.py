"""Makes COPC files: an octree in which each node has at most one point in each of SPAN**3 places, leaves all that is left."""

import struct
from pathlib import Path

import numpy as np

SPAN = 32
_LEAF = 3000
"""Points from which a node is not divided further."""


def write_copc(path: Path, xyz: np.ndarray, rgb: np.ndarray, *, leaf: int = _LEAF) -> Path:
    """xyz: (n, 3) float64, stored in millimetres.  rgb: (n, 3) uint16."""
    import laspy
    from untyped import lazrs

    low, side = xyz.min(axis=0), float(np.ptp(xyz, axis=0).max()) * (1 + 1e-9) + 0.001
    header = laspy.LasHeader(point_format=7, version="1.4")
    header.scales, header.offsets = np.full(3, 0.001), np.floor(low)
    las = laspy.LasData(header)
    las.x, las.y, las.z = xyz.T
    las.red, las.green, las.blue = rgb.T
    records, length = np.frombuffer(las.points.array.tobytes(), np.uint8), header.point_format.size
    records = records.reshape(-1, length)
    record = lazrs.LazVlr.new_for_compression(7, 0, True)
    told = bytes(record.record_data())
    begin = 375 + 54 + 160 + 54 + len(told)
    entries, sizes = [], []
    with path.open("wb+") as file:
        file.write(bytes(begin))
        compressor, at = lazrs.LasZipCompressor(file, record), begin + 8
        for level, cell, rows in _nodes((xyz - low) / side, leaf):
            compressor.compress_many(records[rows].reshape(-1))
            compressor.finish_current_chunk()
            file.flush()
            end = file.seek(0, 1)
            entries.append((level, *cell, at, end - at, len(rows)))
            sizes.append((len(rows), end - at))
            at = end
        file.seek(begin)
        file.write(struct.pack("<q", at))
        file.seek(at)
        lazrs.write_chunk_table(file, sizes, record)
        extended = file.seek(0, 2)
        hierarchy = b"".join(struct.pack("<iiiiQii", *entry) for entry in entries)
        file.write(struct.pack("<H16sHQ32s", 0, b"copc", 1000, len(hierarchy), b"") + hierarchy)
        info = bytearray(160)
        struct.pack_into("<5d", info, 0, *(low + side / 2), side / 2, side / SPAN)
        struct.pack_into("<QQ", info, 40, extended + 60, len(hierarchy))
        head = bytearray(375)
        head[:4], head[24:26], head[104] = b"LASF", bytes([1, 4]), 7 | 0x80
        struct.pack_into("<HII", head, 94, 375, begin, 2)
        struct.pack_into("<H", head, 105, length)
        struct.pack_into("<6d", head, 131, *header.scales, *header.offsets)
        high = xyz.max(axis=0)
        struct.pack_into("<6d", head, 179, *(value for axis in range(3) for value in (high[axis], low[axis])))
        struct.pack_into("<QI", head, 235, extended, 1)
        struct.pack_into("<Q", head, 247, len(xyz))
        file.seek(0)
        file.write(head)
        file.write(struct.pack("<H16sHH32s", 0, b"copc", 1, 160, b"") + info)
        file.write(struct.pack("<H16sHH32s", 0, b"laszip encoded", 22204, len(told), b"") + told)
    return path


def _nodes(unit: np.ndarray, leaf: int):
    """Yields level, cell and rows of each node of points (n, 3) in the unit cube."""
    waiting = [(0, (0, 0, 0), np.random.default_rng(0).permutation(len(unit)))]
    while waiting:
        level, cell, rows = waiting.pop(0)
        if len(rows) <= leaf:
            yield level, cell, rows
            continue
        places = (unit[rows] * (SPAN << level)).astype(np.int64)
        _, first = np.unique(places @ np.array([1, 1 << 20, 1 << 40]), return_index=True)
        yield level, cell, rows[np.sort(first)]
        rest = np.ones(len(rows), bool)
        rest[first] = False
        below = (unit[rows] * (2 << level)).astype(np.int64)
        for child in np.unique(below[rest], axis=0).tolist():
            waiting.append((level + 1, tuple(child), rows[rest & (below == child).all(axis=1)]))
