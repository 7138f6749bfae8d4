"""Names of files that are made of names from files: of cameras in a camera file or a picture's metadata, of scans, of frames.

Every such name goes through :func:`safe_name`, and what is written under one through :func:`inside`, which refuses a name that
leads out of its folder.
"""

import re
import unicodedata
from collections.abc import Sequence
from pathlib import Path

from .errors import InputError

_LONGEST = 150  # bytes; a file name may have 255, and endings are still to come
_RESERVED = re.compile(r"^(con|prn|aux|nul|com[0-9]|lpt[0-9])(\.|$)", re.IGNORECASE)
"""Devices of Windows, with any ending."""


def safe_name(name: str, otherwise: str = "") -> str:
    """``name`` as one part of a path: letters and digits of any language, ``.``, ``_``, ``+`` and ``-``; at most 150 bytes, not
    hidden, no device.  otherwise: returned where nothing is left of it."""
    name = unicodedata.normalize("NFC", name)
    name = re.sub(r"\.{2,}", ".", re.sub(r"[^\w.+-]+", "_", name)).lstrip(".")
    name = name.encode("utf-8", "ignore")[:_LONGEST].decode(errors="ignore").rstrip(".")
    return (f"_{name}" if _RESERVED.match(name) else name) or otherwise


def unique_names(names: Sequence[str], otherwise: str) -> list[str]:
    """Safe names, no two alike even where case does not count.  otherwise: the beginning of a name of which nothing is left.

    The first of each name keeps it; those that repeat it get a number that no other name has.
    """
    safe = [safe_name(name, f"{otherwise}_{index:05d}") for index, name in enumerate(names)]
    taken = {name.casefold() for name in safe}
    out: list[str] = []
    copies: dict[str, int] = {}
    for base in safe:
        name, key = base, base.casefold()
        if key in copies:
            while name.casefold() in taken:
                copies[key] += 1
                name = f"{base}_{copies[key]}"
        copies.setdefault(key, 1)
        out.append(name)
    return out


def inside(folder: Path, name: str) -> Path:
    """The path of the file ``name`` directly in ``folder``.  Raises InputError where that is not what the name means."""
    if not name or name in (".", "..") or any(c in "/\\\0" for c in name) or len(name) > 255:
        raise InputError(f"{name!r:.300} is no name of a file; nothing is written under it")
    return folder / name


def leads_elsewhere(name: str) -> bool:
    """Whether a name, taken as a path, leads out of the folder it is relative to: absolute, of a drive, or upwards."""
    return bool(re.match(r"^([/\\]|[A-Za-z]:[/\\])", name)) or ".." in re.split(r"[/\\]", name)
