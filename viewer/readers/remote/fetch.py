"""Files at addresses as local paths: described (its header), coarse (the upper levels of a COPC file), or whole.

Copies are kept in the cache folder, at most POINTGLASS_REMOTE_GB gigabytes of them (50 where it is not set); those used longest
ago go first.  A copy is compared with the server each time it is used, by length and tag; where the server does not answer, a
complete copy is used, and that is said.  Processes that want the same file wait for each other.
"""

import contextlib
import logging
import os
import shutil
import struct
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from ....model.common.system import lock_file
from ...common.errors import InputError
from ...common.paths import cache_dir
from ...common.progress import progress
from ..las.copc_nodes import read_nodes
from ..sampling import sampled_nodes
from .address import Address
from .local_copy import BLOCK, LocalCopy, read_state
from .remote_object import ChangedFileError, RemoteObject, UnreachableError

_HEAD = 4 * BLOCK
"""Bytes of the first request: the header and the records behind it of all LAS files at hand."""
_MOST_DESCRIBED = 64 << 20
"""Bytes behind the points (hierarchy, chunk table, waveforms) that are read to describe a file."""
_LIMIT_GB = 50.0
_RECENT_S = 3600.0
"""Copies used in the last hour stay: another process may read them."""
_log = logging.getLogger(__name__)


def local_path(address: Address) -> Path:
    """Where the copy lies, whether it is there or not."""
    return _folder(address) / address.name


def fetched(address: Address) -> Path:
    """The whole file.  Raises InputError, one line, where it cannot be had; Cancelled."""
    label = f"fetching {address.name} from {address.host}"
    try:
        return _used(address, lambda copy: copy.fetch_all(label))
    except UnreachableError as error:
        state = read_state(_folder(address))
        if state is None or not state["complete"] or not local_path(address).is_file():
            raise
        _log.warning("%s; the copy read earlier is used", str(error).split(" (", 1)[0])
        return local_path(address)


def coarse(address: Address, points: int) -> Path | None:
    """A file of which the header and, of COPC, the upper levels with about ``points`` points are there; None for others."""
    found: list[bool] = []

    def read(copy: LocalCopy) -> None:
        described = _describe(copy)
        if copy.complete:
            found.append(True)
        elif described and (nodes := read_nodes(copy.path, described)):
            chosen = [node for node, _ in sampled_nodes(nodes.level, nodes.points, points)]
            runs = [(int(nodes.place[node]), int(nodes.place[node] + nodes.bytes[node])) for node in chosen]
            copy.fetch(runs)
            found.append(True)

    path = _used(address, read)
    return path if found else None


def described(address: Address) -> tuple[Path, float] | None:
    """A LAS, LAZ or COPC file whose header, records and table of chunks are there, and the share of the file that was read;
    None for other formats, for servers that give no parts, and for files that are there completely."""
    known: list[float] = []

    def read(copy: LocalCopy) -> None:
        if not copy.complete and copy.remote.ranges and _describe(copy):
            known.append(copy.share)

    path = _used(address, read)
    return (path, known[0]) if known else None


def _describe(copy: LocalCopy) -> int:
    """Reads what describes a LAS file; the number of its points, 0 for other files."""
    if not copy.remote.ranges:
        return 0
    with copy.path.open("rb") as file:
        head = file.read(375)
        if head[:4] != b"LASF" or len(head) < 227:
            return 0
        points_at, point_format = struct.unpack_from("<I", head, 96)[0], head[104]
        count = struct.unpack_from("<I", head, 107)[0]
        extended = 0
        if head[25] >= 4 and len(head) >= 255:
            extended = struct.unpack_from("<Q", head, 235)[0] if struct.unpack_from("<I", head, 243)[0] else 0
            count = struct.unpack_from("<Q", head, 247)[0] or count
        copy.fetch([(0, min(points_at + 8, copy.remote.size))])
        file.seek(points_at)
        table = struct.unpack("<q", (file.read(8) + bytes(8))[:8])[0] if point_format & 0xC0 else 0
    behind = [place for place in (table, extended) if 0 < place < copy.remote.size]
    if behind and copy.remote.size - min(behind) <= _MOST_DESCRIBED:
        copy.fetch([(min(behind), copy.remote.size)])
    return count


def _used(address: Address, work: Callable[[LocalCopy], None]) -> Path:
    """Does ``work`` with the copy of an address, once more where the file changes on the server meanwhile."""
    for last in (False, True):
        remote = RemoteObject(address, _HEAD)
        _make_room(address, remote.size)
        with _alone(address):
            try:
                copy = LocalCopy(_folder(address), address.name, remote)
                work(copy)
                return copy.path
            except ChangedFileError:
                if last:
                    raise InputError(f"{address.text}: changes while it is read", remedy="try again later") from None
    raise AssertionError("one of two attempts ends otherwise")


@contextlib.contextmanager
def _alone(address: Address) -> Iterator[None]:
    """The only one to fill the copy: waits for other processes."""
    folder = _folder(address)
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
    with contextlib.suppress(BlockingIOError):
        return lock_file(folder / "lock")
    with progress(0, f"waiting for another pointglass that reads {name}") as meter:
        while True:
            with contextlib.suppress(BlockingIOError):
                return lock_file(folder / "lock")
            meter.update(0)  # a window cancels here
            time.sleep(0.2)


def _make_room(address: Address, size: int) -> None:
    """Removes the copies used longest ago where all, with the one that comes, are more than allowed."""
    limit = _limit_gb() * 1e9
    others = sorted((entry for entry in _home().glob("*/") if entry.name != address.key), key=_last_used)
    held = {entry: sum(_on_disk(file) for file in entry.iterdir()) for entry in others}
    for entry in others:
        if sum(held.values()) + size <= limit or _last_used(entry) > time.time() - _RECENT_S:
            return
        shutil.rmtree(entry, ignore_errors=True)
        held.pop(entry)


def _on_disk(file: Path) -> int:
    """Bytes that a file takes, without its holes where the system tells them."""
    try:
        found = file.stat()
    except OSError:
        return 0
    return getattr(found, "st_blocks", -(-found.st_size // 512)) * 512


def _limit_gb() -> float:
    text = os.environ.get("POINTGLASS_REMOTE_GB", "")
    try:
        return float(text) if text else _LIMIT_GB
    except ValueError:
        raise InputError(f"POINTGLASS_REMOTE_GB is {text!r}: expected a number of gigabytes") from None


def _last_used(folder: Path) -> float:
    try:
        return folder.stat().st_mtime
    except OSError:
        return 0.0


def _home() -> Path:
    return cache_dir() / "remote"


def _folder(address: Address) -> Path:
    return _home() / address.key
