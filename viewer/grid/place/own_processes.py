"""How many processes convert the files of a place where nobody has said who does."""

import sys
from collections.abc import Sequence
from pathlib import Path

from ....model.common.process.processors import sharing_processes, usable_processors
from ....model.common.system import address_space_is_limited, available_memory
from ...common.workers.worker_choice import Workers

MEMORY = 1 << 30
"""Bytes that a process which converts a file may need."""
WORTH = 64 << 20
"""Bytes of files for each process from which it is started: about 6 s of conversion of LAZ, 2 s of LAS, against 2.4 s of a
processor to start."""


def own_processes(files: Sequence[Path]) -> Workers | None:
    """As many processes of this machine as processors and free memory allow, and ``files`` are worth; None: this process, which
    converts one after the other.  A process that shares its machine with others of the same work starts none."""
    if len(files) < 2 or sharing_processes() > 1 or not sys.executable or address_space_is_limited():
        return None
    size = sum(file.stat().st_size for file in files if file.is_file())
    free = available_memory()
    count = min(usable_processors(), len(files), size // WORTH, *([] if free is None else [free // MEMORY]))
    return Workers(int(count)) if count > 1 else None


def largest_first(files: Sequence[Path]) -> list[Path]:
    """The order in which processes take files: no large one is left for the end, when others have nothing to do."""
    return sorted(files, key=lambda file: -file.stat().st_size if file.is_file() else 0)
