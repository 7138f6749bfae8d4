"""Edits by the form of a file: they know where counts and offsets are, and correct checksums and lengths afterwards.

A form is found by the file's name.  One edit in five ignores the form, as a broken disk does.
"""

import gzip
import json
import random
import re
import struct
import zlib

from . import scan_forms
from .edits import LARGEST, edited_bytes, edited_json, edited_text, put_number

_IGNORES_FORM = 0.2
_TEXTS = (".txt", ".xyz", ".csv", ".asc", ".pts", ".ptx", ".tum")
_JSONS = (".json", ".js", ".pointglass")


def edited(name: str, data: bytes, rng: random.Random) -> bytes:
    """``data`` with one edit.  name: of the file."""
    suffix = f".{name.rpartition('.')[2]}".lower()
    if rng.random() < _IGNORES_FORM or not data:
        return edited_bytes(data, rng)
    if name.rpartition("/")[2] == "meta.json":
        return _grid_header(data, rng)
    if suffix in _JSONS:
        return edited_json(data, rng)
    if suffix in _TEXTS:
        return edited_text(data, rng)
    form = {
        ".e57": scan_forms.e57,
        ".las": scan_forms.las,
        ".laz": scan_forms.las,
        ".ply": scan_forms.ply,
        ".pcd": scan_forms.pcd,
        ".spz": scan_forms.spz,
        ".glb": scan_forms.glb,
        ".png": _png,
        ".npy": _npy,
        ".gz": _gzip,
        ".zst": _zstd,
        ".safetensors": _safetensors,
        ".bin": _words,
    }.get(suffix, edited_bytes)
    try:
        return form(data, rng)[:LARGEST]
    except (ValueError, struct.error, IndexError, KeyError, OverflowError):  # an earlier edit broke the form
        return edited_bytes(data, rng)


# ---- PNG
def _png(data: bytes, rng: random.Random) -> bytes:
    """Edits chunks; their lengths and checksums fit afterwards."""
    chunks, at = [], 8
    while at + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, at)
        chunks.append([data[at + 4 : at + 8], data[at + 8 : at + 8 + size]])
        at += 12 + size
    texts = [chunk for chunk in chunks if chunk[0] in (b"iTXt", b"tEXt", b"zTXt")]
    pick = rng.random()
    if texts and pick < 0.75:
        chunk = rng.choice(texts)
        key, _, rest = chunk[1].partition(b"\0")
        skip = 4 if chunk[0] == b"iTXt" else 0
        if rng.random() < 0.05:
            packed = zlib.compress(bytes(rng.choice((1 << 16, 1 << 24, 1 << 26))))
            chunk[:] = [b"zTXt", key + b"\0\0" + packed] if rng.random() < 0.5 else [b"iTXt", key + b"\0\1\0\0\0" + packed]
        else:
            chunk[1] = key + b"\0" + rest[:skip] + edited_json(rest[skip:], rng)
    elif pick < 0.85:
        head = bytearray(chunks[0][1])
        put_number(head, *rng.choice(((0, "I"), (4, "I"), (8, "B"), (9, "B"), (10, "B"), (11, "B"), (12, "B"))), rng, ">")
        chunks[0][1] = bytes(head)
    else:
        chunk = rng.choice(chunks)
        match rng.randrange(4):
            case 0:
                chunk[1] = edited_bytes(chunk[1], rng)
            case 1:
                chunks.insert(rng.randrange(len(chunks) + 1), list(chunk))
            case 2:
                chunks.remove(chunk)
            case 3:
                chunk[0] = rng.choice(
                    (b"iTXt", b"tEXt", b"zTXt", b"IDAT", b"PLTE", b"iCCP", b"eXIf", b"acTL", b"fdAT", b"\0\0\0\0", b"IEND")
                )
    return data[:8] + b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in chunks
    )


# ---- NumPy arrays, grid headers, weights
def _npy(data: bytes, rng: random.Random) -> bytes:
    (size,) = struct.unpack_from("<H", data, 8)
    if rng.random() < 0.6:
        head = (
            edited_text(data[10 : 10 + size].replace(b",", b" , "), rng)
            if rng.random() < 0.5
            else re.sub(
                rb"'<?\|?[a-z]\d+'|\d+|True|False",
                lambda found: (
                    found.group()
                    if rng.random() < 0.6
                    else rng.choice(
                        (
                            b"0",
                            b"-1",
                            b"1",
                            b"4294967296",
                            b"'|O'",
                            b"'<f8'",
                            b"'<M8[s]'",
                            b"'V9999999'",
                            b"True",
                            b"()",
                            b"None",
                        )
                    )
                ),
                data[10 : 10 + size],
            )
        )
        if len(head) < 65536:
            return data[:8] + struct.pack("<H", len(head)) + head + data[10 + size :]
    body = edited_bytes(data[10 + size :], rng)
    return data[: 10 + size] + body


def _grid_header(data: bytes, rng: random.Random) -> bytes:
    """Edits meta.json of a grid; its checksum is corrected in nine of ten."""
    data = edited_json(data, rng)
    if rng.random() < 0.9:
        try:
            head = json.loads(data)
            head.pop("sum", None)
            head["sum"] = zlib.crc32(json.dumps(head).encode())
            return json.dumps(head).encode()
        except (ValueError, AttributeError, TypeError, RecursionError):
            pass
    return data


def _safetensors(data: bytes, rng: random.Random) -> bytes:
    (size,) = struct.unpack_from("<Q", data, 0)
    if rng.random() < 0.2:
        out = bytearray(data)
        put_number(out, 0, "Q", rng)
        return bytes(out)
    head = edited_json(data[8 : 8 + size], rng)
    return struct.pack("<Q", len(head)) + head + data[8 + size :]


# ---- compressed
def _gzip(data: bytes, rng: random.Random) -> bytes:
    try:
        plain = gzip.decompress(data)
    except (OSError, EOFError, zlib.error):
        return edited_bytes(data, rng)
    if rng.random() < 0.05:
        return gzip.compress(bytes(rng.choice((1 << 20, 1 << 26))), 1, mtime=0)
    return gzip.compress(edited_json(plain, rng), 1, mtime=0)


def _zstd(data: bytes, rng: random.Random) -> bytes:
    import zstandard

    try:
        plain = zstandard.decompress(data, max_output_size=1 << 20)
    except zstandard.ZstdError:
        return edited_bytes(data, rng)
    if rng.random() < 0.1:
        return zstandard.compress(bytes(rng.choice((1 << 20, 1 << 26))))
    return zstandard.compress(edited_bytes(plain, rng))


def _words(data: bytes, rng: random.Random) -> bytes:
    """Numbers at multiples of 2 bytes: hierarchies and binary models have nothing but numbers."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2))):
        put_number(out, 2 * rng.randrange(len(data) // 2 or 1), rng.choice("BHIIQQd"), rng)
    return bytes(out)
