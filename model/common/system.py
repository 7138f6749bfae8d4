"""What differs between Linux, macOS and Windows: all other modules ask this one, and none asks for the system's name.

Each function has a form for systems that lack what it uses.  Windows has no fork, no locks of open files as flock sets them, no
SIGHUP and no SIGKILL; it refuses to rename or remove a file that is open or memory-mapped; its permission bits say nothing; its
console sends Ctrl-Break beside Ctrl-C.  ``/proc`` exists on Linux only.

Tested by taking away what such systems lack (tests/unit/common/test_system.py); run on Linux only so far.
"""

import contextlib
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterable
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None

WINDOWS = os.name == "nt"
STOPS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name))
"""Signals that stop a command and that a scheduler or a person sends.  SIGBREAK: Ctrl-Break, on Windows."""
ALL_STOPS = (*STOPS, *([signal.SIGHUP] if hasattr(signal, "SIGHUP") else []))
"""The same, and the one that a closed terminal sends."""
_PROC = Path("/proc")
_REPLACE_S = 2.0
"""Seconds during which Windows is asked again to rename: scanners for viruses open new files for a moment.  Not measured."""
_KILLED_S = 2.0
"""Seconds in which processes that are killed must end: the system frees their memory first."""


# -- files -------------------------------------------------------------------------------------------------------------


def replace(source: Path, target: Path) -> None:
    """Renames a file or folder; a file takes the place of an existing one.  Raises OSError, on Windows also where ``target`` is
    open or memory-mapped in any process."""
    deadline = time.monotonic() + (_REPLACE_S if WINDOWS else 0.0)
    while True:
        try:
            source.replace(target)
            return
        except PermissionError:
            if time.monotonic() >= deadline:
                raise
            time.sleep(0.05)


def locked(path: Path) -> int | None:
    """Locks a file or folder until the returned descriptor is closed, or the process ends in whatever way.

    None where there are no locks: on Windows, where the open descriptor would keep the file from being renamed, and on some
    network file systems.  Raises BlockingIOError where another process holds it, another OSError where it cannot be opened.
    """
    if fcntl is None:
        return None
    file = os.open(path, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK)
    try:
        taken = _lock(file)
    except BlockingIOError:
        os.close(file)
        raise
    if not taken:
        os.close(file)
        return None
    return file


def lock_file(path: Path) -> int:
    """Locks a file that is there for its lock only, and is made where it is missing; as ``locked``, on Windows too.

    Where the file system has no locks, nobody is taken to hold it.
    """
    file = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o600)
    try:
        _lock(file)
    except BlockingIOError:
        os.close(file)
        raise
    return file


def remove_lock_file(path: Path, file: int) -> None:
    """Removes a file locked by ``lock_file`` and ends its lock.  Raises OSError."""
    if WINDOWS:  # where no open file can be removed
        os.close(file)
        path.unlink(missing_ok=True)
    else:  # nobody may lock it in between
        path.unlink(missing_ok=True)
        os.close(file)


def _lock(file: int) -> bool:
    """Whether the lock was taken; False where there are no locks.  Raises BlockingIOError where another process holds it."""
    if fcntl is not None:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise
        except OSError:
            return False
        return True
    try:
        import msvcrt
    except ImportError:
        return False
    try:
        msvcrt.locking(file, msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined]
    except OSError as error:
        raise BlockingIOError(*error.args) from None
    return True


def only_own(found: os.stat_result) -> bool:
    """Whether only this user can write to what ``found`` describes.  On Windows the bits say nothing: True there, since
    the folders of a user's profile are his own."""
    return WINDOWS or (found.st_uid == user_number() and not found.st_mode & 0o022)


def user_number() -> int:
    """The number of this user, 0 where users have none."""
    return os.getuid() if hasattr(os, "getuid") else 0


def allocate(file: int, size: int) -> None:
    """Makes an open file ``size`` bytes long, with its blocks allocated where the system can.  Raises OSError."""
    if hasattr(os, "posix_fallocate"):
        os.posix_fallocate(file, 0, size)
    else:
        os.ftruncate(file, size)


def read_at(file: io.FileIO, into: memoryview, place: int, turn: threading.Lock) -> int:
    """Reads bytes from ``place`` on and returns how many, 0 at the end of the file.  May be called from several threads.

    turn: held where the threads share one position in the file, on Windows.
    """
    if hasattr(os, "preadv"):
        return os.preadv(file.fileno(), [into], place)
    with turn:
        file.seek(place)
        return file.readinto(into) or 0


def path_of_descriptor(file: int) -> Path | None:
    """A path under which an open file is opened again, also one without a name; None where the system has none."""
    folder = _PROC / "self" / "fd"
    return folder / str(file) if folder.is_dir() else None


def widen_pipe(file: int, size: int) -> None:
    """Lets a pipe hold ``size`` bytes, where the system can and the user has not too many such pipes."""
    if hasattr(fcntl, "F_SETPIPE_SZ"):
        with contextlib.suppress(OSError):
            fcntl.fcntl(file, fcntl.F_SETPIPE_SZ, size)  # type: ignore[union-attr]


def file_in_memory(name: str) -> int | None:
    """Descriptor of a new file in memory; None where the system has none."""
    return os.memfd_create(name) if hasattr(os, "memfd_create") else None


# -- processes ---------------------------------------------------------------------------------------------------------


def after_fork_in_child(function: Callable[[], object]) -> None:
    """``function`` is called in a child made by fork, where there is fork."""
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=function)


def address_space_is_limited() -> bool:
    """Whether this process may use only so many addresses (``ulimit -v``), and can fork."""
    try:
        import resource
    except ImportError:  # Windows
        return False
    return hasattr(os, "fork") and resource.getrlimit(resource.RLIMIT_AS)[0] != resource.RLIM_INFINITY


def child_processes() -> set[int]:
    """Numbers of the processes that this one started, as far as the system lists them."""
    found: set[int] = set()
    with contextlib.suppress(OSError, ValueError):
        for task in os.listdir(_PROC / "self" / "task"):
            with open(_PROC / "self" / "task" / task / "children") as file:
                found |= set(map(int, file.read().split()))
    return found


def end_processes(children: Iterable[int], seconds: float) -> None:
    """Ends child processes: SIGTERM, and SIGKILL for those that are still there after ``seconds``.  On Windows the
    first ends a process at once."""
    left = [*children]
    for pid in left:
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGTERM)
    if not hasattr(os, "WNOHANG"):
        return
    deadline = time.monotonic() + seconds
    while left and time.monotonic() < deadline:
        left = [pid for pid in left if not _ended(pid)]
        time.sleep(0.01 if left else 0.0)
    for pid in left:
        with contextlib.suppress(OSError):
            os.kill(pid, signal.SIGKILL)
    deadline = time.monotonic() + _KILLED_S
    while left and time.monotonic() < deadline:  # its locks say that its files are in use until it is gone
        left = [pid for pid in left if not _ended(pid)]
        time.sleep(0.01 if left else 0.0)


def _ended(pid: int) -> bool:
    try:
        return os.waitpid(pid, os.WNOHANG)[0] == pid
    except OSError:  # someone else has waited for it
        return True


def lower_thread_priority(niceness: int) -> None:
    """Gives the calling thread this niceness, where its own is lower: going back is not allowed, and a person may
    have started the whole process with more.  Only on Linux does a thread have its own."""
    if sys.platform == "linux" and os.getpriority(os.PRIO_PROCESS, thread := threading.get_native_id()) < niceness:
        os.setpriority(os.PRIO_PROCESS, thread, niceness)


# -- the machine -------------------------------------------------------------------------------------------------------


def available_memory() -> int | None:
    """Bytes of main memory that this process can allocate without swapping; None where the system does not tell."""
    free = _memory("MemAvailable")
    if free is None:
        return None
    try:  # a container may have less memory than its machine
        group = Path("/sys/fs/cgroup")
        most = int((group / "memory.max").read_text("ascii"))
        files = (group / "memory.stat").read_text("ascii").split("\ninactive_file ")[1].split()[0]
        return max(0, min(free, most - int((group / "memory.current").read_text("ascii")) + int(files)))
    except (OSError, ValueError, IndexError):
        return free


def total_memory() -> int | None:
    """Bytes of the machine's main memory; None where the system does not tell."""
    return _memory("MemTotal")


def _memory(row: str) -> int | None:
    try:
        lines = (_PROC / "meminfo").read_text("ascii").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(f"{row}:"))
    except (OSError, ValueError, IndexError, StopIteration):
        return None


def resident_memory() -> int:
    """Resident memory of this process in bytes, mapped files included; its peak where only that is known, else 0."""
    try:
        for line in (_PROC / "self" / "status").read_text().splitlines():
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


def processor_name() -> str:
    """The processor's model; its architecture where the system does not tell."""
    try:
        lines = (_PROC / "cpuinfo").read_text().splitlines()
        return next(line.split(":", 1)[1].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):
        import platform

        return platform.processor() or platform.machine()
