"""What a scan of so many points would take of this machine, and whether it has it: said beforehand, not found out."""

import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

from viewer.settings import Memory
from viewer.stream.residency import available_memory

POOL = Memory(gpu=2 << 30)
"""What points may take, so that a billion of them fly with gigabytes to spare."""
POINT_BYTES = 12
_OVERHEAD = 1.1  # cell tables
_BASE = 400 << 20  # bytes: the process, OpenGL, one chunk of each thread
_SPARE = 1 << 30  # bytes left free on the disk
_UNKNOWN = 4 << 30  # bytes: a system that does not say is taken for a small one
_SHARE = 0.5  # of the memory at hand


@dataclass(frozen=True)
class Room:
    """What there is: bytes of memory and, where the cache lies, of disk."""

    memory: int
    disk: int


def available(folder: Path) -> Room:
    """Memory that can be had without swapping (a container's limit counts), and disk in the nearest folder that exists."""
    memory = available_memory()
    while not folder.exists():
        folder = folder.parent
    return Room(_UNKNOWN if memory is None else memory, shutil.disk_usage(folder).free)


def needed(points: int) -> Room:
    """What a scan of that many points takes: on the disk its grid, in memory the renderer's pool and what is read ahead."""
    grid = int(points * POINT_BYTES * _OVERHEAD)
    return Room(min(grid, (POOL.gpu or 0) + POOL.read_ahead) + _BASE, grid + _SPARE)


def problem(points: int, there: Room) -> str | None:
    """Why that many points do not fit, in one line; None where they do."""
    need = needed(points)
    for what, wanted, given, share in (("memory", need.memory, there.memory, _SHARE), ("disk", need.disk, there.disk, 1.0)):
        if wanted > share * given:
            part = f"half of the {given / 1e9:.1f} GB" if share < 1 else f"the {given / 1e9:.1f} GB"
            return f"does not fit: needs {wanted / 1e9:.1f} GB of {what}, {part} at hand {'is' if share < 1 else 'are'} less"
    return None


def resident() -> int:
    """Bytes of memory this process holds, mapped files included."""
    try:
        for line in Path("/proc/self/status").read_text().splitlines():
            if line.startswith("VmRSS:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    try:
        import resource
    except ImportError:
        return 0
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
