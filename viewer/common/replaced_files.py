"""Which files a command replaces: it says so in one line on standard error, whatever it writes.

A file counts as replaced where it was there before and another one is there afterwards: nothing is claimed of a file that a
failure or ``--resume`` has left alone.  Python and the window do not say it: the window asks before.
"""

import contextlib
from collections.abc import Iterable, Iterator
from pathlib import Path

from ...model.common.files.atomic_write import passes_through
from ...model.common.process.signals import cleaned
from .failures import tell


@contextlib.contextmanager
def replaced_told(paths: Iterable[Path]) -> Iterator[None]:
    """Says at the end of the block, in whatever way it ends, which of ``paths`` were replaced within it.

    paths: files, and folders that are replaced as a whole; those that are not there yet, devices and pipes count for nothing.
    """
    before = {path: mark for path in dict.fromkeys(paths) if (mark := _mark(path)) is not None}

    def say() -> None:
        found = [path for path, mark in before.items() if _mark(path) not in (None, mark)]
        more = f" and {len(found) - 1:,} other file{'s' if len(found) > 2 else ''}" if found[1:] else ""
        if found:
            tell(f"replaces {found[0]}{more}")

    with cleaned(say):
        yield


def _mark(path: Path) -> tuple | None:
    """What tells a file, or a folder, from one that takes its place; None where there is none, of devices and of pipes."""
    try:
        stat = path.stat()
        if path.is_dir():
            return (stat.st_dev, stat.st_ino)
        return None if passes_through(path) else (stat.st_dev, stat.st_ino, stat.st_mtime_ns, stat.st_size)
    except (OSError, ValueError):
        return None
