"""Folders made for results, which are not left behind empty where there are none; small files that are there whole or not."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from model.common.atomic_write import write_whole


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


def replace_text(path: Path, text: str) -> None:
    """Writes a small text file; whoever reads it meanwhile finds the old one or the new."""
    write_whole(path, lambda beside: beside.write_text(text))
