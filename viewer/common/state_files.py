"""Files in which the program remembers things for itself, as JSON: read with care, written beside and renamed.

A file that cannot be read, whatever is wrong with it, must not keep the window from opening: it is renamed to NAME.unreadable,
a line says so, and the program begins anew.
"""

import json
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from ...model.common.files.json_file import write_json
from ...model.common.system import replace
from .errors import InputError

T = TypeVar("T")
_MOST = 16 << 20
"""Bytes: over a thousand times what is remembered, which has thousands."""
UNREADABLE = ".unreadable"
_log = logging.getLogger(__name__)


def read_state(path: Path, parse: Callable[[Any], T], otherwise: T, *, most: int = _MOST) -> T:
    """What ``parse`` makes of the JSON in a file; ``otherwise`` where there is no file, or none that can be read.

    parse: may raise what conversions raise, and InputError.  most: bytes.
    """
    try:
        if not path.exists():
            return otherwise
        if not path.is_file():  # opening a pipe would block
            raise ValueError("not a regular file")
        if path.stat().st_size > most:
            raise ValueError(f"{path.stat().st_size:,} bytes are too many")
        return parse(json.loads(path.read_text("utf-8")))
    except PermissionError as error:
        _log.warning("%s cannot be read: %s", path, error.strerror)
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError, OverflowError, RecursionError,
            InputError) as error:  # fmt: skip
        _set_aside(path, error)
    return otherwise


def write_state(path: Path, data: object) -> None:
    """Replaces the file; the folder is made for its owner only.  Raises OSError."""
    path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    write_json(path, data)


def _set_aside(path: Path, error: Exception) -> None:
    aside = path.with_name(path.name + UNREADABLE)
    why = (str(error).splitlines() or [type(error).__name__])[0][:120]
    try:
        replace(path, aside)
        _log.warning("%s is not readable (%s); it is kept as %s", path, why, aside.name)
    except OSError as failed:
        _log.warning("%s is not readable (%s) and cannot be renamed: %s", path, why, failed.strerror)
