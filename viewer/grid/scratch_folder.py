"""Folders that are written beside their final place (model/common/files/temporary.py) and then take it, in two renames."""

import errno
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ...model.common.files.temporary import temporary_folder
from ...model.common.process.signals import uninterrupted
from ...model.common.system import allocate, replace

_SPARE = 64 << 20
"""Bytes left free on the disk for what is written beside the points: tables and noise have 70 to 210 KB in four scans of 1.3 to
12 million points, at most 37 bytes a thousand points; this is enough for a billion."""


@contextmanager
def scratch(folder: Path, *, sources: Iterable[Path] = (), private: bool = False) -> Iterator[Path]:
    """A new folder beside ``folder``, removed at the end in any case, unless it was moved.

    sources: who may not read one of these files may not read the folder.  private: where the folder above is made for it, it is
    for its owner only.  Raises OSError.
    """
    folder.parent.mkdir(mode=0o700 if private else 0o777, parents=True, exist_ok=True)
    with temporary_folder(folder, sources=sources) as work:
        yield work


def reserve(file: int, size: int, folder: Path) -> None:
    """Allocates ``size`` bytes of the disk for an open file in ``folder``.  Raises OSError where they are not free: a full disk
    must fail here, not as a bus error of the memory map."""
    if shutil.disk_usage(folder).free < size + _SPARE:
        raise OSError(errno.ENOSPC, f"no space left for {size / 1e6:,.0f} MB of points")
    allocate(file, size)


def move(work: Path, folder: Path) -> None:
    """Renames ``work`` to ``folder``.  An older folder is renamed first, so that no reader sees parts of both."""
    aside = work.with_name(f"{work.name.removesuffix('.partial')}.old.{os.getpid()}.partial")
    with uninterrupted():
        if folder.exists():
            replace(folder, aside)
        try:
            replace(work, folder)
        except OSError:
            if aside.exists():
                replace(aside, folder)
            raise
    shutil.rmtree(aside, ignore_errors=True)
