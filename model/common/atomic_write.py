"""Files written beside and renamed, so that nobody ever finds half of one; what is no file is written to."""

import os
import re
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

_OPENED = re.compile(r"^/dev/(stdout|stderr|fd/\d+)$|^/proc/[^/]+/fd/\d+$")
"""What a process has open, by a name: be it a file, its name is not ours to give to another."""


def passes_through(path: Path) -> bool:
    """Whether a path leads to a device, a pipe or what this process has open: written to, and never replaced."""
    return bool(_OPENED.match(os.path.abspath(path))) or (path.exists() and not path.is_file() and not path.is_dir())


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Calls ``write`` with a temporary name in the same folder and renames the result to ``path``.

    On any failure, Ctrl-C included, the temporary file is removed and an older ``path`` stays as it was.  A link stays one, and
    what it leads to is written; a device or a pipe, such as /dev/stdout, is written to and not replaced.
    """
    if passes_through(path):
        with tempfile.TemporaryDirectory(prefix="pointglass-") as folder:
            made = Path(folder) / path.name
            write(made)
            sys.stdout.flush()  # what was said before comes before
            with made.open("rb") as source, path.open("ab") as target:
                shutil.copyfileobj(source, target)
        return
    place = Path(os.path.realpath(path))
    beside = place.with_name(f".{place.name}.{os.getpid()}.partial")
    try:
        write(beside)
        beside.replace(place)
    finally:
        beside.unlink(missing_ok=True)
