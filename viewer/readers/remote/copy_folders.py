"""The folders of copies in the cache: one process at a time fills a copy, and old ones make room for new ones.

All copies take at most POINTGLASS_REMOTE_GB gigabytes (50 where it is not set); those used longest ago go first.
"""

import contextlib
import os
import shutil
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypeVar

from ....model.common.system import lock_file
from ...common.errors import InputError
from ...common.paths import cache_dir
from ...common.progress import progress
from .address import Address
from .local_copy import BLOCK
from .remote_object import ChangedFileError, RemoteObject

_HEAD = 4 * BLOCK
"""Bytes of the first request: the header and the records behind it of all LAS files at hand."""
_LIMIT_GB = 50.0
_RECENT_S = 3600.0
"""Copies used in the last hour stay: another process may read them."""
_SILENT_S = 1.5
"""Seconds for which another holder of a copy is waited for without a word: another thread that fetches a part."""
Copy = TypeVar("Copy")
Result = TypeVar("Result")


def use(address: Address, opened: Callable[[Path, RemoteObject], Copy], work: Callable[[Copy], Result], *,
        whole: bool = False) -> Result:
    """What ``work`` returns of the copy of an address, begun once more where the original changes meanwhile.

    opened: makes the copy, of its folder in the cache and what lies at the address.  whole: all of it is read, and older copies
    make room for it."""
    for last in (False, True):
        remote = RemoteObject(address, _HEAD)
        if whole:
            make_room(address, remote.size)
        with alone(address):
            try:
                return work(opened(folder_of(address), remote))
            except ChangedFileError:
                if last:
                    raise InputError(f"{address.text}: changes while it is read", remedy="try again later") from None
    raise AssertionError("one of two attempts ends otherwise")


@contextlib.contextmanager
def alone(address: Address) -> Iterator[None]:
    """The only one to fill the copy: waits for other processes."""
    folder = folder_of(address)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot be made ({error.strerror or error})", file=folder,
                         remedy="set POINTGLASS_CACHE to a folder that can be written") from None
    held = _lock_of(folder, address.name)
    try:
        with contextlib.suppress(OSError):
            os.utime(folder)  # used now
        yield
    finally:
        os.close(held)


def _lock_of(folder: Path, name: str) -> int:
    end = time.monotonic() + _SILENT_S
    while time.monotonic() < end:
        with contextlib.suppress(BlockingIOError):
            return lock_file(folder / "lock")
        time.sleep(0.01)
    with progress(0, f"waiting for another pointglass that reads {name}") as meter:
        while True:
            with contextlib.suppress(BlockingIOError):
                return lock_file(folder / "lock")
            meter.update(0)  # a window cancels here
            time.sleep(0.2)


def make_room(address: Address, size: int) -> None:
    """Removes the copies used longest ago where all, with the one that comes, are more than allowed."""
    limit = limit_bytes()
    others = sorted((entry for entry in home().glob("*/") if entry.name != address.key), key=_last_used)
    held = {entry: bytes_on_disk(entry) for entry in others}
    for entry in others:
        if sum(held.values()) + size <= limit or _last_used(entry) > time.time() - _RECENT_S:
            return
        shutil.rmtree(entry, ignore_errors=True)
        held.pop(entry)


def bytes_on_disk(folder: Path) -> int:
    """Bytes that the files of a folder take."""
    return sum(_on_disk(file) for file in folder.rglob("*"))


def _on_disk(file: Path) -> int:
    """Bytes that a file takes, without its holes where the system tells them."""
    try:
        found = file.stat()
    except OSError:
        return 0
    return getattr(found, "st_blocks", -(-found.st_size // 512)) * 512


def limit_bytes() -> float:
    """Bytes that all copies may take."""
    text = os.environ.get("POINTGLASS_REMOTE_GB", "")
    try:
        return 1e9 * (float(text) if text else _LIMIT_GB)
    except ValueError:
        raise InputError(f"POINTGLASS_REMOTE_GB is {text!r}: expected a number of gigabytes") from None


def _last_used(folder: Path) -> float:
    try:
        return folder.stat().st_mtime
    except OSError:
        return 0.0


def home() -> Path:
    """The folder of all copies."""
    return cache_dir() / "remote"


def folder_of(address: Address) -> Path:
    """The folder of the copy of what lies at an address."""
    return home() / address.key
