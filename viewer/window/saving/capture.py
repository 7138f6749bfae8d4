"""What a person keeps: files under new names, written beside and renamed, never half there."""

import contextlib
import itertools
from collections.abc import Iterator
from datetime import datetime
from pathlib import Path

import numpy as np

from ....model.common.files.atomic_write import write_atomic
from ....model.common.files.temporary import reserved
from ...common.errors import InputError
from ...common.files import write_png


@contextlib.contextmanager
def stamped(prefix: str, suffix: str, folder: Path) -> Iterator[Path]:
    """``prefix-YYYYmmdd-HHMMSS.suffix`` in ``folder``, with a number where that is taken, also by another window that saves in
    the same second: the name is reserved within the block.  Raises InputError where the folder cannot be written."""
    stem = f"{prefix}-{datetime.now():%Y%m%d-%H%M%S}"
    first = folder / f"{stem}{suffix}"
    with contextlib.ExitStack() as stack:
        try:
            path = stack.enter_context(reserved(
                first if number == 1 else folder / f"{stem}-{number}{suffix}" for number in itertools.count(1)))  # fmt: skip
        except OSError as error:
            raise unwritable(first, error) from None
        yield path


@contextlib.contextmanager
def name_kept(path: Path) -> Iterator[None]:
    """Within the block another window finds ``path`` taken, where nothing lies there yet: what takes minutes is written under a
    name that was free when it was chosen.  Where the name cannot be reserved, whoever writes says why."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):
            stack.enter_context(reserved([path]))
        yield


def write_beside(path: Path, data: bytes) -> None:
    """Writes ``path`` in one step.  Raises InputError naming the file and the cause; nothing is left behind then."""
    try:
        write_atomic(path, lambda beside: beside.write_bytes(data))
    except OSError as error:
        raise unwritable(path, error) from None


def save_png(path: Path, image: np.ndarray, text: dict[str, str] | None = None) -> None:
    """Writes (H, W, 3) or (H, W, 4) uint8, row 0 on top, with the text kept inside, the same bytes as ``render``.

    Raises InputError if it cannot be written.
    """
    try:
        write_png(path, image, text)
    except OSError as error:
        raise unwritable(path, error) from None


def unwritable(path: Path, error: OSError) -> InputError:
    """What a person reads where a file cannot be written."""
    return InputError(f"cannot be written ({error.strerror or error})", file=path,
                      remedy="choose a folder that has room and can be written to")
