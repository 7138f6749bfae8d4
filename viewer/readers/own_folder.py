"""What a folder of many files may read: itself.  Its description may name files; none of them may lie outside, by name or by
link.

Also how far compressed data may unpack: what a few kilobytes claim to hold must not take gigabytes of memory.
"""

import os
from pathlib import Path

from ..common.errors import InputError
from ..common.file_names import leads_elsewhere

MOST_RATIO = 1000
"""Times its size to which compressed data may unpack: several times what constant columns of real points reach, a
few hundred."""
MOST_UNPACKED = 256 << 20
"""Bytes that are unpacked or parsed at once, at most: over fifty times the few megabytes of the largest real pieces known, the
nodes of PotreeConverter 2."""
_LONGEST_NAME = 255
"""Characters of a name; file systems allow no longer one."""
LEAST_UNPACKED = 1 << 20
"""Bytes to which anything may unpack: far less than the coordinates of one chunk take (24 MB), so that no memory is at risk."""


def own_path(folder: Path, name: str) -> Path:
    """The path ``name`` below ``folder``.  Raises InputError where it leads out of it."""
    path = folder / name
    if len(name) > _LONGEST_NAME:
        raise InputError(f"{name!r:.80}... is no name of a folder or file, it has {len(name):,} characters", file=folder,
                         remedy="copy or convert the scan again")
    if leads_elsewhere(name) or "\0" in name or not is_inside(folder, path):
        raise InputError(f"{name!r:.80} leads out of this folder; only what lies inside is read, copy it there", file=folder)
    return path


def is_inside(folder: Path, path: Path) -> bool:
    """Whether a path leads, links followed, to something inside ``folder``."""
    try:
        return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))
    except (OSError, ValueError):
        return False


def refuse_link_out(folder: Path, file: Path) -> None:
    """Raises InputError where ``file``, which lies directly in a folder inside ``folder``, is a link that leads out of it."""
    if file.is_symlink() and not is_inside(folder, file):
        raise InputError("is a link that leads out of its folder; only what lies inside is read, copy it there", file=file)


def may_unpack(packed: int, unpacked: int) -> bool:
    """Whether ``packed`` bytes may hold ``unpacked``."""
    return unpacked <= max(LEAST_UNPACKED, packed * MOST_RATIO)
