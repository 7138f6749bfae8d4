"""Folders for results, removed again where nothing was written; small text files written atomically."""

import contextlib
from collections.abc import Iterator
from pathlib import Path

from ..process.signals import undone
from .atomic_write import write_atomic


@contextlib.contextmanager
def made_folder(folder: Path, *, make: bool = True) -> Iterator[Path]:
    """Creates ``folder`` and its parents.  If the block fails or is interrupted, the created folders that are empty are
    removed.

    make: False where the block creates the folder itself.  Raises OSError where it cannot be created.
    """
    new = [path for path in (folder, *folder.parents) if not path.exists()]

    def remove() -> None:
        for path in new:  # innermost first; rmdir fails for a folder with contents
            with contextlib.suppress(OSError):
                path.rmdir()

    with undone(remove):
        if make:
            folder.mkdir(parents=True, exist_ok=True)
        yield folder


def replace_text(path: Path, text: str) -> None:
    """Writes a small text file atomically: a concurrent reader finds the old or the new text."""
    write_atomic(path, lambda partial: partial.write_text(text))
