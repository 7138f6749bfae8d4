"""Decodes chunks of LAZ files, as a program of its own: laz_points starts it, and it imports nothing of this package.

lazrs 0.8 can end its process on a damaged file.  Two causes are known.  A stream of the arithmetic coder that begins with four
bytes of 0xFF has its value outside the coder's interval, which no encoder writes, and the tables of the decoder are then read
beyond their ends: such a chunk is refused here.  And each change of the sequence of GPS times is a call within a call, as many
as the file says, until the stack is full: no check finds that but decoding, so that it happens in this process.

A request is a line of JSON, see ``_Answers``.  The answer is a length of 8 bytes and the records, or a negative length and one
line that says why not.
"""

import io
import json
import os
import signal
import struct
import sys
from typing import Any, BinaryIO

LAYERS = {10: 9, 11: 1, 12: 2, 13: 1}
"""Layers in which an item of a point is stored, by its type in LASzip; extra bytes, type 14, have one each."""
FIRST_LAYERED = 10
"""Types from this one on are stored in layers."""
_INVALID = b"\xff" * 4


def items_of(record: bytes) -> list[tuple[int, int, int]]:
    """Type, bytes and version of the items of a point.  record: data of the record that describes the compression."""
    return list(struct.iter_unpack("<3H", record[34 : 34 + 6 * int.from_bytes(record[32:34], "little")]))


def layers_of(record: bytes) -> int:
    """The number of layers of a chunk; 0 where its points are stored one after the other."""
    return sum(LAYERS.get(kind, size) for kind, size, _ in items_of(record) if kind >= FIRST_LAYERED)


def layer_sizes(file: BinaryIO, place: int, held: int, length: int, layers: int) -> list[int] | None:
    """Bytes of the layers of the chunk of ``held`` bytes at ``place``, which consists of its first point of ``length`` bytes, a
    count, these sizes, and the layers; None where they do not fit into it."""
    head = length + 4 + 4 * layers
    if held < head:
        return None
    file.seek(place + length + 4)
    data = file.read(4 * layers)
    sizes = [size for (size,) in struct.iter_unpack("<I", data)] if len(data) == 4 * layers else []
    return sizes if len(sizes) == layers and head + sum(sizes) <= held else None


def refusal(file: BinaryIO, place: int, held: int, record: bytes) -> str | None:
    """Why this chunk is not decoded, or None where it may be."""
    length, layers = sum(size for _, size, _ in items_of(record)), layers_of(record)
    if layers == 0:
        file.seek(place + length)
        return None if held < length + 4 or file.read(4) != _INVALID else "a chunk begins as no program writes it"
    sizes = layer_sizes(file, place, held, length, layers)
    if sizes is None:
        return f"a chunk would have more than its {held:,} bytes"
    begin = place + length + 4 + 4 * layers
    for size in sizes:
        if size >= 4:
            file.seek(begin)
            if file.read(4) == _INVALID:
                return "a layer of a chunk begins as no program writes it"
        begin += size
    return None


def _check(file: BinaryIO, place: int, held: int, record: bytes) -> None:
    if why := refusal(file, place, held, record):
        raise ValueError(why)


def _state(file: Any) -> tuple[int, ...]:
    """What tells whether a file is still the one that was opened before."""
    found = os.fstat(file.fileno())
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


class _Piece(io.RawIOBase):
    """A chunk as a whole LAZ stream: the place of the table, the chunk's bytes, and a table of this one chunk.

    The file is open only while it is read: the next request may come late or never, and an open file can be neither removed on
    Windows nor its drive be ejected.
    """

    def __init__(self, path: bytes, file: BinaryIO, place: int, held: int, table: bytes):
        self._path, self._state, self._place, self._held = path, _state(file), place, held
        self._head, self._table, self._at = struct.pack("<q", 8 + held), table, 0
        self.why: OSError | None = None  # lazrs says only that it could not read

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._at = offset + (0, self._at, 8 + self._held + len(self._table))[whence]
        return self._at

    def readinto(self, buffer: Any) -> int:
        end = 8 + self._held
        if self._at < 8:
            data = self._head[self._at : self._at + len(buffer)]
        elif self._at < end:
            try:
                data = self._read(min(len(buffer), end - self._at))
            except OSError as error:
                self.why = error
                raise
        else:
            data = self._table[self._at - end : self._at - end + len(buffer)]
        buffer[: len(data)] = data
        self._at += len(data)
        return len(data)

    def _read(self, size: int) -> bytes:
        with open(self._path, "rb", buffering=0) as file:
            if _state(file) != self._state:
                raise OSError("the file has changed while it was read")
            file.seek(self._place + self._at - 8)
            return file.read(size)


class _Answers:
    """A request has path: the file's, in hexadecimal; record: see items_of, in hexadecimal; fields: the bits of lazrs that say
    what is decoded; chunks: place, bytes and points of each.  Of several chunks all points are decoded, on all processors; of
    one, ``count`` from number ``skip`` on, where they are given: this goes on where the last such request ended.
    """

    def __init__(self, lazrs: Any):
        self._lazrs = lazrs
        self._key, self._decoder, self._done = None, None, 0
        self._piece: _Piece | None = None
        self._out = bytearray()

    def answer(self, path: str, record: str, fields: int, chunks: list, skip: int = 0, count: int | None = None) -> bytearray:
        """The records, one after the other, in memory that the next call uses again where it needs as much.  Raises ValueError
        where a chunk is refused, and what lazrs raises."""
        described, chosen = bytes.fromhex(record), self._lazrs.DecompressionSelection(fields)
        length = sum(size for _, size, _ in items_of(described))
        if count is not None:
            key = path, fields, chunks
            if self._key != key or not 0 < self._done <= skip:
                self._begin(path, described, chosen, *chunks[0])
            return self._part(key, skip, bytearray(count * length), length)
        size = sum(points for _, _, points in chunks) * length
        if len(self._out) != size:
            self._out = bytearray(size)
        out = self._out
        data = bytearray()
        with open(bytes.fromhex(path), "rb") as file:
            for place, held, _ in chunks:
                _check(file, place, held, described)
                file.seek(place)
                data += file.read(held)
        table = [(points, held) for _, held, points in chunks]
        self._lazrs.decompress_points_with_chunk_table(data, described, out, table, chosen)
        return out

    def _begin(self, path: str, record: bytes, chosen: Any, place: int, held: int, points: int) -> None:
        self._key = self._decoder = None
        table = io.BytesIO()
        self._lazrs.write_chunk_table(table, [(points, held)], self._lazrs.LazVlr(record))
        with open(name := bytes.fromhex(path), "rb") as file:
            _check(file, place, held, record)
            self._piece = _Piece(name, file, place, held, table.getvalue())
        piece = io.BufferedReader(self._piece, 1 << 18)
        self._decoder, self._done = self._lazrs.LasZipDecompressor(piece, record, chosen), 0

    def _part(self, key: tuple, skip: int, out: bytearray, length: int) -> bytearray:
        self._key, decoder = None, self._decoder  # after an error it is not used again
        assert decoder is not None
        try:
            while self._done < skip:
                step = min(skip - self._done, 1 << 16)
                decoder.decompress_many(bytearray(step * length))
                self._done += step
            decoder.decompress_many(out)
        except self._lazrs.LazrsError as error:
            raise ((self._piece and self._piece.why) or error) from None
        self._key, self._done = key, skip + len(out) // length
        return out


def _serve() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # of the terminal; the end of the requests ends this process
    sys.path.append(sys.argv[1])
    import lazrs

    answers, out = _Answers(lazrs), sys.stdout.buffer
    for line in sys.stdin.buffer:
        try:
            data = answers.answer(**json.loads(line))
            length = len(data)
        except BaseException as error:  # a panic of Rust is none of Exception
            data = (f"{error}".strip().splitlines() or [type(error).__name__])[0][:200].encode("utf-8", "replace")
            length = -len(data)
        out.write(struct.pack("<q", length))
        out.write(data)
        out.flush()


if __name__ == "__main__":
    _serve()
