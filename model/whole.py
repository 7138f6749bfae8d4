"""Files written beside and renamed, so that nobody ever finds half of one."""

import os
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path


def write_whole(path: Path, write: Callable[[Path], object]) -> None:
    """Calls ``write`` with a temporary name in the same folder and renames the result to ``path``.

    On any failure, Ctrl-C included, the temporary file is removed and an older ``path`` stays as it was.  A link stays one, and
    what it leads to is written; a device or a pipe, such as /dev/stdout, is written to and not replaced.
    """
    place = Path(os.path.realpath(path))
    if place.exists() and not place.is_file() and not place.is_dir():
        with tempfile.TemporaryDirectory(prefix="pointglass-") as folder:
            made = Path(folder) / path.name
            write(made)
            with made.open("rb") as source, place.open("wb") as target:
                shutil.copyfileobj(source, target)
        return
    beside = place.with_name(f".{place.name}.{os.getpid()}.partial")
    try:
        write(beside)
        beside.replace(place)
    finally:
        beside.unlink(missing_ok=True)
