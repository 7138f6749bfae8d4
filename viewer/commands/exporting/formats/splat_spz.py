"""Splats as SPZ (Niantic, https://github.com/nianticlabs/spz), version 3: a gzip stream of a header and columns.

Frame of the file: x right, y up, z back, metres where the unit is known.  Coordinates are 24-bit fixed-point numbers with as
many bits behind the point as the extent leaves; scales are bytes in steps of exp(1/16).

The format has no place for facts of the scan.  They stand as JSON in the comment that a gzip header may have (RFC 1952), which
other readers skip.
"""

import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from ....common.errors import InputError
from ....work.splats.splat_cloud import Splats

MAGIC, VERSION = 0x5053474E, 3
COLOUR = 0.15
"""Colour byte / 255 = 0.5 + COLOUR * coefficient of degree 0."""
HARMONIC = 128.0
"""Byte of a coefficient of degree 1 = HARMONIC * (1 + coefficient), [order; channel]."""
MOST = 10_000_000
"""Splats that the format's own reader takes."""
_FINEST, _COARSEST = 20, 0
"""Bits behind the point: 1 µm is finer than any scan."""
_SHORT = 511
"""Largest magnitude of a component of a quaternion, 9 bits."""
_LEVEL = 6
"""Of the compression: zlib's default."""
_BLOCK = 1 << 20
"""Splats packed at a time."""
_GZIP, _COMMENT = b"\x1f\x8b\x08", 0x10
"""First bytes of gzip with deflate, and the flag of a comment."""
MOST_FACTS = 1 << 14
"""Bytes of the comment; without the reference system's definition where it would have more."""


def fraction_bits(reach: float) -> int:
    """Bits behind the point of coordinates up to ``reach`` in 24 bits with sign.  Raises InputError where there are none."""
    bits = 23 - int(np.ceil(np.log2(max(reach, 1e-6) + 1)))
    if bits < _COARSEST:
        raise InputError(f"the points reach {reach:,.0f} units from their middle, SPZ holds {2**23:,}", option="--out",
                         remedy="export a part of the scan with --clip, or as GLB or PLY")
    return min(bits, _FINEST)


def write_splat_spz(path: Path, splats: Splats, facts: dict[str, Any], advance) -> None:
    """Writes a file.  splats: in the file's frame.  facts: of the scan, for the comment.  advance: called with the number of
    splats that were written."""
    if len(splats) > MOST:
        raise InputError(f"SPZ holds {MOST:,} splats at most, these are {len(splats):,}", option="--budget",
                         remedy="give a smaller one, or write GLB or PLY")
    bits = fraction_bits(float(np.abs(splats.xyz).max()))
    packer, checksum, size = zlib.compressobj(_LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS), 0, 0
    columns = (lambda some: _fixed(splats.xyz[some], bits), lambda some: _byte(splats.opacity[some] * 255.0),
               lambda some: _byte((splats.sh0[some] * COLOUR + 0.5) * 255.0),
               lambda some: _byte((np.log(splats.scale[some]) + 10) * 16),
               lambda some: packed_quaternions(splats.rotation[some]),
               *([lambda some: _byte(splats.sh1(some) * HARMONIC + HARMONIC)] if splats.degree else []))
    done = 0
    with path.open("wb") as file:
        file.write(_GZIP + bytes([_COMMENT, 0, 0, 0, 0, 0, 255]) + _comment(facts) + b"\0")
        data = struct.pack("<IIIBBBB", MAGIC, VERSION, len(splats), splats.degree, bits, 0, 0)
        file.write(packer.compress(data))
        checksum, size = zlib.crc32(data), len(data)
        for number, column in enumerate(columns, 1):
            for start in range(0, len(splats), _BLOCK):
                data = column(slice(start, start + _BLOCK)).tobytes()
                file.write(packer.compress(data))
                checksum, size = zlib.crc32(data, checksum), size + len(data)
            now = len(splats) * number // len(columns)
            advance(now - done)
            done = now
        file.write(packer.flush() + struct.pack("<II", checksum, size & 0xFFFFFFFF))


def _comment(facts: dict[str, Any]) -> bytes:
    text = json.dumps(facts).encode("ascii")
    return text if len(text) <= MOST_FACTS else json.dumps({key: facts[key] for key in facts if key != "wkt"}).encode("ascii")


def _fixed(values: np.ndarray, bits: int) -> np.ndarray:
    whole = np.rint(values * float(1 << bits)).astype("<i4")
    return np.ascontiguousarray(whole).view(np.uint8).reshape(*whole.shape, 4)[..., :3]


def _byte(values: np.ndarray) -> np.ndarray:
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def packed_quaternions(rotation: np.ndarray) -> np.ndarray:
    """(n,) uint32: quaternions w, x, y, z by their three smallest components.

    From the top: 2 bits, which of x, y, z, w is left out, the largest; then the others in this order, a sign and 9 bits each of
    their magnitude over the square root of one half.
    """
    parts = rotation[:, [1, 2, 3, 0]].astype(np.float64)
    rows, largest = np.arange(len(parts)), np.abs(parts).argmax(axis=1)
    parts = parts * np.where(parts[rows, largest] < 0, -1.0, 1.0)[:, None]
    words = largest.astype(np.uint32)
    for axis in range(4):
        size = np.floor(_SHORT * np.abs(parts[:, axis]) * np.sqrt(2.0) + 0.5).clip(0, _SHORT).astype(np.uint32)
        code = (parts[:, axis] < 0).astype(np.uint32) << np.uint32(9) | size
        words = np.where(largest == axis, words, words << np.uint32(10) | code)
    return words.astype("<u4")
