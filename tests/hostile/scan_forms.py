"""Edits of scan files by their form: LAS, E57, PLY, PCD, SPZ, GLB."""

import gzip
import random
import re
import struct
import zlib
from functools import lru_cache

from .checksums import crc32c
from .edits import WORDS, edited_bytes, edited_json, edited_text, put_number

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


def las(data: bytes, rng: random.Random) -> bytes:
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
def e57(data: bytes, rng: random.Random) -> bytes:
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
def ply(data: bytes, rng: random.Random) -> bytes:
    return _headed(data, data.find(b"end_header") + 10, b"ascii" in data[:200], rng)


def pcd(data: bytes, rng: random.Random) -> bytes:
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


# ---- SPZ: a header and columns in gzip, or a header and a table before zstandard frames
def spz(data: bytes, rng: random.Random) -> bytes:
    packed = data.startswith(b"\x1f\x8b")
    try:
        out = bytearray(gzip.decompress(data) if packed else data)
    except (OSError, EOFError, zlib.error):  # an earlier edit broke the stream
        return edited_bytes(data, rng)
    places = [(4, "I"), (8, "I"), (12, "B"), (13, "B"), (14, "B"), (15, "B")]
    if not packed:
        places += [(16, "I"), *((32 + 8 * number, "Q") for number in range(12))]
    if rng.random() < 0.7:
        put_number(out, *rng.choice(places), rng)
    elif rng.random() < 0.1:
        out += bytes(1 << 24)
    else:
        out = bytearray(edited_bytes(bytes(out), rng))
    return gzip.compress(bytes(out), 1, mtime=0) if packed else bytes(out)


# ---- GLB: a description of JSON, and a buffer
def glb(data: bytes, rng: random.Random) -> bytes:
    """Edits the description, and its length fits afterwards; or the buffer; or the heads of both."""
    size = struct.unpack_from("<I", data, 12)[0]
    begin, end = 20, 20 + size
    if rng.random() < 0.75:
        text = edited_json(data[begin:end], rng)
        text += b" " * (-len(text) % 4)
        rest = data[end:]
        return data[:8] + struct.pack("<II", 20 + len(text) + len(rest), len(text)) + data[16:20] + text + rest
    if rng.random() < 0.5:
        return data[: end + 8] + edited_bytes(data[end + 8 :], rng)
    out = bytearray(data)
    put_number(out, rng.choice((4, 8, 12, 16, end, end + 4)), "I", rng)
    return bytes(out)
