"""Checks the chunk table of a LAZ file before lazrs reads it.

Where a damaged table asks for more memory than there is, lazrs ends the whole process; where sizes do not add up, it panics.
Neither gives a usable error message.  Checked are the record that describes the compression, the table of chunks behind the
points and, for the layered formats (6 to 10), the sizes at the head of each chunk.
"""

import io
import struct
from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ..errors import InputError
from .las_decoding import decoding

VARIABLE = 2**32 - 1
"""In place of a number of points a chunk: each chunk has its own (COPC)."""
_SIZES = {6: 20, 7: 8, 8: 6, 9: 29, 10: 30, 11: 6, 12: 8, 13: 29}
"""Bytes of an item by its type in LASzip; extra bytes, types 0 and 14, have any number."""
_BY_POINTS, _LAYERED = 2, 3
"""Compressors: chunks of points one after the other, and of layers."""
_FIRST_LAYERED = 10
"""Types from this one on are stored in layers."""
_LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Layers in which an item is stored, by its type; extra bytes, type 14, have one each."""


def check_chunks(path: Path, record: bytes, *, offset: int, length: int, count: int) -> tuple[int, int]:
    """Returns the number of points of the largest chunk, at most, and of all chunks.

    record: data of the record that describes the compression.  offset: byte at which the points begin.  length: bytes of a
    point.
    count: points by the file's header.
    Raises InputError where the table contradicts the file.
    """
    chunk_size, items = _described(path, record, length)
    with path.open("rb") as file:
        size = file.seek(0, 2)
        place = _number(file, offset, 8)
        if place < 0:  # the file was written as a stream; the offset is then in the last 8 bytes
            place = _number(file, size - 8, 8)
        if not offset + 8 <= place <= size - 8:
            raise InputError(
                f"{path}: truncated: 0 of {count:,} points could be read, the table of chunks that should end it is "
                "missing; copy or export it again"
            )
        room, chunks = place - offset - 8, _number(file, place + 4, 4) % 2**32
        if chunks > room:
            raise _damaged(path, f"states {chunks:,} chunks in {room:,} bytes")
        table = _table(path, file, record, offset)
        if (stated := sum(held for _, held in table)) > room:
            raise _damaged(path, f"its chunks would take {stated:,} bytes where {room:,} are")
        points = sum(n for n, held in table if held)  # some writers end with an empty chunk
        if points < count:
            raise _damaged(path, f"{points:,} of {count:,} points could be read, its chunks hold no more")
        if chunk_size == VARIABLE and points > count:
            raise _damaged(path, f"its header counts {count:,} points, its chunks hold {points:,}")
        if any(kind >= _FIRST_LAYERED for kind, _, _ in items):  # whatever version they state, which lazrs does not check
            _check_layers(path, file, table, offset + 8, length, sum(_LAYERS.get(kind, n) for kind, n, _ in items))
    return max(n for n, _ in table), points


def _described(path: Path, record: bytes, length: int) -> tuple[int, list[tuple[int, int, int]]]:
    """Points of a chunk, and type, bytes and version of the items of a point."""
    number = int.from_bytes(record[32:34], "little")
    if number == 0 or len(record) < 34 + 6 * number:
        raise _damaged(path, "does not say how it is compressed")
    items = list(struct.iter_unpack("<3H", record[34 : 34 + 6 * number]))
    if sum(n for _, n, _ in items) != length or any(_SIZES.get(kind, n) != n for kind, n, _ in items):
        raise _damaged(path, f"its compressed points are not made of {length} bytes")
    compressor = int.from_bytes(record[:2], "little")
    if compressor != (_LAYERED if any(kind >= _FIRST_LAYERED for kind, _, _ in items) else _BY_POINTS):
        raise _damaged(path, f"states compressor {compressor}, which its kind of points does not have")
    chunk_size = int.from_bytes(record[12:16], "little")
    if chunk_size == 0:
        raise _damaged(path, "says that its chunks have 0 points")
    return chunk_size, items


def _table(path: Path, file: BinaryIO, record: bytes, offset: int) -> list[tuple[int, int]]:
    """Points and bytes of each chunk, as lazrs reads them."""
    lazrs: Any = import_module("lazrs")  # compiled, without type declarations

    file.seek(offset)
    with decoding(lambda why: _damaged(path, f"its table of chunks cannot be read ({why})")):
        return lazrs.read_chunk_table(file, lazrs.LazVlr(record))


def chunk_table(path: Path, record: bytes, offset: int) -> tuple[np.ndarray, np.ndarray]:
    """Points and bytes of each chunk of a checked file, (C,) int64 each, in the order of the file; the last chunk of a file may
    hold fewer points.  record, offset: as for check_chunks."""
    with path.open("rb") as file:
        points, held = np.array(_table(path, file, record, offset), np.int64).reshape(-1, 2).T
    return np.where(held > 0, points, 0), held


def check_chunk(path: Path, record: bytes, data: bytes, length: int) -> None:
    """Checks one chunk, wherever its place was stated: the hierarchy of a COPC may contradict the table of chunks.

    record, length: as for check_chunks.  data: the chunk's bytes.  Raises InputError where its layers do not fit into them.
    """
    _, items = _described(path, record, length)
    if any(kind >= _FIRST_LAYERED for kind, _, _ in items):
        layers = sum(_LAYERS.get(kind, n) for kind, n, _ in items)
        _check_layers(path, io.BytesIO(data), [(0, len(data))], 0, length, layers)


def _check_layers(path: Path, file: BinaryIO, table: list[tuple[int, int]], start: int, length: int, layers: int) -> None:
    """Checks the layers of each chunk, which consists of its first point, a count, the sizes of the layers, and the layers."""
    head = length + 4 + 4 * layers
    for number, (_, held) in enumerate(table, 1):
        if held:
            file.seek(start + length + 4)
            sizes = np.frombuffer(file.read(4 * layers) if held >= head else b"", "<u4")
            if held < head or head + int(sizes.sum(dtype=np.uint64)) > held:
                raise _damaged(path, f"chunk {number:,} of {len(table):,} would have more than its {held:,} bytes")
        start += held


def _number(file: BinaryIO, place: int, size: int) -> int:
    file.seek(place)
    return int.from_bytes(file.read(size), "little", signed=True)


def _damaged(path: Path, what: str) -> InputError:
    return InputError(f"{path}: damaged: {what}; copy or export it again")
