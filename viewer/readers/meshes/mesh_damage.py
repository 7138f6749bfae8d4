"""What is wrong with a mesh file that the decoding library refuses, in our words: checks of heads before, kinds of errors."""

import json
import struct
from pathlib import Path

from ...common.errors import InputError

_GLTF, _JSON = b"glTF", 0x4E4F534A
_TRIANGLE, _HEAD = 50, 84
"""Bytes of a triangle of a binary STL, and before the first."""
AGAIN = "export it again"


def check_head(path: Path, data: bytes) -> None:
    """Raises InputError where the head of a GLB, glTF or STL file contradicts the rest."""
    suffix = path.suffix.lower()
    if suffix == ".glb":
        _check_glb(path, data)
    elif suffix == ".gltf":
        _check_json(path, data)
    elif suffix == ".stl" and data.lstrip()[:5].lower() != b"solid":
        count = struct.unpack_from("<I", data, 80)[0] if len(data) >= _HEAD else None
        if count is None or len(data) < _HEAD + _TRIANGLE * count:
            wanted = "its head of 84 bytes" if count is None else f"the {count:,} triangles that it states"
            raise InputError(f"{len(data):,} bytes do not hold {wanted}: it is cut off or no STL", file=path, remedy=AGAIN)


def _check_glb(path: Path, data: bytes) -> None:
    if data[:4] == _GLTF and len(data) < 20:
        raise InputError(f"{len(data)} bytes do not hold the head of a GLB: it is cut off", file=path, remedy=AGAIN)
    if data[:4] != _GLTF:
        begin = data[:4].decode("ascii", "backslashreplace")
        raise InputError(f"begins with {begin!r}, a GLB begins with 'glTF'", file=path, remedy=AGAIN)
    version, length, first, kind = struct.unpack_from("<IIII", data, 4)
    if version != 2:
        raise InputError(f"is a GLB of version {version}, 2 is read", file=path, remedy="export it as glTF 2.0")
    if length > len(data) or 20 + first > len(data):
        raise InputError(f"states {max(length, 20 + first):,} bytes and has {len(data):,}: it is cut off", file=path,
                         remedy=AGAIN)
    if kind != _JSON:
        raise InputError(f"its first chunk is of kind {kind:#010x}, that of JSON is {_JSON:#010x}", file=path, remedy=AGAIN)
    _check_json(path, data[20 : 20 + first])


def _check_json(path: Path, data: bytes) -> None:
    try:
        found = json.loads(data)
    except RecursionError:
        raise InputError("its JSON is nested too deeply", file=path, remedy=AGAIN) from None
    except ValueError as error:  # not UTF-8, too
        where = f" at byte {error.pos:,} of it" if isinstance(error, json.JSONDecodeError) else ""
        raise InputError(f"its description is no JSON{where}", file=path, remedy=AGAIN) from None
    if not isinstance(found, dict) or not isinstance(found.get("asset"), dict):
        raise InputError('its description has no "asset": it is no glTF', file=path, remedy=AGAIN)
    version = str(found["asset"].get("version", ""))[:20]
    if not version.startswith("2."):
        raise InputError(f"is glTF of version {version!r}, 2 is read", file=path, remedy="export it as glTF 2.0")


def words_of(error: Exception) -> str:
    """What an error of the decoding library means, without its words."""
    if isinstance(error, KeyError):
        return f"something that it names is missing: {str(error.args[0])[:40]!r}" if error.args else "something is missing"
    if isinstance(error, IndexError):
        return "it points at something that it does not have"
    if isinstance(error, UnicodeError):
        return "its text is not UTF-8"
    if isinstance(error, (ValueError, TypeError, AttributeError, OverflowError)):
        return "a number or a name in it is not what the format asks for there, or it is cut off"
    return "it is damaged"
