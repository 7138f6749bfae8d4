"""Folders made for results, which are not left behind empty where there are none."""

import contextlib
from collections.abc import Iterator
from pathlib import Path


@contextlib.contextmanager
def made_folder(folder: Path, *, make: bool = True) -> Iterator[Path]:
    """Makes ``folder`` and what lies above it; where the block fails, Ctrl-C included, what it made and left empty goes again.

    make: False where the block makes the folder itself, if it comes so far.  Raises OSError where it cannot be made.
    """
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        if make:
            folder.mkdir(parents=True, exist_ok=True)
        yield folder
    except BaseException:
        for path in new:  # the innermost first; one that holds something stays, and so does what is above it
            with contextlib.suppress(OSError):
                path.rmdir()
        raise
