"""Copies of files for libraries and readers that need them otherwise than they are: a temporary file without a name, which is
gone with the process, and is opened by its descriptor.  Where the system cannot do that (macOS, Windows) there is no copy."""

import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from ...model.common.system import path_of_descriptor
from ..common.errors import InputError


def can_copy() -> bool:
    """Whether the system lets a file without a name be opened again."""
    return path_of_descriptor(0) is not None


def path_of(copy: BinaryIO) -> Path:
    """The path under which a copy is opened."""
    path = path_of_descriptor(copy.fileno())
    assert path is not None  # can_copy
    return path


def nameless_copy(path: Path, fill: Callable[[BinaryIO, BinaryIO], object], why: str, what: str, remedy: str) -> BinaryIO:
    """The copy of ``path``, opened, after ``fill(file, copy)`` has written it.

    Raises InputError where there is no room for it.  why: the copy is needed.  what: is copied.  remedy: beside another TMPDIR.
    """
    try:
        copy = tempfile.TemporaryFile(prefix="pointglass-")  # noqa: SIM115  (open as long as its caller holds it)
        with path.open("rb") as file:
            fill(file, copy)
        copy.flush()
    except OSError as error:
        raise InputError(f"{why}, and there is no room in {tempfile.gettempdir()} for {what} ({error.strerror}); "
                         f"{remedy}set TMPDIR", file=path) from None  # fmt: skip
    return copy
