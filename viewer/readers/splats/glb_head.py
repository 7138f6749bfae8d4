"""Whether a binary glTF holds Gaussian splats, by its description.  Imports nothing heavy: the table of formats reads it."""

import json
import struct
from pathlib import Path
from typing import Any

MAGIC = b"glTF"
EXTENSION = "KHR_gaussian_splatting"
_JSON = 0x4E4F534A
_HEAD = 20
"""Bytes of the header and of the head of the first chunk."""
_MOST_JSON = 64 << 20
"""Bytes of a description; that of a file of splats has a few thousand."""


def description(path: Path) -> tuple[dict[str, Any], int] | None:
    """The description of a GLB and where its buffer begins; None where it is no GLB 2, or damaged."""
    with path.open("rb") as file:
        head = file.read(_HEAD)
        if len(head) < _HEAD or head[:4] != MAGIC:
            return None
        version, _, size, kind = struct.unpack_from("<IIII", head, 4)
        if version != 2 or kind != _JSON or size > _MOST_JSON:
            return None
        try:
            found = json.loads(file.read(size))
        except (ValueError, RecursionError):
            return None
    return (found, _HEAD + size + 8) if isinstance(found, dict) else None


def holds_splats(path: Path) -> bool:
    """Whether a file is a GLB that says it uses the extension; False where it cannot be read."""
    try:
        found = description(path)
    except OSError:
        return False
    used = found[0].get("extensionsUsed") if found else None
    return isinstance(used, list) and EXTENSION in used
