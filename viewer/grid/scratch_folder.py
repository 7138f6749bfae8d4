"""Folders in the making: beside the one they are to become, locked by who makes them, and removed once nobody does.

The system lets go of a lock when its holder ends, however it ends, and shows it to every process: in another container and,
where a network's file system knows locks, on another machine.  There a process number says nothing.
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
_SPARE = 64 << 20  # bytes left free on the disk
_TRIES = 100  # at a folder that nobody sweeps before it is locked
_FORGOTTEN = 7 * 24 * 3600.0  # seconds that nothing in it changed, after which a folder is nobody's where there are no locks


@contextmanager
def scratch(folder: Path) -> Iterator[Path]:
    """A fresh folder beside ``folder``, removed at the end whatever happens, unless it was moved.  Raises OSError."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    sweep(folder.parent)
    work, lock = _begin(folder)
    try:
        yield work
    finally:
        shutil.rmtree(work, ignore_errors=True)
        _let_go(lock)


def _begin(folder: Path) -> tuple[Path, int | None]:
    for _ in range(_TRIES):
        work = folder.with_name(f".{folder.name}.{secrets.token_hex(4)}.{os.getpid()}.tmp")
        work.mkdir()
        try:
            lock = _hold(work)
        except (FileNotFoundError, BlockingIOError):  # another swept it before it was locked
            continue
        except OSError:
            work.rmdir()
            raise
        if work.exists():
            return work, lock
        _let_go(lock)
    raise OSError(errno.EBUSY, "what is being made there is removed by others")


def reserve(file: int, size: int, folder: Path) -> None:
    """Takes ``size`` bytes of the disk for an open file in ``folder``.  Raises OSError where they are not there: a full disk
    must fail here, not as a bus error in the middle of a memory map."""
    if shutil.disk_usage(folder).free < size + _SPARE:
        raise OSError(errno.ENOSPC, f"no space left for {size / 1e6:,.0f} MB of points")
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file, 0, size)
    else:
        os.ftruncate(file, size)


def sweep(parent: Path) -> None:
    """Removes what processes that were killed left in a folder."""
    for left in parent.glob(".*.tmp"):
        if not _OURS.match(left.name) or left.is_symlink() or not left.is_dir():
            continue
        try:
            lock = _hold(left)
        except OSError:
            continue
        if lock is not None or _forgotten(left):
            shutil.rmtree(left, ignore_errors=True)
        _let_go(lock)


def move(work: Path, folder: Path) -> None:
    """Renames ``work`` to ``folder``; an older one there is put aside first: no reader sees half of each."""
    aside, lock = work.with_name(f"{work.name.removesuffix('.tmp')}.old.{os.getpid()}.tmp"), None
    if folder.exists():
        with suppress(OSError):
            lock = _hold(folder)
        folder.rename(aside)
    try:
        work.rename(folder)
    except OSError:
        if aside.exists():
            aside.rename(folder)
        raise
    finally:
        _let_go(lock)
    shutil.rmtree(aside, ignore_errors=True)


def _hold(folder: Path) -> int | None:
    """Locks a folder until what is returned is let go; None where there are no locks.  Raises OSError where another holds it,
    or it is gone."""
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


def _let_go(lock: int | None) -> None:
    if lock is not None:
        os.close(lock)


def _forgotten(folder: Path) -> bool:
    try:
        return time.time() - max(path.stat().st_mtime for path in (folder, *folder.iterdir())) > _FORGOTTEN
    except OSError:
        return False
