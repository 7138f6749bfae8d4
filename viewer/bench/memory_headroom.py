"""Estimates whether a scan fits into the memory and on the disk of this machine, before it is made."""

import shutil
from dataclasses import dataclass
from pathlib import Path

from ...model.common.system import available_memory
from ..picture.settings import Memory

POOL = Memory(gpu=2 << 30)
"""Limit of the points' memory, so that a billion points, 12 GB, are viewed with a sixth of them at a time."""
POINT_BYTES = 12
"""Bytes of a packed point."""
_OVERHEAD = 1.1
"""Factor for the cell tables, on the safe side: on disk they have 0.1 to 0.5 % of the points' bytes in four scans."""
_BASE = 400 << 20
"""Bytes of the process, OpenGL, and a chunk of each thread: `render` of 50,000 points has 260 to 270 MiB."""
_SPARE = 1 << 30
"""Bytes that must stay free on the disk."""
_UNKNOWN = 4 << 30
"""Bytes of memory assumed if the system does not report it."""
_SHARE = 0.5
"""Largest share of the available memory that is used."""


@dataclass(frozen=True)
class Room:
    """Bytes of memory, and of disk in the cache's file system."""

    memory: int
    disk: int


def available(folder: Path) -> Room:
    """Memory available without swapping (within a container's limit), and disk of the nearest existing parent of ``folder``."""
    memory = available_memory()
    while not folder.exists():
        folder = folder.parent
    return Room(_UNKNOWN if memory is None else memory, shutil.disk_usage(folder).free)


def needed(points: int) -> Room:
    """Memory and disk that a scan needs: the renderer's pool and prefetched points, and the grid."""
    grid = int(points * POINT_BYTES * _OVERHEAD)
    return Room(min(grid, (POOL.gpu or 0) + POOL.read_ahead) + _BASE, grid + _SPARE)


def problem(points: int, there: Room) -> str | None:
    """Reason why the points do not fit, in one line; None if they fit."""
    need = needed(points)
    for what, wanted, given, share in (("memory", need.memory, there.memory, _SHARE), ("disk", need.disk, there.disk, 1.0)):
        if wanted > share * given:
            limit = "half of the available" if share < 1 else "the available"
            return f"does not fit: needs {wanted / 1e9:.1f} GB of {what}, more than {limit} {given / 1e9:.1f} GB"
    return None
