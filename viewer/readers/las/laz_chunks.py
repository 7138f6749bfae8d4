"""Checks the chunk table of a LAZ file before lazrs reads it.

Where a damaged table asks for more memory than there is, lazrs ends the whole process; where sizes do not add up, it panics.
Neither gives a usable error message.  Checked are the record that describes the compression, the table of chunks behind the
points and, for the layered formats (6 to 10), the sizes at the head of each chunk.
"""

from importlib import import_module
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from ...common.errors import InputError
from .las_decoding import decoding
from .laz_points import LazPoints
from .laz_worker import FIRST_LAYERED, items_of, layer_sizes, layers_of

VARIABLE = 2**32 - 1
"""In place of a number of points a chunk: each chunk has its own (COPC)."""
_SIZES = {6: 20, 7: 8, 8: 6, 9: 29, 10: 30, 11: 6, 12: 8, 13: 29}
"""Bytes of an item by its type in LASzip; extra bytes, types 0 and 14, have any number."""
_BY_POINTS, _LAYERED = 2, 3
"""Compressors: chunks of points one after the other, and of layers."""


def checked_points(path: Path, record: bytes, *, offset: int, length: int, count: int) -> tuple[LazPoints, int]:
    """Returns the file's points, and the number of whole chunks behind those that the header counts.

    record: data of the record that describes the compression.  offset: byte at which the points begin.  length: bytes of a
    point.
    count: points by the file's header.
    Raises InputError where the table contradicts the file.
    """
    chunk_size = _described(path, record, length)
    with path.open("rb") as file:
        size = file.seek(0, 2)
        place = _number(file, offset, 8)
        if place < 0:  # the file was written as a stream; the offset is then in the last 8 bytes
            place = _number(file, size - 8, 8)
        if not offset + 8 <= place <= size - 8:
            raise InputError(f"truncated: 0 of {count:,} points could be read, the table of chunks that should end it is "
                             "missing", file=path, remedy="copy or export it again")
        room, chunks = place - offset - 8, _number(file, place + 4, 4) % 2**32
        if chunks > room:
            raise _damaged(path, f"states {chunks:,} chunks in {room:,} bytes")
        table = _table(path, file, record, offset, place)
        if (stated := sum(held for _, held in table)) > room:
            raise _damaged(path, f"its chunks would take {stated:,} bytes where {room:,} are")
        points = sum(n for n, held in table if held)  # some writers end with an empty chunk
        if points < count:
            raise _damaged(path, f"{points:,} of {count:,} points could be read, its chunks hold no more")
        if chunk_size == VARIABLE and points > count:
            raise _damaged(path, f"its header counts {count:,} points, its chunks hold {points:,}")
        if layers := layers_of(record):  # whatever version they state, which lazrs does not check
            _check_layers(path, file, table, offset + 8, length, layers)
    sizes, held = np.array([(n if held else 0, held) for n, held in table], np.int64).T
    edges = np.minimum(np.append(0, sizes.cumsum()), count)  # the last chunk may hold fewer than the others
    begin = offset + 8 + np.append(0, held.cumsum()[:-1])
    return LazPoints(path, record, length, np.diff(edges), held, begin), (points - count) // int(sizes.max())


def _described(path: Path, record: bytes, length: int) -> int:
    """Points of a chunk."""
    number = int.from_bytes(record[32:34], "little")
    if number == 0 or len(record) < 34 + 6 * number:
        raise _damaged(path, "does not say how it is compressed")
    items = items_of(record)
    if sum(n for _, n, _ in items) != length or any(_SIZES.get(kind, n) != n for kind, n, _ in items):
        raise _damaged(path, f"its compressed points are not made of {length} bytes")
    compressor = int.from_bytes(record[:2], "little")
    if compressor != (_LAYERED if any(kind >= FIRST_LAYERED for kind, _, _ in items) else _BY_POINTS):
        raise _damaged(path, f"states compressor {compressor}, which its kind of points does not have")
    chunk_size = int.from_bytes(record[12:16], "little")
    if chunk_size == 0:
        raise _damaged(path, "says that its chunks have 0 points")
    return chunk_size


def _table(path: Path, file: BinaryIO, record: bytes, offset: int, place: int) -> list[tuple[int, int]]:
    """Points and bytes of each chunk, as lazrs reads them."""
    lazrs: Any = import_module("lazrs")  # compiled, without type declarations

    file.seek(place + 8)
    if file.read(4) == b"\xff" * 4:  # see laz_worker: the table is coded as the points are
        raise _damaged(path, "its table of chunks begins as no program writes it")
    file.seek(offset)
    with decoding(lambda why: _damaged(path, f"its table of chunks cannot be read ({why})")):
        return lazrs.read_chunk_table(file, lazrs.LazVlr(record))


def _check_layers(path: Path, file: BinaryIO, table: list[tuple[int, int]], start: int, length: int, layers: int) -> None:
    for number, (_, held) in enumerate(table, 1):
        if held and layer_sizes(file, start, held, length, layers) is None:
            raise _damaged(path, f"chunk {number:,} of {len(table):,} would have more than its {held:,} bytes")
        start += held


def _number(file: BinaryIO, place: int, size: int) -> int:
    file.seek(place)
    return int.from_bytes(file.read(size), "little", signed=True)


def _damaged(path: Path, what: str) -> InputError:
    return InputError(f"damaged: {what}", file=path, remedy="copy or export it again")
