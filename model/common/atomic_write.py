"""Atomic write: a temporary file, then a rename, so that no reader finds a partial file.

Pipes and devices are written directly.
"""

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

_DESCRIPTOR = re.compile(r"^/dev/(stdout|stderr|fd/\d+)$|^/proc/[^/]+/fd/\d+$")
"""Paths of open file descriptors: even where such a descriptor is a regular file, it must not be replaced by a rename."""


def passes_through(path: Path) -> bool:
    """Whether a path is a device, a pipe or an open descriptor, which is written to directly and never replaced."""
    return bool(_DESCRIPTOR.match(os.path.abspath(path))) or (path.exists() and not path.is_file() and not path.is_dir())


def write_atomic(path: Path, write: Callable[[Path], object]) -> None:
    """Calls ``write`` with a temporary path in the same folder and renames the result to ``path``.

    On any failure, Ctrl-C included, the temporary file is removed and an existing ``path`` stays unchanged.  A symbolic link
    stays a link, and its target is replaced.  The result is appended to a device or pipe, such as /dev/stdout.
    """
    if passes_through(path):
        with tempfile.TemporaryDirectory(prefix="pointglass-") as folder:
            made = Path(folder) / path.name
            write(made)
            sys.stdout.flush()  # keeps the order of earlier output
            with made.open("rb") as source, path.open("ab") as target:
                shutil.copyfileobj(source, target)
        return
    target_path = Path(os.path.realpath(path))
    partial = target_path.with_name(f".{target_path.name}.{os.getpid()}.partial")
    try:
        write(partial)
        partial.replace(target_path)
    finally:
        partial.unlink(missing_ok=True)
