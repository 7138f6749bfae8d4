"""Atomic write: a temporary file, then a rename, so that no reader finds a partial file.

Pipes and devices are written directly.
"""

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path

from ..process.signals import cleaned
from ..system import replace
from .temporary import restrict, temporary_file

_DESCRIPTOR = re.compile(r"^/dev/(stdout|stderr|fd/\d+)$|^/proc/[^/]+/fd/\d+$")
"""Paths of open file descriptors: even where such a descriptor is a regular file, it must not be replaced by a rename."""


def passes_through(path: Path) -> bool:
    """Whether a path is a device, a pipe or an open descriptor, which is written to directly and never replaced."""
    return bool(_DESCRIPTOR.match(os.path.abspath(path))) or (path.exists() and not path.is_file() and not path.is_dir())


def write_atomic(path: Path, write: Callable[[Path], object], *, sources: Iterable[Path] = ()) -> None:
    """Calls ``write`` with a temporary path in the same folder, which has the ending of ``path``, and renames the result.

    On any failure, and where the process is stopped, the temporary file is removed and an existing ``path`` stays unchanged.  A
    file that is replaced keeps its rights.  A symbolic link stays a link, and its target is replaced.  The result is appended
    to a device or pipe, such as /dev/stdout. sources: files whose contents are written, such as scans: who may not read them
    may not read ``path`` either.
    """
    sources = list(sources)
    if passes_through(path):
        folder = Path(tempfile.mkdtemp(prefix="pointglass-"))
        with cleaned(lambda: shutil.rmtree(folder, ignore_errors=True)):
            made = folder / path.name
            write(made)
            sys.stdout.flush()  # keeps the order of earlier output
            with made.open("rb") as source, path.open("ab") as target:
                shutil.copyfileobj(source, target)
        return
    target_path = Path(os.path.realpath(path))
    with temporary_file(target_path, sources=sources) as partial:
        write(partial)
        if target_path.exists():
            partial.chmod(target_path.stat().st_mode & 0o777)
        restrict(partial, sources)
        replace(partial, target_path)
