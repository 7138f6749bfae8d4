"""Scratch folders: a folder is written beside its final place, locked by the writing process, and removed if that process ends.

The system releases a lock when its process ends, in whatever way.  All processes see the lock, also in other containers and, on
network file systems with locks, on other machines, where a process number would mean nothing.
"""

import errno
import os
import re
import secrets
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

_OURS = re.compile(r"^\..+\.[0-9a-f]{8}\.\d+(\.old\.\d+)?\.tmp$")
_SPARE = 64 << 20  # bytes left free on the disk; chosen by hand
_TRIES = 100  # attempts to create a folder that no other process sweeps before it is locked; chosen by hand
_ABANDONED = 7 * 24 * 3600.0  # seconds without a change after which a folder counts as abandoned without locks; chosen by hand


@contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """A new folder beside ``folder``, removed at the end in any case, unless it was moved.  Raises OSError."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    sweep(folder.parent)
    work, lock = _create(folder)
    try:
        yield work
    finally:
        shutil.rmtree(work, ignore_errors=True)
        _release(lock)


def _create(folder: Path) -> tuple[Path, int | None]:
    for _ in range(_TRIES):
        work = folder.with_name(f".{folder.name}.{secrets.token_hex(4)}.{os.getpid()}.tmp")
        work.mkdir()
        try:
            lock = _lock(work)
        except (FileNotFoundError, BlockingIOError):  # another process swept it before it was locked
            continue
        except OSError:
            work.rmdir()
            raise
        if work.exists():
            return work, lock
        _release(lock)
    raise OSError(errno.EBUSY, "its scratch folders are removed by another process")


def reserve(file: int, size: int, folder: Path) -> None:
    """Allocates ``size`` bytes of the disk for an open file in ``folder``.  Raises OSError where they are not free: a full disk
    must fail here, not as a bus error of the memory map."""
    if shutil.disk_usage(folder).free < size + _SPARE:
        raise OSError(errno.ENOSPC, f"no space left for {size / 1e6:,.0f} MB of points")
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file, 0, size)
    else:
        os.ftruncate(file, size)


def sweep(parent: Path) -> None:
    """Removes scratch folders in ``parent`` whose processes were killed."""
    for left in parent.glob(".*.tmp"):
        if not _OURS.match(left.name) or left.is_symlink() or not left.is_dir():
            continue
        try:
            lock = _lock(left)
        except OSError:
            continue
        if lock is not None or _is_abandoned(left):
            shutil.rmtree(left, ignore_errors=True)
        _release(lock)


def move(work: Path, folder: Path) -> None:
    """Renames ``work`` to ``folder``.  An older folder is renamed first, so that no reader sees parts of both."""
    aside, lock = work.with_name(f"{work.name.removesuffix('.tmp')}.old.{os.getpid()}.tmp"), None
    if folder.exists():
        with suppress(OSError):
            lock = _lock(folder)
        folder.rename(aside)
    try:
        work.rename(folder)
    except OSError:
        if aside.exists():
            aside.rename(folder)
        raise
    finally:
        _release(lock)
    shutil.rmtree(aside, ignore_errors=True)


def _lock(folder: Path) -> int | None:
    """Locks a folder until the returned file is passed to _release; None where there are no locks.  Raises OSError where
    another process holds it, or it is gone."""
    if fcntl is None:
        return None
    file = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(file)
        raise
    except OSError:
        os.close(file)
        return None
    return file


def _release(lock: int | None) -> None:
    if lock is not None:
        os.close(lock)


def _is_abandoned(folder: Path) -> bool:
    try:
        return time.time() - max(path.stat().st_mtime for path in (folder, *folder.iterdir())) > _ABANDONED
    except OSError:
        return False
