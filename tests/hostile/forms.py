"""Edits by the form of a file: they know where counts and offsets are, and correct checksums and lengths afterwards.

A form is found by the file's name.  One edit in five ignores the form, as a broken disk does.
"""

import gzip
import json
import random
import re
import struct
import zlib
from functools import lru_cache

from .checksums import crc32c
from .edits import LARGEST, WORDS, edited_bytes, edited_json, edited_text, put_number

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
        ".e57": _e57,
        ".las": _las,
        ".laz": _las,
        ".ply": _ply,
        ".pcd": _pcd,
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


# ---- LAS, LAZ
_LAS = (
    (4, "H"),
    (6, "H"),
    (24, "B"),
    (25, "B"),
    (94, "H"),
    (96, "I"),
    (100, "I"),
    (104, "B"),
    (105, "H"),
    (107, "I"),
    (111, "I"),
    *((131 + 8 * i, "d") for i in range(12)),
    (227, "Q"),
    (235, "Q"),
    (243, "I"),
    (247, "Q"),
    (255, "Q"),
)


def _las(data: bytes, rng: random.Random) -> bytes:
    places = [(at, kind) for at, kind in _LAS]
    header, points, records = struct.unpack_from("<HII", data, 94)
    if rng.random() < 0.5:
        places = _las_records(data, header, min(records, 20), 54)
        if len(data) > 255 and data[25] >= 4:
            start, number = struct.unpack_from("<QI", data, 235)
            places += _las_records(data, start, min(number, 20), 60)
        if points + 8 <= len(data):
            places += [(points, "q")] * 3
            (table,) = struct.unpack_from("<q", data, points)
            places += [(table, "I"), (table + 4, "I"), (table + 8, "I"), (len(data) - 8, "q")]
            places += [(points + 8 + 4 * i, "I") for i in range(24)]  # sizes of the layers of the first chunk
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2))):
        put_number(out, *rng.choice(places), rng)
    return bytes(out)


def _las_records(data: bytes, at: int, number: int, head: int) -> list[tuple[int, str]]:
    found = []
    for _ in range(number):
        if at + head > len(data):
            break
        found += [(at + 2 + rng, "B") for rng in (0, 5)] + [(at + 18, "H"), (at + 20, "H" if head == 54 else "Q")]
        (size,) = struct.unpack_from("<H" if head == 54 else "<Q", data, at + 20)
        found += [(at + head + place, kind) for place in range(0, min(size, 192), 4) for kind in "HI"]
        at += head + min(size, len(data))
    return found


# ---- E57
def _e57(data: bytes, rng: random.Random) -> bytes:
    """Edits the logical bytes; the checksum of each page, and the lengths in the header, fit afterwards (nearly always)."""
    pages = [data[i : i + 1024] for i in range(0, len(data), 1024)]
    logical = bytearray(b"".join(page[:1020] for page in pages))
    place, length = struct.unpack_from("<2Q", logical, 24)
    begin = place // 1024 * 1020 + place % 1024
    if not 48 <= begin <= begin + length <= len(logical):
        raise ValueError("its XML is elsewhere")
    xml = bytes(logical[begin : begin + length])
    if rng.random() < 0.55:
        xml = _xml(xml, rng)
        logical[begin : begin + length] = xml
        struct.pack_into("<Q", logical, 32, len(xml))
    else:
        places = [(at, "Q") for at in (16, 24, 32, 40)] + [(8, "I"), (12, "I")]
        for found in re.finditer(rb'fileOffset="(\d+)"', xml):
            physical = int(found.group(1))
            at = physical // 1024 * 1020 + physical % 1024
            places += [(at, "B"), (at + 8, "Q"), (at + 16, "Q"), (at + 24, "Q")] * 2
            places += [(at + 32 + i, kind) for i in range(0, 40, 2) for kind in "BHI"]
        put_number(logical, *rng.choice(places), rng)
        if rng.random() < 0.3:
            body = edited_bytes(bytes(logical[48:begin]), rng)[: begin - 48]
            logical[48:begin] = body.ljust(begin - 48, b"\0")
    logical += bytes(-len(logical) % 1020)
    if rng.random() < 0.9:
        struct.pack_into("<Q", logical, 16, len(logical) // 1020 * 1024)
    return b"".join(
        bytes(page) + struct.pack(">I", _page_sum(bytes(page)))
        for page in (logical[i : i + 1020] for i in range(0, len(logical), 1020))
    )


@lru_cache(maxsize=4096)
def _page_sum(page: bytes) -> int:
    return crc32c(page)


def _xml(xml: bytes, rng: random.Random) -> bytes:
    """One edit of an XML text: a number or an attribute, an element deleted, doubled, renamed or nested."""
    numbers = list(re.finditer(rb'(?<=[">])[-+0-9.eE]+(?=["<])', xml))
    elements = list(re.finditer(rb"<(\w+)[^<>]*(?:/>|>[^<>]*</\1>)", xml))
    match rng.randrange(8):
        case 0 | 1 | 2 if numbers:
            found = rng.choice(numbers)
            return xml[: found.start()] + rng.choice(WORDS) + xml[found.end() :]
        case 3 if elements:
            found = rng.choice(elements)
            return xml[: found.start()] + xml[found.end() :]
        case 4 if elements:
            found = rng.choice(elements)
            return xml[: found.end()] + found.group() + xml[found.end() :]
        case 5:
            kinds = (b"Integer", b"Float", b"ScaledInteger", b"String", b"Structure", b"Vector", b"CompressedVector", b"Blob")
            found = rng.choice(list(re.finditer(rb'(?<=type=")\w+(?=")', xml)) or [None])
            return xml if found is None else xml[: found.start()] + rng.choice(kinds) + xml[found.end() :]
        case 6:
            found = rng.choice(list(re.finditer(rb"(?<=</)\w+|(?<=<)\w+", xml)) or [None])
            if found is not None:
                name = rng.choice(
                    (
                        b"a",
                        b"points",
                        b"cartesianX",
                        b"colorRed",
                        b"intensity",
                        b"pose",
                        b"data3D",
                        found.group()[::-1],
                        b"\xff",
                    )
                )
                return xml.replace(b"<" + found.group(), b"<" + name).replace(b"</" + found.group(), b"</" + name)
        case 7:
            found = rng.choice(list(re.finditer(rb"(?<=>)[^<>]*(?=<)", xml)) or [None])
            if found is not None:
                word = rng.choice(
                    (*WORDS, b"<a>" * 50 + b"</a>" * 50, b"<a>" * 3000, b"<![CDATA[" + b"x" * 100 + b"]]>", b"&#0;", b"&lol;")
                )
                return xml[: found.start()] + word + xml[found.end() :]
    return edited_bytes(xml, rng)


# ---- PLY, PCD: a header of text, then lines or binary
def _ply(data: bytes, rng: random.Random) -> bytes:
    return _headed(data, data.find(b"end_header") + 10, b"ascii" in data[:200], rng)


def _pcd(data: bytes, rng: random.Random) -> bytes:
    end = data.find(b"DATA")
    compressed = b"DATA binary_compressed" in data
    if compressed and rng.random() < 0.4:
        out = bytearray(data)
        start = data.find(b"\n", end) + 1
        put_number(out, start + rng.choice((0, 4, 8, 9, 10, rng.randrange(8, 200))), rng.choice("IIB"), rng)
        return bytes(out)
    return _headed(data, end + 4, b"DATA ascii" in data, rng)


def _headed(data: bytes, end: int, text: bool, rng: random.Random) -> bytes:
    if text and rng.random() < 0.4:
        return edited_text(data, rng, (end, len(data)))
    if rng.random() < 0.8:
        return edited_text(data, rng, (0, end))
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
