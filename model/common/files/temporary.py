"""Temporary files and folders beside the place where the finished one will be.

Created exclusively under an unpredictable name (``.NAME.TOKEN.PID.partial`` and the ending of NAME, by which libraries choose a
format), never through a link, with no more rights than the sources of what is written into them.  They are removed at the end
of the block and where the process is stopped (model/common/process/signals.py).

Those of a killed process are removed by the next start: each is locked while it is in use, and the system releases a lock when
its process ends, in whatever way.  All processes see the lock, also in other containers and, on network file systems with
locks, on other machines, where a process number would mean nothing.  A record in the state folder says where they are.
"""

import contextlib
import errno
import os
import re
import secrets
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from ..process.signals import AFTER_CHILDREN, cleaned
from ..system import locked
from .state_folder import state_dir

OURS = re.compile(r"^\..*\.([0-9a-f]{8}|[0-9a-f]{16})\.\d+(\.old\.\d+)?\.(partial(\.[^.]{1,20})?|tmp)$|^\..+\.\d+\.partial$")
"""Names of temporary files and folders, those of earlier versions included."""
_TRIES = 100  # attempts to create one that no other process sweeps in the moment before it is locked; a guard against no end
_ABANDONED = 7 * 24 * 3600.0
"""Seconds without a change after which one counts as abandoned without locks: less than the 10 days after which
systemd-tmpfiles removes it from /tmp; building a grid takes 1.7 s of a processor a million points (studio.laz), so 350 billion
points a week."""
_LONGEST = 120  # characters of NAME that are kept; file systems allow 255 bytes
_swept: set[Path] = set()


@contextlib.contextmanager
def temporary_file(target: Path, *, sources: Iterable[Path] = ()) -> Iterator[Path]:
    """An empty file beside ``target``, locked; it may be written by its name, or renamed.

    sources: files whose contents go into it: who may not read one of them may not read it either.  Raises OSError.
    """
    with _temporary(target, lambda path: _new_file(path, 0o666 & allowed(sources)), sources) as path:
        yield path


@contextlib.contextmanager
def temporary_folder(target: Path, *, sources: Iterable[Path] = ()) -> Iterator[Path]:
    """A folder beside ``target``, locked.  sources: as for temporary_file.  Raises OSError."""
    with _temporary(target, lambda path: _new_folder(path, 0o777 & allowed(sources)), sources) as path:
        yield path


@contextlib.contextmanager
def reserved(paths: Iterable[Path]) -> Iterator[Path]:
    """The first of ``paths`` where nothing lies yet, as an empty file: no other process takes that name meanwhile.  Where it is
    still empty at the end of the block, or the process is stopped, it goes again; of a killed process at the next start, by its
    record.  Raises OSError."""
    for path in paths:
        with contextlib.suppress(FileExistsError):
            _new_file(path, 0o666)
            break
    else:
        raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST))
    held = None
    with cleaned(lambda: _remove_empty(path)):
        with contextlib.suppress(OSError):
            held = locked(path)  # before the record: whoever reads that finds the name in use
        try:
            with _recorded(path):
                yield path
        finally:
            _release(held)


def allowed(sources: Iterable[Path]) -> int:
    """Permission bits that what is made of ``sources`` may have: those of a class of users that may read every source."""
    bits = 0o777
    for source in sources:
        with contextlib.suppress(OSError):
            mode = os.stat(source).st_mode
            bits &= 0o777 ^ (0 if mode & 0o040 else 0o070) ^ (0 if mode & 0o004 else 0o007)
    return bits


def restrict(path: Path, sources: Iterable[Path]) -> None:
    """Takes from a file, or a folder and all in it, the rights that ``sources`` do not have.  Where the group of a file is not
    that of the sources, it gets the rights of others.  Raises OSError."""
    sources = list(sources)
    if not sources:
        return
    bits = allowed(sources)
    groups = {os.stat(source).st_gid for source in sources}
    for inner in [path, *(path.rglob("*") if path.is_dir() else ())]:
        stat = inner.lstat()
        mode = stat.st_mode & 0o777 & bits
        if groups != {stat.st_gid}:
            mode &= 0o707 | (bits & 0o007) << 3
        if mode != stat.st_mode & 0o777:
            inner.chmod(mode)


def sweep(parent: Path) -> None:
    """Removes the temporary files and folders in ``parent`` whose processes are gone."""
    with contextlib.suppress(OSError):
        for entry in [*os.scandir(parent)]:
            if OURS.match(entry.name):
                _remove_abandoned(Path(entry.path))


def sweep_once(parent: Path) -> None:
    """The same, the first time that this process asks for the folder."""
    if parent not in _swept:
        _swept.add(parent)
        sweep(parent)


def sweep_recorded() -> None:
    """Removes what processes that were killed have left anywhere, by the records in the state folder: temporary files, and
    names that they reserved, as far as these are empty."""
    with contextlib.suppress(OSError):
        for entry in [*os.scandir(_records())]:
            record = Path(entry.path)
            with contextlib.suppress(OSError, ValueError):
                path = Path(record.read_text("utf-8"))
                gone = _remove_abandoned if OURS.match(path.name) else _remove_reserved
                if not path.is_absolute() or gone(path):
                    record.unlink()


def _remove_abandoned(path: Path) -> bool:
    """Removes a temporary file or folder unless a process uses it.  Returns whether it is gone."""
    if path.is_symlink():
        return True
    if not (path.is_dir() or path.is_file()):
        return not path.exists()
    try:
        lock = locked(path)
    except OSError:
        return not path.exists()
    try:
        if lock is None and not _is_old(path):
            return False
        _remove(path)
    finally:
        _release(lock)
    return not path.exists()


def _remove_empty(path: Path) -> None:
    if path.is_file() and not path.is_symlink() and not path.stat().st_size:
        _remove(path)


def _remove_reserved(path: Path) -> bool:
    """Removes a reserved name that is still empty, unless a process uses it.  Returns whether nobody does any more."""
    try:
        lock = locked(path)
    except BlockingIOError:
        return False
    except OSError:  # gone, or something else lies there
        return True
    try:
        if lock is None and path.is_file() and not path.stat().st_size and not _is_old(path):
            return False  # without locks it may be in use
        _remove_empty(path)
    finally:
        _release(lock)
    return True


@contextlib.contextmanager
def _temporary(target: Path, make: Callable[[Path], object], sources: Iterable[Path]) -> Iterator[Path]:
    sweep_once(target.parent)
    for _ in range(_TRIES):
        path = target.with_name(_name(target))
        with _recorded(path), cleaned(lambda path=path: _remove(path)):
            make(path)
            try:
                restrict(path, sources)
                lock = locked(path)
            except BlockingIOError:  # another process sweeps it, since it was not locked yet
                continue
            except FileNotFoundError:
                if path.exists():  # one of the sources is missing
                    raise
                continue  # swept
            try:
                if path.exists():
                    yield path
                    return
            finally:
                _release(lock)
    raise OSError(errno.EBUSY, "its temporary files are removed by another process")


def _name(target: Path) -> str:
    stem = os.fsencode(target.name)[:_LONGEST].decode("utf-8", "ignore")
    ending = target.suffix if 1 < len(os.fsencode(target.suffix)) <= 20 else ""
    return f".{stem}.{secrets.token_hex(8)}.{os.getpid()}.partial{ending}"


def _new_file(path: Path, mode: int) -> None:
    os.close(os.open(path, os.O_RDWR | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0), mode))


def _new_folder(path: Path, mode: int) -> None:
    path.mkdir(mode)


def _remove(path: Path) -> None:
    for _ in range(3):  # a thread may still add a file to the folder
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path, ignore_errors=True)
        else:
            with contextlib.suppress(OSError):
                path.unlink()
        if not path.exists():
            return


def _records() -> Path:
    return state_dir() / "unfinished"


@contextlib.contextmanager
def _recorded(path: Path) -> Iterator[None]:
    """A record of ``path`` in the state folder while it exists; none where that folder cannot be written."""
    record = None
    with contextlib.suppress(OSError):
        folder = _records()
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        record = folder / secrets.token_hex(8)
        record.write_text(os.path.abspath(path), "utf-8", "surrogateescape")
    if record is None:
        yield
        return
    with cleaned(lambda: record.unlink(missing_ok=True)):
        yield


def _release(lock: int | None) -> None:
    if lock is not None:
        os.close(lock)


def _is_old(path: Path) -> bool:
    try:
        inside = path.iterdir() if path.is_dir() else ()
        return time.time() - max(each.stat().st_mtime for each in (path, *inside)) > _ABANDONED
    except OSError:
        return False


AFTER_CHILDREN.append(sweep_recorded)
